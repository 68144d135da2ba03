"""Meshes of Gmsh (MSH 2.2 and 4.1, text and binary): surfaces, and what bounds the cells of volumes.

Faces of cells that two cells share are no surface, nor are the surface elements on them. Nodes of higher order lie
between the corners, and are passed over with a warning. Lines, points, groups and data are passed over.
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.polygons import triangles_of
from rlacd.io.read.text import check_text, count_in, numbers_in, plain_text, rows_of, whole
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import FloatArray, Int64Array

_TYPES = {
    **{1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetrahedron", 4), 5: ("hexahedron", 8)},
    **{6: ("prism", 6), 7: ("pyramid", 5), 8: ("line", 3), 9: ("triangle", 6), 10: ("quad", 9)},
    **{11: ("tetrahedron", 10), 12: ("hexahedron", 27), 13: ("prism", 18), 14: ("pyramid", 14), 15: ("point", 1)},
    **{16: ("quad", 8), 17: ("hexahedron", 20), 18: ("prism", 15), 19: ("pyramid", 13)},
}
"""The kinds of elements up to the second order by their numbers: what they are, and how many nodes they have."""

CURVED = 8
"""The first kind of the second order."""

_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
    "tetrahedron": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    "prism": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
}
"""Their faces by the places of their corners, seen from outside."""

MOST_BLOCKS = 1_000_000
"""Of nodes or elements that are written together."""

Elements = dict[int, list[Int64Array]]
"""By kind, the numbers of their nodes [N, nodes]."""


def read_gmsh(path: Path, content: bytes) -> Contents:
    """Read the surface.

    Raises
    ------
    MeshFileError, ValueError
        It is of another version, has elements above the second order or none but lines, or is damaged or cut off.
    """
    head = re.match(rb"\$MeshFormat\s+(\d+(?:\.\d+)?)\s+([01])\s+(\d+)[^\n]*\n", content)
    if head is None:
        raise MeshFileError(f"{path} is a file of Gmsh without a $MeshFormat that is read: save it as MSH 4.1")
    version, binary, size = head[1].decode(), head[2] == b"1", int(head[3])
    if version not in ("2.2", "4.1") or size != 8:
        raise MeshFileError(f"{path} is MSH {version} with numbers of {size} bytes: save it as MSH 4.1 or 2.2")
    if binary:
        order = "<" if content[head.end() : head.end() + 4] == b"\1\0\0\0" else ">"
    else:
        check_text(path, content)
        content, order = plain_text(content), ""
    nodes, elements = (_Section(content, name, order) for name in ("Nodes", "Elements"))
    if version == "4.1":
        tags, points, found = *_nodes_of_4(nodes), _elements_of_4(elements)
    else:
        tags, points, found = *_nodes_of_2(nodes), _elements_of_2(elements)
    nodes.end()
    elements.end()
    require_memory(sum(len(part) for parts in found.values() for part in parts), BYTES_READ, path.name)
    return _surface(path, tags, points, found)


class _Section:
    """The numbers of a section, taken one after the other; `order` is that of bytes, empty for text."""

    def __init__(self, content: bytes, name: str, order: str) -> None:
        begin = re.search(rb"^\$%b[ \t]*\r?\n" % name.encode(), content, re.MULTILINE)
        self._mark = b"$End" + name.encode()
        end = content.find(self._mark) if order == "" else content.rfind(self._mark)
        if begin is None or end < begin.end():
            raise ValueError(f"it has no ${name} with its end")
        if order == "" and content.count(self._mark) > 1:
            raise ValueError(f"it has more than one ${name}")
        self.text, self.order = content[begin.end() : end], order
        self._numbers: FloatArray | None = None
        self._at = 0

    def line(self) -> int:
        """A count on a line of its own, as version 2 has it even in binary files."""
        word, _, rest = self.text[self._at :].partition(b"\n")
        self._at = len(self.text) - len(rest)
        return count_in(word.strip())

    def rest(self) -> bytes:
        """The text that is left."""
        self._at, at = len(self.text), self._at
        return self.text[at:]

    def take(self, kind: str, count: int) -> npt.NDArray[Any]:
        """The next numbers: of a kind that numpy knows, in binary files."""
        if self.order:
            kind = self.order + kind
            if count < 0 or self._at + count * np.dtype(kind).itemsize > len(self.text):
                raise ValueError(f"{self._mark.decode()} comes before all numbers")
            found = np.frombuffer(self.text, kind, count, self._at)
            self._at += found.nbytes
            return found
        if self._numbers is None:
            self._numbers = numbers_in(self.text)
        if count < 0 or self._at + count > len(self._numbers):
            raise ValueError(f"{self._mark.decode()} comes before all numbers")
        self._at += count
        found = self._numbers[self._at - count : self._at]
        return found if kind == "f8" else whole(found)

    def end(self) -> None:
        """Raise ValueError if there is more than was taken."""
        left = self.text[self._at :].strip() if self._numbers is None else self._numbers[self._at :]
        if len(left):
            raise ValueError(f"there is more before {self._mark.decode()} than it declares")


def _blocks(count: int) -> range:
    if not 0 <= count <= MOST_BLOCKS:
        raise ValueError(f"it declares {count} blocks")
    return range(count)


def _nodes_of_4(section: _Section) -> tuple[Int64Array, FloatArray]:
    """Numbers [N] and places [N, 3]."""
    blocks, total, _, _ = section.take("u8", 4).tolist()
    tags, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for _ in _blocks(blocks):
        dimension, _, parametric = section.take("i4", 3).tolist()
        (count,) = section.take("u8", 1).tolist()
        if not 0 <= dimension <= 3:
            raise ValueError(f"nodes of dimension {dimension}")
        tags.append(section.take("u8", count).astype(np.int64))
        wide = 3 + (dimension if parametric else 0)
        points.append(section.take("f8", wide * count).reshape(-1, wide)[:, :3])
    if sum(map(len, tags)) != total:
        raise ValueError(f"it declares {total} nodes")
    return np.concatenate(tags), np.concatenate(points).astype(np.float64)


def _elements_of_4(section: _Section) -> Elements:
    blocks, total, _, _ = section.take("u8", 4).tolist()
    found: Elements = defaultdict(list)
    for _ in _blocks(blocks):
        kind = int(section.take("i4", 3)[2])
        (count,) = section.take("u8", 1).tolist()
        wide = 1 + _nodes_in(kind)
        found[kind].append(section.take("u8", wide * count).reshape(-1, wide)[:, 1:].astype(np.int64))
    _require(found, total)
    return found


def _nodes_of_2(section: _Section) -> tuple[Int64Array, FloatArray]:
    count = section.line()
    if section.order:
        each = np.dtype([("tag", f"{section.order}i4"), ("at", f"{section.order}f8", 3)])
        rows = np.frombuffer(section.take("u1", count * each.itemsize).tobytes(), each)
        return rows["tag"].astype(np.int64), rows["at"].astype(np.float64)
    numbers = numbers_in(section.rest())
    if len(numbers) != 4 * count:
        raise ValueError(f"it declares {count} nodes")
    return whole(numbers[::4]), numbers.reshape(-1, 4)[:, 1:]


def _elements_of_2(section: _Section) -> Elements:
    total = section.line()
    found: Elements = defaultdict(list)
    if section.order:
        left = total
        while left > 0:
            kind, count, tags = section.take("i4", 3).tolist()
            wide = 1 + tags + _nodes_in(kind)
            if count < 1 or tags < 0:
                raise ValueError(f"it declares {total} elements")
            found[kind].append(section.take("i4", wide * count).reshape(-1, wide)[:, 1 + tags :].astype(np.int64))
            left -= count
    else:
        numbers, words = rows_of(section.rest().rstrip() + b"\n")
        first, words = (np.cumsum(words) - words)[words > 0], words[words > 0]
        if words.min(initial=3) < 3:
            raise ValueError("an element has no kind")
        kinds, tags = whole(numbers[first + 1]), whole(numbers[first + 2])
        for kind in np.unique(kinds).tolist():
            here = kinds == kind
            count = _nodes_in(kind)
            if (words[here] != 3 + tags[here] + count).any() or tags[here].min() < 0:
                raise ValueError(f"an element of kind {kind} has too few or too many numbers")
            found[kind].append(whole(numbers[(first + 3 + tags)[here][:, None] + np.arange(count)]))
    _require(found, total)
    return found


def _nodes_in(kind: int) -> int:
    if kind not in _TYPES:
        raise ValueError(f"elements of kind {kind} are not read: save it with elements of the first or second order")
    return _TYPES[kind][1]


def _require(found: Elements, total: int) -> None:
    if sum(len(part) for parts in found.values() for part in parts) != total:
        raise ValueError(f"it declares {total} elements")


def _turned(nodes: FloatArray, faces: tuple[tuple[int, ...], ...]) -> npt.NDArray[np.bool_]:
    """Which cells, nodes [N, nodes, 3], are inside out: programs disagree on the order of nodes."""
    volume, corners = np.zeros(len(nodes)), sorted({place for face in faces for place in face})
    with np.errstate(all="ignore"):
        for face in faces if len(faces) > 1 else ():
            ring = nodes[:, face] - nodes[:, corners].mean(axis=1, keepdims=True)
            volume += sum(
                np.einsum("ij,ij->i", ring[:, 0], np.cross(ring[:, i], ring[:, i + 1])) for i in range(1, len(face) - 1)
            )
    return volume < 0


def _surface(path: Path, tags: Int64Array, points: FloatArray, found: Elements) -> Contents:
    """The faces that bound, and the surface elements that are on no cell."""
    order = np.argsort(tags, kind="stable")
    if (np.diff(tags[order]) == 0).any():
        raise ValueError("two nodes have the same number")
    polygons: dict[bool, list[Int64Array]] = {True: [], False: []}  # of cells, of surfaces: corners [N, 4], -1 of none
    higher = 0
    for kind, parts in found.items():
        shape, _ = _TYPES[kind]
        elements = np.concatenate(parts)
        place = np.searchsorted(tags, elements, sorter=order)
        if len(elements) and (place.max() == len(tags) or (tags[order[place]] != elements).any()):
            raise ValueError("an element has a node that is not there")
        if shape not in _FACES:
            continue
        higher += len(elements) if kind >= CURVED else 0
        turned = _turned(points[order[place]], _FACES[shape])
        for face in _FACES[shape]:
            corners = order[place[:, face]]
            corners[turned] = corners[turned, ::-1]
            polygons[len(_FACES[shape]) > 1].append(np.pad(corners, ((0, 0), (0, 4 - len(face))), constant_values=-1))
    cells, sheets = (np.concatenate([np.empty((0, 4), np.int64), *polygons[of]]) for of in (True, False))
    every = np.sort(np.concatenate([cells, sheets]), axis=1)
    _, inverse = np.unique(every, axis=0, return_inverse=True)
    of_cells = np.bincount(inverse.ravel()[: len(cells)], minlength=len(every))[inverse.ravel()]
    kept = np.concatenate([of_cells[: len(cells)] == 1, of_cells[len(cells) :] == 0])
    faces = np.concatenate([cells, sheets])[kept]
    if not len(faces):
        raise MeshFileError(f"{path} has no triangles, quads or cells: save the surface or the volume, too")
    used, corners = np.unique(faces[faces >= 0], return_inverse=True)
    counts = (faces >= 0).sum(axis=1)
    warnings = [f"{higher} elements of {path.name} are curved: they were read by their corners"] if higher else []
    return Contents(one_shape(path.stem, points[used], triangles_of(points[used], counts, corners.ravel())), warnings)
