"""The arrays of a glTF file, checked against the bytes that it holds.

Its JSON may use one array for any number of meshes, take any part of a buffer any number of times, and declare arrays
without any bytes behind them. What that takes in memory is added up, and refused before an array that is too much.
"""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rlacd.io.read.contents import MOST_PLACES
from rlacd.solid.arrays import FloatArray, Int64Array

Json: TypeAlias = dict[str, Any]

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""By component type; see "Accessor Data Types" in the specification."""

ITEMS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class Arrays:
    """The accessors of a file.

    Parameters
    ----------
    header : dict
        Its JSON.
    rest : bytes
        Of a binary file, what follows the JSON.
    given : int
        Bytes of the file.
    beside : callable
        Returns the content of a file that a buffer names.

    Raises
    ------
    ValueError
        It declares more than it holds, or more than is reasonable.
    FileNotFoundError
        Raised by `beside`.
    """

    def __init__(self, header: Json, rest: bytes | None, given: int, beside: Callable[[str], bytes]) -> None:
        self._rest, self._beside = rest, beside
        self._buffers: Sequence[Json] = header.get("buffers", [])
        self._views: Sequence[Json] = header.get("bufferViews", [])
        self._accessors: list[Json] = list(header.get("accessors", []))
        self._content: dict[int, bytes] = {}
        self._added: dict[int, npt.NDArray[Any]] = {}
        if len(self._buffers) > MOST_PLACES:
            raise ValueError(f"{len(self._buffers)} buffers, more than {MOST_PLACES}")
        uris = {buffer.get("uri", "data:") for buffer in self._buffers}
        given += sum(len(beside(uri)) for uri in sorted(uris) if not uri.startswith("data:"))
        self._most = 2**29 + 16 * given  # bytes: an index of one becomes eight, and some are used repeatedly

    def need(self, count: int) -> None:
        """Refuse a file once what is made of its arrays adds up to too many bytes."""
        self._most -= count
        if self._most < 0:
            raise ValueError("it decodes to more than is reasonable for its length")

    def add(self, rows: npt.NDArray[Any]) -> int:
        """Add an array; returns the index of its accessor."""
        self.need(8 * rows.size)
        self._added[len(self._accessors)] = rows
        self._accessors.append({})
        return len(self._accessors) - 1

    def accessor(self, index: int) -> Json:
        """What the file says of an array."""
        return dict(item(self._accessors, index))

    def integers(self, index: int, kind: str = "SCALAR") -> Int64Array:
        """An array of indices, ``[N, K]``."""
        rows = self._rows(index, kind)
        if rows.dtype.kind != "u" and index not in self._added:
            raise ValueError(f"accessor {index} holds no indices")
        return rows.astype(np.int64)

    def floats(self, index: int, kind: str = "VEC3") -> FloatArray:
        """An array of numbers, ``[N, K]``."""
        return as_floats(self._rows(index, kind), bool(self.accessor(index).get("normalized")))

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view."""
        view = item(self._views, index)
        start = natural(view.get("byteOffset", 0), "byteOffset")
        end = start + natural(view["byteLength"], "byteLength")
        buffer = self._buffer(view["buffer"])
        if end > len(buffer):
            raise ValueError(f"view {index} is longer than its buffer")
        return memoryview(buffer)[start:end]

    def _rows(self, index: int, kind: str) -> npt.NDArray[Any]:
        accessor, width = self.accessor(index), ITEMS[kind]
        if index in self._added:
            return self._added[index].reshape(-1, width)
        if accessor["type"] != kind:
            raise ValueError(f"accessor {index} is no {kind}")
        dtype, count = np.dtype(TYPES[accessor["componentType"]]), natural(accessor["count"], "count")
        self.need(8 * count * width)
        rows = np.zeros((count, width), dtype)
        if "bufferView" in accessor and count:
            stride = item(self._views, accessor["bufferView"]).get("byteStride", width * dtype.itemsize)
            rows = self._part(accessor, rows.shape, dtype, stride)
        sparse = accessor.get("sparse")
        if sparse is None:
            return rows
        changed = natural(sparse["count"], "count")
        at = self._part(sparse["indices"], (changed, 1), np.dtype(TYPES[sparse["indices"]["componentType"]]))
        rows = rows.copy()
        rows[at[:, 0]] = self._part(sparse["values"], (changed, width), dtype)
        return rows

    def _part(
        self, of: Json, shape: tuple[int, int], dtype: np.dtype[Any], stride: int | None = None
    ) -> npt.NDArray[Any]:
        """Rows in a buffer view; without a stride they lie close together."""
        row = shape[1] * dtype.itemsize
        stride = row if stride is None else natural(stride, "byteStride")
        view, start = self.view(of["bufferView"]), natural(of.get("byteOffset", 0), "byteOffset")
        if stride < row or (shape[0] and start + (shape[0] - 1) * stride + row > len(view)):
            raise ValueError(f"it declares {shape[0]} rows but has no room for them")
        return np.ndarray(shape, dtype, view, start, (stride, dtype.itemsize))

    def _buffer(self, index: int) -> bytes:
        if index not in self._content:
            uri = item(self._buffers, index).get("uri")
            if uri is not None:
                given = base64.b64decode(uri.partition(",")[2]) if uri.startswith("data:") else self._beside(uri)
            elif index == 0 and self._rest and len(self._rest) >= 8:
                given = self._rest[8 : 8 + struct.unpack_from("<I", self._rest)[0]]
            else:
                raise ValueError("a buffer without bytes")
            self._content[index] = given
        return self._content[index]


def item(items: Sequence[Any] | FloatArray, index: Any) -> Any:
    """An item of a list by its index in the file: one below zero would count from the end."""
    if type(index) is not int or index < 0:  # JSON's true is an int of Python
        raise IndexError(f"{index!r:.40} is no index")
    return items[index]


def natural(number: Any, what: str) -> int:
    """Check a number that the file gives."""
    if not isinstance(number, int) or number < 0:
        raise ValueError(f"{number!r:.40} as a {what}, which cannot be negative or fractional")
    return number


def as_floats(rows: npt.NDArray[Any], normalized: bool) -> FloatArray:
    """Numbers as glTF means them: normalised integers are shares of the largest, others their own value."""
    if not normalized or rows.dtype.kind not in "iu":
        return rows.astype(np.float64)
    return np.asarray(np.maximum(rows.astype(np.float64) / np.iinfo(rows.dtype).max, -1.0))
