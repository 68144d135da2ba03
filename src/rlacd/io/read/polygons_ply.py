"""PLY files of polygons or strips, rewritten as triangles: the parser takes no strips, and no mixed polygons."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from rlacd.io.read.polygons import FloatArray, IntArray, folds, strip_triangles, triangles_of

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
STRIPS = "tristrips"
"""The element whose lists of corners are strips."""

_CORNERS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """An element of a header: its name, its number, and the name and type of each property; (count, item) of lists."""

    name: str
    count: int
    scalars: list[tuple[str, str]] = field(default_factory=list)
    lists: list[tuple[str, str, str, int]] = field(default_factory=list)  # name, count, item, scalars before it


def triangles_ply(header: bytes, body: bytes) -> bytes | None:
    """Return a file's points and the triangles of its polygons or strips as a binary PLY file.

    None if the parser itself reads it well: no fan folds over, and faces in binary form all have equally many corners;
    or if something is not as the commonest programs write it (points first, then faces with one list).
    """
    found = _elements(header)
    if found is None:
        return None
    order, (points, faces) = found
    read = _text if order is None else _binary
    try:
        parsed = read(body, points, faces, order or "<")
    except (ValueError, OverflowError, IndexError, struct.error):
        return None
    if parsed is None:
        return None
    positions, counts, corners = parsed
    if faces.name == STRIPS:
        corners = _of_strips(counts, corners)
        counts = np.full(len(corners) // 3, 3)
    if not len(corners) or (counts < 0).any() or corners.min() < 0 or corners.max() >= len(positions):
        return None
    mixed = order is not None and (counts != counts[0]).any()
    if not mixed and faces.name != STRIPS and not folds(positions, counts, corners):
        return None
    return encoded_ply(positions, triangles_of(positions, counts, corners))


def _of_strips(counts: IntArray, corners: IntArray) -> IntArray:
    """The corners of the triangles of strips; -1 ends a strip as well."""
    strips = [
        strip_triangles(part[part >= 0])
        for row in np.split(corners, np.cumsum(counts)[:-1])
        for part in np.split(row, np.flatnonzero(row == -1))
    ]
    return np.concatenate(strips).ravel()


def _elements(header: bytes) -> tuple[str | None, tuple[_Element, _Element]] | None:
    order: str | None = None
    elements: list[_Element] = []
    for line in header.decode("latin-1").splitlines():
        match line.split():
            case ["format", kind, *_]:
                order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(kind)
            case ["element", name, count] if count.isdigit():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, item, name] if elements and count in _KINDS and item in _KINDS:
                one = elements[-1]
                one.lists.append((name, _KINDS[count], _KINDS[item], len(one.scalars)))
            case ["property", kind, name] if elements and kind in _KINDS:
                elements[-1].scalars.append((name, _KINDS[kind]))
            case ["property", *_]:
                return None
    match elements:
        case [points, faces, *_] if points.name == "vertex" and faces.name in ("face", STRIPS):
            names = [name for name, _ in points.scalars]
            if points.lists or any(names.count(axis) != 1 for axis in "xyz"):
                return None
            if len(faces.lists) != 1 or faces.lists[0][0] not in _CORNERS or faces.lists[0][2][0] == "f":
                return None
            return order, (points, faces)
    return None


_Polygons = tuple[FloatArray, IntArray, IntArray]
"""Positions ``[V, 3]``, the number of corners of each polygon, and all corners."""


def _binary(body: bytes, points: _Element, faces: _Element, order: str) -> _Polygons | None:
    """Read what follows the header; None if all faces are triangles, or the file is cut off."""
    record = np.dtype([(name, order + kind) for name, kind in points.scalars])
    _, count, item, before = faces.lists[0]
    sizes = [np.dtype(kind).itemsize for _, kind in faces.scalars]
    leading, trailing = sum(sizes[:before]), sum(sizes[before:])
    number, width = struct.Struct(order + _LETTERS[count]), np.dtype(item).itemsize
    at = points.count * record.itemsize
    alike = _alike(body, faces, order, at, leading, trailing)
    if alike is not None and alike[0][0] == 3 and faces.name != STRIPS:
        return None
    read = np.frombuffer(body, record, points.count)
    positions = np.stack([read[axis].astype(np.float64) for axis in "xyz"], axis=1)
    if alike is not None:
        return positions, *alike
    counts, rings = [], bytearray()
    for _ in range(faces.count):
        at += leading
        corners = number.unpack_from(body, at)[0]
        at += number.size
        if corners < 0 or at + corners * width > len(body):
            return None
        counts.append(corners)
        rings += body[at : at + corners * width]
        at += corners * width + trailing
    return positions, np.array(counts, dtype=np.int64), np.frombuffer(bytes(rings), order + item).astype(np.int64)


def _alike(
    body: bytes, faces: _Element, order: str, at: int, leading: int, trailing: int
) -> tuple[IntArray, IntArray] | None:
    """Counts and corners of faces that all have as many corners as the first; None if they have not."""
    _, count, item, _ = faces.lists[0]
    corners = struct.unpack_from(order + _LETTERS[count], body, at + leading)[0] if faces.count else 0
    if corners < 3:
        return None
    fields = [("", f"V{leading}"), ("count", order + count), ("corners", order + item, corners), ("", f"V{trailing}")]
    record = np.dtype(fields)
    if len(body) < at + faces.count * record.itemsize:
        return None
    read = np.frombuffer(body, record, faces.count, at)
    if (read["count"] != corners).any():
        return None
    return np.full(faces.count, corners, dtype=np.int64), read["corners"].astype(np.int64).ravel()


_LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}


def _text(body: bytes, points: _Element, faces: _Element, order: str) -> _Polygons | None:
    lines = [line.split() for line in body.splitlines() if line.strip()]
    rows, faced = lines[: points.count], lines[points.count : points.count + faces.count]
    if len(faced) < faces.count:
        return None
    axes = [[name for name, _ in points.scalars].index(axis) for axis in "xyz"]
    positions = np.array([[row[axis] for axis in axes] for row in rows], dtype=np.float64)
    before = faces.lists[0][3]
    counts = [int(words[before]) for words in faced]
    rings = [words[before + 1 : before + 1 + count] for words, count in zip(faced, counts, strict=True)]
    if any(len(ring) != count for ring, count in zip(rings, counts, strict=True)):
        return None
    corners = np.array([int(word) for ring in rings for word in ring], dtype=np.int64)
    return positions, np.array(counts, dtype=np.int64), corners


def encoded_ply(points: FloatArray, faces: npt.NDArray[np.int64]) -> bytes:
    """Write points and triangles as a binary PLY file."""
    records = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    records["count"], records["corners"] = 3, faces
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    return "\n".join(lines).encode() + points.astype("<f8").tobytes() + records.tobytes()
