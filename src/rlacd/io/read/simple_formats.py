"""Formats that are lists of numbers: STL, the meshes of MuJoCo (msh), and points (xyz)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import Contents, one_shape
from rlacd.io.read.text import check_text, plain_text, vectors_of
from rlacd.memory import BYTES_READ, require_memory
from rlacd.solid.arrays import FloatArray

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
            raise MeshFileError(f"{path} is cut off: its header declares {count} triangles; export it again")
        require_memory(count, BYTES_READ, path.name)
        points = np.frombuffer(content, _STL, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
        warnings = [f"{more} bytes after the last triangle of {path.name} were left out"] if more else []
    else:
        check_text(path, content)
        points = _text_stl(path, plain_text(content))
    return Contents(one_shape(path.stem, points, np.arange(len(points)).reshape(-1, 3)), warnings)


def _text_stl(path: Path, text: bytes) -> FloatArray:
    require_memory(max(text.count(b"vertex"), text.count(b"VERTEX")) // 3, BYTES_READ, path.name)
    corners = _VERTEX.findall(text)
    if len(corners) % 3 or (corners and b"end" not in text[text.lower().rfind(b"vertex") :].lower()):
        raise ValueError(f"a triangle ends after {len(corners) % 3} vertices")
    return np.array(corners, dtype=np.float64).reshape(-1, 3)


def read_xyz(path: Path, content: bytes) -> Contents:
    """Read points: the first three numbers of each line."""
    check_text(path, content)
    return Contents(one_shape(path.stem, vectors_of(plain_text(content))))


def read_msh(path: Path, content: bytes) -> Contents:
    """Read MuJoCo's binary mesh: four counts, then points, normals and texture coordinates as float32, and faces.

    Raises
    ------
    MeshFileError
        The counts are not those of a mesh, or do not fit the length of the file.
    """
    if content.startswith(b"$MeshFormat"):
        raise MeshFileError(f"{path} is a mesh of Gmsh, not of MuJoCo: convert it to glb, obj, stl or ply")
    counts = [int(count) for count in np.frombuffer(content[: len(content[:16]) // 4 * 4], "<i4")]
    if len(counts) < 4 or min(counts) < 0:
        raise MeshFileError(f"{path} cannot be read as msh: its header lacks the counts; export it again")
    points, normals, texture, faces = counts
    if len(content) != 16 + 4 * (3 * points + 3 * normals + 2 * texture + 3 * faces):
        raise MeshFileError(f"{path} is not as long as its header declares: it is damaged or cut off; export it again")
    vertices = np.frombuffer(content, "<f4", 3 * points, 16).reshape(-1, 3).astype(np.float64)
    corners = np.frombuffer(content, "<i4", 3 * faces, len(content) - 12 * faces).reshape(-1, 3)
    return Contents(one_shape(path.stem, vertices, corners.astype(np.int64)))
