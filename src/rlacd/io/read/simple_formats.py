"""Formats that are lists of numbers: STL, the meshes of MuJoCo (msh), points (xyz), and OFF in all its variants.

OFF is Geomview's: a keyword, the numbers of vertices, faces and edges, a line per vertex, a line per face. Letters
before ``OFF`` say what else the line of a vertex holds: texture coordinates (``ST``), a colour (``C``), a normal
(``N``); those of other dimensions (``4``, ``n``) are refused. The keyword may be left out or have the numbers on its
own line, and ``#`` begins a comment.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.gmsh import read_gmsh
from rlacd.io.read.open_file import OFF_KEYWORD
from rlacd.io.read.polygons import triangles_of
from rlacd.io.read.text import check_text, count_in, numbers_in, plain_text, rows_of, vectors_of, whole
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import FloatArray, Int64Array

_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, content: bytes) -> Contents:
    """Read all solids of an STL file as one.

    Raises
    ------
    MeshFileError, MeshDataError, ValueError
        It is damaged, shorter than it declares, or takes too much memory.
    """
    count, warnings = int.from_bytes(content[80:84], "little"), []
    more = len(content) - 84 - _STL.itemsize * count
    if b"\0" in content[:512] or more == 0:  # some binary files begin like text
        if more < 0:
            raise ValueError(f"its header declares {count} triangles")
        require_memory(count, BYTES_READ, path.name)
        points = np.frombuffer(content, _STL, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
        warnings = [f"{more} bytes after the last triangle of {path.name} were left out"] if more else []
        faces = np.arange(len(points)).reshape(-1, 3)
    else:
        check_text(path, content)
        points, faces = _text_stl(path, plain_text(content))
    return Contents(one_shape(path.stem, points, faces), warnings)


def _text_stl(path: Path, text: bytes) -> tuple[FloatArray, Int64Array]:
    """The points and triangles of a text, in which some programs write other polygons as well."""
    lower = text.lower()
    require_memory(lower.count(b"vertex") // 3, BYTES_READ, path.name)
    points = numbers_in(b" ".join(b" ".join(corner) for corner in _VERTEX.findall(text))).reshape(-1, 3)
    *loops, rest = lower.split(b"endloop")
    counts = np.array([loop.rpartition(b"loop")[2].count(b"vertex") for loop in loops], dtype=np.int64)
    if not loops:  # the keyword is missing: triangles
        counts = np.full(len(points) // 3, 3)
    if counts.sum() != len(points) or counts.min(initial=3) < 3 or b"endsolid" not in rest:
        raise ValueError("a facet has fewer than three vertices, or the last endsolid is missing")
    return points, triangles_of(points, counts, np.arange(len(points)))


def read_xyz(path: Path, content: bytes) -> Contents:
    """Read points: the first three numbers of each line, which all have equally many."""
    check_text(path, content)
    numbers, counts = rows_of(plain_text(content).rstrip() + b"\n")
    width = counts.max()
    if width < 3 or not np.isin(counts, (0, width)).all():
        raise ValueError(f"lines of {counts.min()} and of {width} numbers")
    return Contents(one_shape(path.stem, np.ascontiguousarray(numbers.reshape(-1, width)[:, :3])))


def read_msh(path: Path, content: bytes) -> Contents:
    """Read MuJoCo's binary mesh: four counts, then points, normals and texture coordinates as float32, and faces.

    Meshes of Gmsh have the same ending: see `rlacd.io.read.gmsh.read_gmsh`.

    Raises
    ------
    MeshFileError
        The counts are not those of a mesh, or do not fit the length of the file.
    """
    if content.startswith(b"$"):
        return read_gmsh(path, content)
    counts = [int(count) for count in np.frombuffer(content[: len(content[:16]) // 4 * 4], "<i4")]
    if len(counts) < 4 or min(counts) < 0:
        raise ValueError("its header lacks the counts")
    points, normals, texture, faces = counts
    if len(content) != 16 + 4 * (3 * points + 3 * normals + 2 * texture + 3 * faces):
        raise ValueError("it is not as long as its header declares")
    vertices = np.frombuffer(content, "<f4", 3 * points, 16).reshape(-1, 3).astype(np.float64)
    corners = np.frombuffer(content, "<i4", 3 * faces, len(content) - 12 * faces).reshape(-1, 3)
    return Contents(one_shape(path.stem, vertices, corners.astype(np.int64)))


_BINARY = re.compile(rb"\s*BINARY\b")


def read_off(path: Path, content: bytes) -> Contents:
    """Read positions and polygons; normals, colours and texture coordinates are passed over.

    Raises
    ------
    MeshFileError, ValueError
        It is binary or not three-dimensional, or its counts are not numbers or exceed what it holds.
    """
    content = plain_text(content)
    keyword = OFF_KEYWORD.match(content)
    if keyword is not None and _BINARY.match(content, keyword.end()):
        raise MeshFileError(f"{path} is a binary OFF file, which is not read: save it as text, or as ply or obj")
    check_text(path, content)
    lines = [line for line in (raw.split(b"#", 1)[0].strip() for raw in content.splitlines()) if line]
    if lines and (keyword := OFF_KEYWORD.match(lines[0])) is not None:
        if set(keyword[1] or b"") & set(b"n4"):
            raise MeshFileError(f"{path} is nOFF or 4OFF, for any number of dimensions: save it as OFF")
        rest = lines[0][keyword.end() :].strip()
        lines[:1] = [rest] if rest else []
    header = lines[0].split() if lines else []
    if len(header) < 2:
        raise ValueError("its header lacks the counts")
    vertices, faces = (count_in(word) for word in header[:2])
    body = lines[1:]
    if len(body) < vertices + faces:
        raise ValueError(f"its header declares {vertices} vertices and {faces} faces")
    points = vectors_of(b"\n".join(body[:vertices]))
    numbers, words = rows_of(b"\n".join([*body[vertices : vertices + faces], b""]))
    first = np.cumsum(words) - words
    counts = whole(numbers[first])
    if (counts > words - 1).any() or (counts < 0).any():
        raise ValueError("a face has fewer corners than it declares")
    owner = np.repeat(np.arange(faces), counts)
    place = np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]
    corners = whole(numbers[first[owner] + 1 + place])
    return Contents(one_shape(path.stem, points, triangles_of(points, counts, corners)))
