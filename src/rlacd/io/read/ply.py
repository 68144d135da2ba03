"""PLY, text and binary: points, and the triangles of polygons and of strips."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import trimesh

from rlacd.io.read.beside import PICTURES, FolderFiles
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.polygons import strip_triangles, triangles_of
from rlacd.io.read.text import check_text, count_in, plain_text, rows_of, whole
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.input_mesh import Asset

_KINDS = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_AXES = ("x", "y", "z")
_CORNERS = ("vertex_indices", "vertex_index")
_TEXT = re.compile(rb"(?:^|[\r\n])format\s+ascii\b", re.IGNORECASE)
_END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
_DESCRIBED = re.compile(rb"^property\s+\S+\s+(?:red|nx|s|u|texture_u)\s|TextureFile", re.MULTILINE)

STRIPS = "tristrips"
"""The element whose lists of corners are strips."""

MOST_FIELDS = 2000
"""Lines of a header whose looks are read: that parser revisits all earlier properties for every list among them."""


_LENGTH = "length of "

Kind: TypeAlias = "np.dtype[Any]"


@dataclass
class _Element:
    """An element of a header: its number; the name and type of each property, and for a list that of its length."""

    count: int
    properties: dict[str, tuple[Kind, Kind | None]] = field(default_factory=dict)

    def add(self, name: str, kind: Kind, length: Kind | None) -> None:
        """Add a property; the first of a name has it alone."""
        self.properties[f"{name} {len(self.properties)}" if name in self.properties else name] = kind, length


def _rows(body: bytes, at: int, element: _Element) -> tuple[Int64Array, dict[str, Any]]:
    """Where each row begins and the last one ends; by property its numbers, or the lengths and the items of its lists.

    If not all lists are as long as those of the first row, they are found one by one, and of numbers coordinates only.
    """
    _, first = _walked(body, at, element, min(element.count, 1))
    fields: list[Any] = []
    for name, (kind, length) in element.properties.items():
        fields += [] if length is None else [(_LENGTH + name, length)]
        fields += [(name, kind)] if length is None else [(name, kind, sum(map(len, first[name])))]
    record = np.dtype(fields)
    begins = at + record.itemsize * np.arange(element.count + 1)
    lists = {name for name, (_, length) in element.properties.items() if length is not None}
    if element.count and begins[-1] <= len(body):
        rows = np.frombuffer(body, record, element.count, at)
        counts = {name: rows[_LENGTH + name] for name in lists}
        if all((counts[name] == len(first[name][0])).all() for name in lists):
            return begins, {
                name: (counts[name].astype(np.int64), rows[name].ravel()) if name in lists else rows[name]
                for name in element.properties
            }
    begins, found = _walked(body, at, element, element.count)
    return begins, {
        name: (np.array([len(one) for one in items]), np.concatenate(items)) if name in lists else np.concatenate(items)
        for name, items in found.items()
        if items
    }


def _walked(body: bytes, at: int, element: _Element, rows: int) -> tuple[Int64Array, dict[str, list[npt.NDArray[Any]]]]:
    """Where each of some rows begins and the last one ends, and the lists and coordinates of each name."""
    begins = [at]
    found: dict[str, list[npt.NDArray[Any]]] = {
        name: [] for name, (_, length) in element.properties.items() if length is not None or name in _AXES
    }
    for _ in range(rows):
        for name, (kind, length) in element.properties.items():
            count = 1
            if length is not None:
                if (count := int(np.frombuffer(body, length, 1, at)[0])) < 0:
                    raise ValueError(f"a list of {count}")
                at += length.itemsize
            if name in found:
                found[name].append(np.frombuffer(body, kind, count, at))
            at += kind.itemsize * count
        if at > len(body):
            raise ValueError(f"its header declares {element.count} lines")
        begins.append(at)
    return np.array(begins), found


def read_ply(path: Path, content: bytes) -> Contents:
    """Read points and faces; what else there is of looks is told.

    Raises
    ------
    MeshFileError, MeshDataError, ValueError
        It is damaged, shorter than it declares, or takes too much memory.
    """
    content, is_text, end = _header(path, content)
    header, body = content[:end], content[end:]
    elements = _elements(header, is_text)
    for name, element in elements.items():
        if element.count > len(body):
            raise ValueError(f"its header declares {element.count} {name} lines")
    require_memory(elements["face"].count if "face" in elements else 0, BYTES_READ, path.name)
    lines = None
    if is_text:  # read as binary with eight bytes for each number
        numbers, counts = rows_of(body.rstrip() + b"\n")
        body, lines = numbers.astype("<f8").tobytes(), 8 * np.append(0, np.cumsum(counts[counts > 0]))
    values: dict[str, dict[str, Any]] = {}
    at = 0
    for name, element in elements.items():
        begins, values[name] = _rows(body, at, element)
        if lines is not None and not np.array_equal(lines[np.searchsorted(lines, at) :][: element.count + 1], begins):
            raise ValueError(f"a {name} line of another length than its header declares")
        at = int(begins[-1])
    points, faces = np.empty((0, 3)), [np.empty((0, 3), dtype=np.int64)]
    if (vertices := values.get("vertex")) and elements["vertex"].count:
        points = np.stack([vertices[axis].astype(np.float64) for axis in _AXES], axis=1)
    for name in ("face", STRIPS):
        if name in values and elements[name].count:
            faces.append(_triangles(values[name], name == STRIPS, points))
    described = _DESCRIBED.search(header) is not None and STRIPS not in elements
    asset = Asset(content, path, "ply") if described and header.count(b"\n") < MOST_FIELDS else None
    return Contents(one_shape(path.stem, points, np.concatenate(faces)), asset=asset)


def _header(path: Path, content: bytes) -> tuple[bytes, bool, int]:
    """A file, its text plain; whether it is text; and where its header ends."""
    is_text = _TEXT.search(content[:1000]) is not None
    if is_text:
        check_text(path, content)
        content = plain_text(content)
    end = _END.search(content)
    if end is None or not content.startswith(b"ply"):
        raise ValueError("its header has no end, or does not begin with ply")
    return content, is_text, end.end()


def scene_of_ply(path: Path, content: bytes) -> trimesh.Scene:
    """The same with all looks, as trimesh reads them."""
    beside = FolderFiles(path.parent, PICTURES)
    scene = trimesh.load_scene(io.BytesIO(content), "ply", resolver=beside, allow_remote=False, process=False)
    for shape in scene.geometry.values():
        if (picture := getattr(getattr(shape.visual, "material", None), "image", None)) is not None:
            picture.load()  # now, when looks that cannot be decoded may still be left out
    return scene


def _elements(header: bytes, is_text: bool) -> dict[str, _Element]:
    order = "<"
    found: dict[str, _Element] = {}

    def kind(word: str) -> Kind:
        return np.dtype("<f8" if is_text else order + _KINDS[word])

    for line in header.decode("latin-1").splitlines():
        match line.split():
            case ["format", word, *_]:
                order = _ORDERS[word.lower()]
            case ["element", name, count]:
                if name in found:
                    raise ValueError(f"its header declares {name!r:.40} twice")
                found[name] = last = _Element(count_in(count.encode()))
            case ["property", "list", length, items, name]:
                last.add(name, kind(items), kind(length))
            case ["property", items, name]:
                last.add(name, kind(items), None)
            case ["element" | "property", *_]:
                raise ValueError(f"{line!r:.40} in its header")
    return found


def _triangles(values: dict[str, Any], are_strips: bool, points: FloatArray) -> Int64Array:
    lists = [values[name] for name in _CORNERS if isinstance(values.get(name), tuple)]
    if not lists:
        raise ValueError("its faces have no list vertex_indices")
    counts, corners = lists[0][0], whole(lists[0][1])
    if are_strips:  # -1 ends a strip as well
        strips = [
            strip_triangles(part[part >= 0])
            for row in np.split(corners, np.cumsum(counts)[:-1])
            for part in np.split(row, np.flatnonzero(row == -1))
        ]
        corners = np.concatenate(strips).ravel()
        counts = np.full(len(corners) // 3, 3)
    return triangles_of(points, counts, corners)
