"""Wavefront OBJ: the triangles of its objects, each a node, and what it says of their looks.

All lines of a kind are read at once: files of a million lines are common.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from trimesh.exchange.obj import parse_mtl

from rlacd.io.read.beside import MAP, PICTURES, FolderFiles
from rlacd.io.read.contents import MOST_PLACES, Contents, Triangles, one_shape
from rlacd.io.read.looks import BETWEEN, opened_picture, painted
from rlacd.io.read.polygons import places_of
from rlacd.io.read.text import check_text, numbers_in, plain_text, rows_of
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array
from rlacd.solid.input_mesh import Asset, SourceNode

_UNREAD = {
    **dict.fromkeys((b"curv", b"curv2", b"surf", b"bzp", b"bsp", b"cdc", b"cdp"), "free-form curves and surfaces"),
    **dict.fromkeys((b"p", b"l"), "points and lines"),
    b"call": "calls to other files",
}

_COMMON = np.array([b"v ", b"vt", b"vn", b"f ", b"s ", b""])
"""How lines begin that are read at once, mean nothing here, or are empty."""

MOST_PARTS = 2_000
"""Materials of all objects; with more, looks are left out: writing takes a millisecond for each."""


class _File:
    """The lines of a file. Raises ValueError where they are damaged."""

    def __init__(self, path: Path, content: bytes) -> None:
        check_text(path, content)
        require_memory(content.count(b"\nf "), BYTES_READ, path.name)
        text = plain_text(content).replace(b"\\\n", b" ").replace(b"\t", b" ")
        self._text = [line.split(b"#", 1)[0].strip() for line in text.split(b"\n")]
        self._words = np.array([line[:2] for line in self._text], "S2")
        points = self.vectors(b"v")
        if len(points) and points.shape[1] < 3:
            raise ValueError(f"a vertex of {points.shape[1]} coordinates")
        self.points = np.ascontiguousarray(points[:, :3]).reshape(-1, 3)
        self.colors = points[:, 3:6] if points.shape[1] >= 6 else None
        self._named: dict[bytes, list[tuple[int, str]]] = {b"o": [], b"g": [], b"usemtl": [], b"mtllib": []}
        self.unread: list[str] = []
        for line in np.flatnonzero(~np.isin(self._words, _COMMON)).tolist():
            word, _, rest = self._text[line].partition(b" ")
            if word in self._named:
                self._named[word].append((line, rest.strip().decode(errors="replace")))
            elif word in _UNREAD and _UNREAD[word] not in self.unread:
                self.unread.append(_UNREAD[word])
        self.libraries = [name for _, name in self._named[b"mtllib"]]
        self._read_faces()

    def _are(self, word: bytes) -> BoolArray:
        """Which lines begin with a word of one letter or two."""
        return np.asarray(self._words == word.ljust(2))

    def _of(self, word: bytes) -> bytes:
        """What stands behind a word on its lines."""
        return b"".join(line[len(word) :] + b"\n" for line in compress(self._text, self._are(word)))

    def vectors(self, word: bytes) -> FloatArray:
        """The numbers on all lines of a word, as many as the shortest has."""
        numbers, counts = rows_of(self._of(word))
        first = (np.cumsum(counts) - counts)[:, None]
        return np.ascontiguousarray(numbers[first + np.arange(counts.min(initial=len(numbers)))])

    def _read_faces(self) -> None:
        self._lines = np.flatnonzero(self._are(b"f"))
        self._counts, words = _fields(self._of(b"f"))
        index = [self._index(numbers, word) for numbers, word in zip(words, (b"v", b"vt", b"vn"), strict=True)]
        points = index[0]
        if (points < 0).any():
            raise ValueError("a face uses vertex 0, but OBJ counts from 1, or one before the first")
        if len(points) and points.max() >= len(self.points):
            raise ValueError(f"a face uses vertex {points.max() + 1}, but there are {len(self.points)}")
        places = places_of(self.points, self._counts, points)
        self.faces = [one[places] for one in index]

    def _index(self, numbers: Int64Array, word: bytes) -> Int64Array:
        """Indices from 0; those of the file count from 1, or from the end of what stands before their line."""
        if not (numbers < 0).any():
            return numbers - 1
        before = np.repeat(np.cumsum(self._are(word))[self._lines], self._counts)
        return np.where(numbers < 0, before + numbers, numbers - 1)

    def named(self, word: bytes) -> tuple[list[str], Int64Array]:
        """The names behind a word, the first empty, and the number of that which each triangle stands behind."""
        names: dict[str, int] = {"": 0}
        number = np.array([0, *(names.setdefault(name, len(names)) for _, name in self._named[word])])
        of_line = number[np.searchsorted([line for line, _ in self._named[word]], self._lines)]
        return list(names), np.repeat(of_line, np.maximum(self._counts - 2, 0))

    def objects(self) -> tuple[list[str], Int64Array]:
        """The objects, or groups if there are no objects, and the number of that of each triangle."""
        names, owner = self.named(b"o" if self._named[b"o"] else b"g")
        one = len(np.unique(owner)) < 2 or len(names) > MOST_PLACES
        return (names, np.zeros_like(owner)) if one else (names, owner)


def _fields(text: bytes) -> tuple[Int64Array, list[Int64Array]]:
    """The number of words on each line, and the three numbers of each word, ``point/texture/normal``; 0 for none."""
    letters = np.frombuffer(text, np.uint8)
    blank = letters <= ord(" ")
    words = np.flatnonzero(~blank[1:] & blank[:-1])
    counts = np.diff(np.searchsorted(words, np.flatnonzero(letters == ord("\n"))), prepend=0)
    slash = letters == ord("/")
    slashes = np.cumsum(slash, dtype=np.int32)
    slashes -= np.maximum.accumulate(np.where(blank, slashes, 0))
    found = []
    for field in range(3 if slash.any() else 1):
        kept = ~blank & ~slash & (slashes == field)
        begins = np.flatnonzero(kept[1:] & ~kept[:-1])
        numbers = numbers_in(np.where(kept, letters, np.uint8(ord(" "))).tobytes(), np.int64)
        if len(numbers) != len(begins) or (field == 0 and len(numbers) != len(words)):
            raise ValueError("a corner of a face is no number")
        found.append(np.zeros(len(words), dtype=np.int64))
        found[field][np.searchsorted(words, begins, side="right") - 1] = numbers
    return counts, found + [np.zeros(len(words), dtype=np.int64)] * (3 - len(found))


def read_obj(path: Path, content: bytes) -> Contents:
    """Read each object as a node; its groups, if it has no objects.

    Raises
    ------
    MeshFileError, ValueError
        The file is damaged.
    """
    file = _File(path, content)
    warnings = [f"{what} in {path.name} were left out" for what in file.unread]
    if not len(file.faces[0]):
        return Contents(one_shape(path.stem, file.points), warnings)
    names, owner = file.objects()
    geometry = []
    for one, faces in _split(file.faces[0], owner):
        some, local = np.unique(faces, return_inverse=True)
        node = SourceNode(names[one] or path.stem, names[one] or path.stem, np.eye(4))
        geometry.append((node, Triangles(file.points[some], local.reshape(-1, 3))))
    described = file.colors is not None or any(word in content for word in (b"usemtl", b"\nvt", b"\nvn"))
    return Contents(geometry, warnings, asset=Asset(content, path, "obj") if described else None)


def scene_of_obj(path: Path, content: bytes) -> trimesh.Scene:
    """The same with all looks: a node for each material of an object, which begins with the object's name."""
    file = _File(path, content)
    names, owner = file.objects()
    called, paint = file.named(b"usemtl")
    paints = _paints(FolderFiles(path.parent, PICTURES), file.libraries)
    textures, directions = file.vectors(b"vt"), file.vectors(b"vn")
    scene, parts = trimesh.Scene(), list(_split(np.arange(len(owner)), owner * len(called) + paint))
    if len(parts) > MOST_PARTS:
        raise ValueError(f"{len(parts)} materials of objects")
    for pair, rows in parts:
        points, texture, normals = (index[rows] for index in file.faces)
        looks = {"POSITION": (file.points, points), "TEXCOORD": (textures, texture)}
        looks["NORMAL"] = directions, normals
        if file.colors is not None:
            looks["COLOR"] = file.colors, points
        mesh = painted(looks, paints.get(called[pair % len(called)]))
        name = f"{names[pair // len(called)] or path.stem}{BETWEEN}{called[pair % len(called)]}"
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    return scene


def _paints(beside: FolderFiles, libraries: Sequence[str]) -> dict[str, Any]:
    """The materials of all libraries that are there, by name: colour, opacity, and a picture."""
    found = {}
    for library in libraries:
        try:
            named = parse_mtl(MAP.sub(rb"picture \1", beside.get(library)))
        except FileNotFoundError:
            missing = f"the materials {library!r:.100} were left out: they are not in the folder"
            warnings.warn(missing, UserWarning, stacklevel=2)
            continue
        for name, said in named.items():
            picture = opened_picture(beside, " ".join(said["picture"])) if "picture" in said else None
            opacity = float(said["d"][-1]) if "d" in said else 1.0 - float(said.get("tr", [0.0])[-1])
            found[name] = trimesh.visual.material.PBRMaterial(
                name=name,
                baseColorFactor=[*np.broadcast_to(said.get("diffuse", 0.4 if picture is None else 1.0), 3), opacity],
                baseColorTexture=picture,
                roughnessFactor=float((2.0 / (2.0 + max(said.get("glossiness", 1.0), 0.0))) ** 0.25),
                metallicFactor=0.0,
                alphaMode="BLEND" if opacity < 1.0 else None,
            )
    return found


def _split(rows: Int64Array, owner: Int64Array) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
    """The rows of each owner, ascending, in their order."""
    order = np.argsort(owner, kind="stable")
    found = np.flatnonzero(np.diff(owner[order], prepend=-1))
    yield from zip(owner[order][found].tolist(), np.split(rows[order], found[1:]), strict=True)
