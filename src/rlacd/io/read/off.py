"""OFF files in all their variants, rewritten as the plain variant that the parser reads.

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
from rlacd.io.read.polygons import triangles_of
from rlacd.io.read.text import check_text, count_in

KEYWORD = re.compile(rb"((?:ST|[CN4n])*)OFF(?![A-Za-z])|off(?![A-Za-z])")
BINARY = re.compile(rb"\s*BINARY\b")


def is_off(head: bytes) -> bool:
    """Whether these first bytes of a file, after any comments, are the keyword of an OFF file."""
    lines = (line.lstrip() for line in head.splitlines())
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    return KEYWORD.match(first) is not None


def plain_off(path: Path, content: bytes) -> bytes:
    """Rewrite an OFF file of any variant as keyword, counts and lines: positions of three coordinates, and triangles.

    Normals, colours and texture coordinates stay behind the positions, where the parser ignores them. The parser takes
    only polygons with up to four corners.

    Raises
    ------
    MeshFileError
        It is binary or not three-dimensional, or its counts are not numbers or exceed what it holds.
    """
    content = content.removeprefix(b"\xef\xbb\xbf")
    keyword = KEYWORD.match(content)
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
    if b"4" in letters:
        body[:vertices] = _divided(path, body[:vertices])
    triangles = _triangles(path, body[:vertices], body[vertices : vertices + faces])
    return b"\n".join([b"OFF", b"%d %d 0" % (vertices, len(triangles)), *body[:vertices], *triangles, b""])


def _take_keyword(lines: list[bytes]) -> bytes:
    """Remove the keyword from the first line, or that line if it holds nothing else; returns the letters before it."""
    found = KEYWORD.match(lines[0]) if lines else None
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


def _divided(path: Path, lines: list[bytes]) -> list[bytes]:
    """Divide homogeneous coordinates x, y, z, w by w; points at infinity become infinite or NaN."""
    try:
        points = np.array([line.split(None, 4)[:4] for line in lines], dtype=np.float64).reshape(-1, 4)
    except ValueError as error:
        raise MeshFileError(f"{path} is a 4OFF file, but not every vertex has four numbers: export it again") from error
    with np.errstate(all="ignore"):
        positions = points[:, :3] / points[:, 3:]
    return [b"%r %r %r" % (x, y, z) for x, y, z in positions.tolist()]


def _triangles(path: Path, vertices: list[bytes], faces: list[bytes]) -> list[bytes]:
    """Lines of triangles: those of each polygon, nothing for edges and points."""
    if all(line.startswith((b"3 ", b"3\t")) for line in faces):
        return faces
    rings = [_corners(path, line) for line in faces]
    try:
        points = np.array([line.split(None, 3)[:3] for line in vertices], dtype=np.float64).reshape(-1, 3)
        corners = np.array([corner for ring in rings for corner in ring], dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise MeshFileError(f"{path} cannot be read as off: it is damaged ({error}); export it again") from error
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise MeshFileError(f"{path} has faces that refer to missing points: export it again")
    counts = np.array([len(ring) for ring in rings], dtype=np.int64)
    return [b"3 %d %d %d" % (a, b, c) for a, b, c in triangles_of(points, counts, corners).tolist()]


def _corners(path: Path, line: bytes) -> list[bytes]:
    number, *corners = line.split()
    count = count_in(path, number)
    if len(corners) < count:
        raise MeshFileError(f"{path} is cut off: a face of {count} corners has {len(corners)}; export it again")
    return corners[:count]
