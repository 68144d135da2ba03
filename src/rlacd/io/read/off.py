"""OFF files in all their variants.

The format is Geomview's: a keyword, the numbers of vertices, faces and edges, a line per vertex, a line per face.
Letters before ``OFF`` say what else the line of a vertex holds: texture coordinates (``ST``), a colour (``C``), a
normal (``N``), a fourth homogeneous coordinate (``4``), or that there are not three dimensions (``n``). The keyword may
be left out or have the numbers on its own line, and ``#`` begins a comment.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.polygons import triangles_of
from rlacd.io.read.recognize import OFF_KEYWORD
from rlacd.io.read.text import check_text, count_in, plain_text, rows_of, vectors_of, whole

BINARY = re.compile(rb"\s*BINARY\b")


def read_off(path: Path, content: bytes) -> Contents:
    """Read positions and polygons; normals, colours and texture coordinates are passed over.

    Raises
    ------
    MeshFileError, ValueError
        It is binary or not three-dimensional, or its counts are not numbers or exceed what it holds.
    """
    content = plain_text(content)
    keyword = OFF_KEYWORD.match(content)
    if keyword is not None and BINARY.match(content, keyword.end()):
        raise MeshFileError(
            f"{path} is a binary OFF file, which rlacd does not read: save it as text, or as ply or obj"
        )
    check_text(path, content)
    lines = [line for line in (raw.split(b"#", 1)[0].strip() for raw in content.splitlines()) if line]
    letters = _take_keyword(lines)
    if b"n" in letters:
        _check_dimension(path, letters, lines)
    header = lines[0].split() if lines else []
    if len(header) < 2:
        raise MeshFileError(f"{path} cannot be read as off: its header lacks the counts; export it again")
    vertices, faces = (count_in(path, word) for word in header[:2])
    body = lines[1:]
    if len(body) < vertices + faces:
        raise MeshFileError(
            f"{path} is cut off: its header declares {vertices} vertices and {faces} faces; export it again"
        )
    points = vectors_of(b"\n".join(body[:vertices]), 4 if b"4" in letters else 3)
    if b"4" in letters:
        with np.errstate(all="ignore"):
            points = points[:, :3] / points[:, 3:]
    numbers, words = rows_of(b"\n".join([*body[vertices : vertices + faces], b""]))
    first = np.cumsum(words) - words
    counts = whole(numbers[first])
    if (counts > words - 1).any() or (counts < 0).any():
        raise MeshFileError(f"{path} is cut off: a face has fewer corners than it declares; export it again")
    owner = np.repeat(np.arange(faces), counts)
    place = np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]
    corners = whole(numbers[first[owner] + 1 + place])
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise MeshFileError(f"{path} has faces that refer to missing points: export it again")
    return Contents(one_shape(path.stem, points, triangles_of(points, counts, corners)))


def _take_keyword(lines: list[bytes]) -> bytes:
    """Remove the keyword from the first line, or that line if it holds nothing else; returns the letters before it."""
    found = OFF_KEYWORD.match(lines[0]) if lines else None
    if found is None:
        return b""
    rest = lines[0][found.end() :].strip()
    lines[:1] = [rest] if rest else []
    return found[1] or b""


def _check_dimension(path: Path, letters: bytes, lines: list[bytes]) -> None:
    """Remove the dimension of the space from the lines, and refuse any other than three."""
    word, _, rest = lines[0].partition(b" ") if lines else (b"", b"", b"")
    lines[:1] = [rest.strip()] if rest.strip() else []
    dimension = count_in(path, word)
    if dimension != 3 or b"4" in letters:
        what = f"{dimension} dimensions" + (" and homogeneous coordinates" if b"4" in letters else "")
        raise MeshFileError(f"{path} is a mesh in {what}, not in 3 dimensions: project it first")
