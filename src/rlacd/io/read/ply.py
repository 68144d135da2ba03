"""PLY, text and binary: points, and the triangles of polygons and of strips."""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.io.read.beside import PICTURES, FolderFiles
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.looks import decoded
from rlacd.io.read.polygons import strip_triangles, triangles_of
from rlacd.io.read.text import check_text, count_in, plain_text, rows_of, whole
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import FloatArray
from rlacd.solid.input_mesh import Asset
from rlacd.solid.topology import IntArray

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
_CORNERS = ("vertex_indices", "vertex_index")
_TEXT = re.compile(rb"(?:^|[\r\n])format\s+ascii\b", re.IGNORECASE)
_END = re.compile(rb"^end_header[ \t]*\r?\n", re.MULTILINE)
_DESCRIBED = re.compile(rb"^property\s+\S+\s+(?:red|nx|s|u|texture_u)\s|TextureFile", re.MULTILINE)

STRIPS = "tristrips"
"""The element whose lists of corners are strips."""

MOST_FIELDS = 2000
"""Lines of a header whose looks are read: that parser revisits all earlier properties for every list among them."""


@dataclass
class _Element:
    """An element of a header: its number, and the name and type of each property; of a list, also that of its length.

    Types are those of numpy, with the order of bytes.
    """

    count: int
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)


class _Lists:
    """Where the lists of some rows are: the place of the first item of each, and their lengths."""

    def __init__(self, body: bytes, at: int, element: _Element) -> None:
        self._body, self._element, self._stride = body, element, 0
        self._begins: list[int] = []
        names = [name for name, _, length in element.properties if length is not None]
        self.places: dict[str, list[int]] = {name: [] for name in names}
        self.counts: dict[str, list[int]] = {name: [] for name in names}
        self.end = self._walk(at, min(element.count, 1))
        if element.count and not self._are_alike(at, self.end - at):
            self.end = self._walk(self.end, element.count - 1)

    def _walk(self, at: int, rows: int) -> int:
        """Go through rows one by one, and return where they end."""
        steps = [
            (
                name,
                np.dtype(kind).itemsize,
                None if length is None else struct.Struct(length[0] + np.dtype(length).char),
            )
            for name, kind, length in self._element.properties
        ]
        for _ in range(rows):
            self._begins.append(at)
            for name, size, length in steps:
                if length is None:
                    at += size
                    continue
                count = int(length.unpack_from(self._body, at)[0])
                at += length.size
                if count < 0 or at + count * size > len(self._body):
                    raise ValueError(f"a list of {count}")
                self.places[name].append(at)
                self.counts[name].append(count)
                at += count * size
        return at

    def _are_alike(self, at: int, stride: int) -> bool:
        """Whether the lists of all rows are as long as those of the first; then all are found at once."""
        rows = self._element.count
        if at + rows * stride > len(self._body):
            return False
        for name, _, length in self._element.properties:
            if length is not None:
                first = self.places[name][0] - np.dtype(length).itemsize
                counts = np.ndarray(rows, length, self._body, first, stride)
                if (counts != self.counts[name][0]).any():
                    return False
        self._stride, self.end = stride, at + rows * stride
        return True

    def begins(self) -> IntArray:
        """Where each row begins."""
        if self._stride:
            return self._begins[0] + self._stride * np.arange(self._element.count)
        return np.array(self._begins, dtype=np.int64)

    def items(self, name: str) -> tuple[IntArray, IntArray]:
        """The lengths of all lists of a name, and all their items."""
        (kind,) = (kind for other, kind, length in self._element.properties if other == name and length is not None)
        width, rows = np.dtype(kind).itemsize, self._element.count
        if self._stride:
            (place, *_), (count, *_) = self.places[name], self.counts[name]
            items = np.ndarray((rows, count), kind, self._body, place, (self._stride, width))
            return np.full(rows, count), whole(items).ravel()
        counts = np.array(self.counts[name], dtype=np.int64)
        owner = np.repeat(np.arange(len(counts)), counts)
        places = np.array(self.places[name], dtype=np.int64)[owner]
        places += width * (np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner])
        letters = np.frombuffer(self._body, np.uint8)[places[:, None] + np.arange(width)]
        return counts, whole(letters.view(kind)[:, 0])


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
    points, faces = np.empty((0, 3)), [np.empty((0, 3), dtype=np.int64)]
    at = 0
    for name, element in elements.items():
        begin = at
        if any(length is not None for *_, length in element.properties):
            lists = _Lists(body, at, element)
            at, begins = lists.end, lists.begins()
            if name in ("face", STRIPS) and element.count:
                faces.append(_triangles(lists, name == STRIPS, points))
        else:
            record = np.dtype([(field, kind) for field, kind, _ in element.properties])
            begins = at + record.itemsize * np.arange(element.count)
            at += element.count * record.itemsize
            if at > len(body):
                raise ValueError(f"its header declares {element.count} {name} lines")
            if name == "vertex":
                rows = np.frombuffer(body, record, element.count, begin)
                points = np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=1)
        if lines is not None:
            own = lines[np.searchsorted(lines, begin) :][: element.count + 1]
            if not np.array_equal(own, np.append(begins, at)):
                raise ValueError(f"a {name} line of another length than declared")
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
        material: Any = getattr(shape.visual, "material", None)
        if getattr(material, "image", None) is not None:
            material.image = decoded(material.image)
    return scene


def _elements(header: bytes, is_text: bool) -> dict[str, _Element]:
    order = "<"
    found: dict[str, _Element] = {}
    for line in header.decode("latin-1").splitlines():
        match line.split():
            case ["format", kind, *_]:
                order = _ORDERS[kind.lower()]
            case ["element", name, count]:
                if name in found:
                    raise ValueError(f"its header declares {name!r:.40} twice")
                found[name] = last = _Element(count_in(count.encode()))
            case ["property", "list", length, kind, name]:
                kinds = ("f8", "f8") if is_text else (_KINDS[kind], _KINDS[length])
                last.properties.append((name, order + kinds[0], order + kinds[1]))
            case ["property", kind, name]:
                last.properties.append((name, order + ("f8" if is_text else _KINDS[kind]), None))
            case ["element" | "property", *_]:
                raise ValueError(f"{line!r:.40} in its header")
    return found


def _triangles(lists: _Lists, are_strips: bool, points: FloatArray) -> IntArray:
    counts, corners = lists.items(next(name for name in _CORNERS if name in lists.places))
    if are_strips:  # -1 ends a strip as well
        strips = [
            strip_triangles(part[part >= 0])
            for row in np.split(corners, np.cumsum(counts)[:-1])
            for part in np.split(row, np.flatnonzero(row == -1))
        ]
        corners = np.concatenate(strips).ravel()
        counts = np.full(len(corners) // 3, 3)
    return triangles_of(points, counts, corners)
