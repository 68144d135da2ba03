"""MuJoCo's binary meshes: four counts as int32; vertices, normals, texture coordinates as float32; faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.polygons_ply import encoded_ply


def msh_as_ply(path: Path, content: bytes) -> bytes:
    """Return the vertices and faces as a PLY file.

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
    vertices = np.frombuffer(content, "<f4", 3 * points, 16).reshape(-1, 3)
    corners = np.frombuffer(content, "<i4", 3 * faces, len(content) - 12 * faces).reshape(-1, 3)
    return encoded_ply(vertices.astype(np.float64), corners.astype(np.int64))
