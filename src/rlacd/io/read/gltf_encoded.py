"""Positions that a glTF file encodes, written out as plain numbers: Draco's streams, and normalised integers.

Draco is decoded by DracoPy (extra ``draco``) in a process of its own: a damaged stream may crash it. Integers that are
not normalised (KHR_mesh_quantization) need nothing: a node's scale makes them lengths.
"""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import MeshFileError, MissingExtraError
from rlacd.io.read.apart import answer_of
from rlacd.io.read.gltf import DRACO, ITEM_BYTES, ITEMS, Json, damaged, joined, refuse_hidden, split
from rlacd.io.read.limits import MOST_TRIANGLES, most_in_memory
from rlacd.pool import Blobs, Shared
from rlacd.pool.request import Values

DECODER = "rlacd.io.read.gltf_encoded:DracoDecoder"

_INTEGERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2"}
"""Component types that may be normalised."""

_FLOAT, _UNSIGNED = 5126, 5125

STRIP, FAN = 5, 6
"""Modes of primitives whose triangles share corners."""

FANS = re.compile(rb'"mode"\s*:\s*[56]')


def decoded_gltf(path: Path, content: bytes, beside: Callable[[str], bytes]) -> bytes:
    """Return a glTF file with the same triangles as plain numbers; the file itself if they are.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    content : bytes
        Its content, JSON or binary (GLB).
    beside : callable
        Returns the content of a file that a buffer names.

    Raises
    ------
    MeshFileError
        It is damaged, or would need more memory than is reasonable.
    MissingExtraError
        It is compressed with Draco, and the extra ``draco`` is not installed.
    """
    if DRACO.encode() not in content and b'"normalized"' not in content and FANS.search(content) is None:
        return content
    header, rest = split(path, content)
    try:
        refuse_hidden(path, header)
        file = _File(path, header, rest, len(content), beside)
        changed = file.decode_draco()
        changed |= file.spread_integers()
        changed |= file.spread_fans()
        return joined(file.finished(), rest) if changed else content
    except MeshFileError:
        raise
    except (TypeError, KeyError, IndexError, AttributeError, OverflowError, ValueError) as error:
        raise damaged(path, error) from error


class DracoDecoder:
    """The server of a process that decodes Draco's streams (see `rlacd.pool.request.Server`)."""

    def __init__(self, folder: Path) -> None:
        pass

    def __call__(self, values: Values, blobs: Blobs, shared: Mapping[str, Shared]) -> tuple[Values, dict[str, bytes]]:
        """Decode each stream: the attribute that `values` names for it as ``NAME.points``, and ``NAME.corners``."""
        import DracoPy

        arrays: dict[str, bytes] = {}
        for name, stream in blobs.items():
            try:
                mesh = DracoPy.decode(stream)
                points = np.asarray(mesh.get_attribute_by_unique_id(values["attributes"][name])["data"])
                corners = np.asarray(mesh.faces).reshape(-1, 3)
            except Exception as error:
                raise MeshFileError(
                    f"{values['path']} holds triangles that Draco cannot decode ({error!s:.100}): it is damaged; "
                    "export it again"
                ) from error
            if points.ndim != 2 or points.shape[1] != 3 or (len(corners) and corners.max() >= len(points)):
                raise MeshFileError(f"{values['path']} holds triangles without points: export it again")
            if len(corners) > MOST_TRIANGLES:
                raise MeshFileError(f"{values['path']} holds more than {MOST_TRIANGLES} triangles: simplify it first")
            arrays[f"{name}.points"] = _as_floats(points, values["normalized"][name]).tobytes()
            arrays[f"{name}.corners"] = corners.astype("<u4").tobytes()
        return {}, arrays


class _File:
    """A glTF file to which plain arrays are added, in a buffer of their own."""

    def __init__(
        self, path: Path, header: Json, rest: bytes | None, given: int, beside: Callable[[str], bytes]
    ) -> None:
        self._path, self._header, self._rest, self._beside = path, header, rest, beside
        self._most = most_in_memory(given)
        self._added: list[bytes] = []
        self._buffers: dict[int, bytes] = {}
        self._accessors: list[Json] = list(header.get("accessors", []))
        self._views: list[Json] = list(header.get("bufferViews", []))
        self._own_views = len(self._views)
        self._primitives = [primitive for mesh in header.get("meshes", []) for primitive in mesh["primitives"]]

    def decode_draco(self) -> bool:
        """Decode what Draco compressed; False if there is nothing."""
        required = DRACO in self._header.get("extensionsRequired", [])
        streams: dict[str, bytes] = {}
        attributes: dict[str, int] = {}
        normalized: dict[str, bool] = {}
        users: dict[str, list[Json]] = {}
        for primitive in self._primitives:
            compressed = primitive.get("extensions", {}).get(DRACO)
            if compressed is None:
                continue
            accessor = self._accessors[primitive["attributes"]["POSITION"]]
            if not required and "bufferView" in accessor:
                continue  # the same triangles, not compressed
            view, attribute = int(compressed["bufferView"]), int(compressed["attributes"]["POSITION"])
            name = f"{view}.{attribute}.{bool(accessor.get('normalized'))}"
            users.setdefault(name, []).append(primitive)
            streams[name] = self._bytes_of(view)
            attributes[name], normalized[name] = attribute, bool(accessor.get("normalized"))
        if not streams:
            return False
        if find_spec("DracoPy") is None:
            raise MissingExtraError(
                f"{self._path} is compressed with Draco: run  pip install 'rlacd[draco]'  and try again."
            )
        self._need(sum(map(len, streams.values())))
        values = {"path": str(self._path), "attributes": attributes, "normalized": normalized}
        arrays = answer_of(DECODER, self._path, "glTF", values, streams).blobs
        self._need(sum(map(len, arrays.values())))
        for name, primitives in users.items():
            points = self._add(arrays[f"{name}.points"], _FLOAT, "VEC3")
            corners = self._add(arrays[f"{name}.corners"], _UNSIGNED, "SCALAR")
            for primitive in primitives:
                primitive["attributes"] = {"POSITION": points}
                primitive["indices"], primitive["mode"] = corners, 4
        return True

    def spread_integers(self) -> bool:
        """Replace normalised integers by numbers from -1 to 1; False if there are none."""
        replaced: dict[int, int] = {}
        for primitive in self._primitives:
            index = primitive["attributes"].get("POSITION")
            accessor = self._accessors[index] if index is not None else {}
            if accessor.get("normalized") is not True or accessor["componentType"] not in _INTEGERS:
                continue
            if index not in replaced:
                points = _as_floats(self._rows(accessor), normalized=True).tobytes()
                self._need(len(points))
                replaced[index] = self._add(points, _FLOAT, "VEC3")
            primitive["attributes"] = {**primitive["attributes"], "POSITION": replaced[index]}
        return bool(replaced)

    def spread_fans(self) -> bool:
        """Replace strips and fans by their triangles; False if there are none."""
        found = False
        for primitive in self._primitives:
            if primitive.get("mode") not in (STRIP, FAN):
                continue
            if "indices" in primitive:
                corners = self._scalars(self._accessors[primitive["indices"]])
            else:
                count = self._accessors[primitive["attributes"]["POSITION"]]["count"]
                self._need(12 * count)
                corners = np.arange(count)
            first = np.arange(max(len(corners) - 2, 0))
            if primitive["mode"] == STRIP:  # every other triangle of a strip is turned
                odd = first % 2
                rows = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
            else:
                rows = np.stack([np.zeros_like(first), first + 1, first + 2], axis=1)
            triangles = corners[rows].astype("<u4").tobytes()
            self._need(len(triangles))
            primitive["indices"], primitive["mode"] = self._add(triangles, _UNSIGNED, "SCALAR"), 4
            found = True
        return found

    def finished(self) -> Json:
        """The file's JSON."""
        data = b"".join(self._added)
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode("ascii")
        buffers = [*self._header.get("buffers", []), {"byteLength": len(data), "uri": uri}]
        required = [name for name in self._header.get("extensionsRequired", []) if name != DRACO]
        added = {"accessors": self._accessors, "bufferViews": self._views, "buffers": buffers}
        return {**self._header, **added, "extensionsRequired": required}

    def _add(self, data: bytes, component: int, kind: str) -> int:
        """Add an array; returns the index of its accessor."""
        start = sum(map(len, self._added))
        self._added.append(data)
        buffer = len(self._header.get("buffers", []))
        self._views.append({"buffer": buffer, "byteOffset": start, "byteLength": len(data)})
        count = len(data) // (ITEM_BYTES[component] * ITEMS[kind])
        self._accessors.append(
            {"bufferView": len(self._views) - 1, "componentType": component, "count": count, "type": kind}
        )
        return len(self._accessors) - 1

    def _need(self, count: int) -> None:
        """Refuse a file whose arrays add up to too much."""
        self._most -= count
        if self._most < 0:
            raise MeshFileError(f"{self._path} decodes to more than is reasonable for its length: export it again")

    def _rows(self, accessor: Json) -> np.ndarray[Any, Any]:
        """The integers of an accessor, ``[N, 3]``."""
        kind = np.dtype(_INTEGERS[accessor["componentType"]])
        view = self._views[accessor["bufferView"]]
        stride, count = view.get("byteStride", 3 * kind.itemsize), accessor["count"]
        if stride < 3 * kind.itemsize or count < 0 or accessor["type"] != "VEC3":
            raise ValueError("rows overlap")
        data = self._bytes_of(accessor["bufferView"])
        return np.ndarray((count, 3), kind, data, accessor.get("byteOffset", 0), (stride, kind.itemsize))

    def _scalars(self, accessor: Json) -> np.ndarray[Any, Any]:
        """The indices of an accessor, ``[N]``."""
        kind = {5121: "<u1", 5123: "<u2", _UNSIGNED: "<u4"}[accessor["componentType"]]
        data = self._bytes_of(accessor["bufferView"])
        return np.frombuffer(data, kind, accessor["count"], accessor.get("byteOffset", 0)).astype(np.int64)

    def _bytes_of(self, index: int) -> bytes:
        """The bytes of a view of the file."""
        if not 0 <= index < self._own_views:
            raise IndexError(f"view {index}")
        view = self._views[index]
        start, length = view.get("byteOffset", 0), view["byteLength"]
        buffer = self._buffer(view["buffer"])
        if start < 0 or length < 0 or start + length > len(buffer):
            raise ValueError(f"view {index} is longer than its buffer")
        return buffer[start : start + length]

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self._header["buffers"][index].get("uri")
            if uri is not None:
                given = base64.b64decode(uri.partition(",")[2]) if uri.startswith("data:") else self._beside(uri)
            elif index == 0 and self._rest and len(self._rest) >= 8:
                given = self._rest[8 : 8 + struct.unpack_from("<I", self._rest)[0]]
            else:
                raise ValueError("a buffer without bytes")
            self._buffers[index] = given
        return self._buffers[index]


def _as_floats(rows: np.ndarray[Any, Any], normalized: bool) -> np.ndarray[Any, Any]:
    """Numbers as glTF means them: normalised integers are shares of the largest."""
    if not normalized or not np.issubdtype(rows.dtype, np.integer):
        return rows.astype("<f4")
    return np.asarray(np.maximum(rows.astype("<f8") / np.iinfo(rows.dtype).max, -1.0).astype("<f4"))
