"""Hulls that stay convex and closed when their coordinates are rounded to float32."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import trimesh

from rlacd._native import convex_hull, mesh_volume
from rlacd.errors import OutputError
from rlacd.io.read.contents import Triangles as Triangles

# A hull keeps its shape if its volume changes by less than this share: a flat or tiny hull far from the origin loses
# much more, or all of it, when float32 has no digits left for its thickness.
VOLUME_TOLERANCE = 1e-3

VISIBLE_STEP = 1e-4
"""Of a visible mesh's size."""


Triangulated: TypeAlias = "trimesh.Trimesh | Triangles"


def rounded_hull(hull: Triangulated, shift: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Triangles | None:
    """Round the vertices of ``hull - shift`` to float32 and recompute their convex hull.

    Rounding moves vertices by different amounts, which can dent a hull along its flat regions or fold a thin triangle.
    Taking the hull of the rounded points, with exact predicates, gives a hull that is still convex in a float32 file.

    Parameters
    ----------
    hull : trimesh.Trimesh or Triangles
        A convex hull.
    shift : array-like [3]
        Subtracted, in float64, before rounding.

    Returns
    -------
    Triangles or None
        Vertices are float64 numbers that float32 holds exactly. None if float32 cannot hold the shape here.
    """
    with np.errstate(over="ignore"):
        points = (np.asarray(hull.vertices) - np.asarray(shift)).astype(np.float32).astype(np.float64)
    if not np.isfinite(points).all():
        return None
    indices, faces, rank = convex_hull(np.ascontiguousarray(points))
    if rank < 3:
        return None
    vertices = points[indices]
    before, after = _volume(hull.vertices, hull.faces), _volume(vertices, faces)
    if abs(after - before) > VOLUME_TOLERANCE * before:
        return None
    return Triangles(vertices, faces)


def required_hull(hull: Triangulated, name: str, where: str) -> tuple[Triangles, npt.NDArray[np.float64]]:
    """Round a hull to float32 in place or, if that would ruin it, about its own centre.

    Returns
    -------
    Triangles, shift [3]
        The hull is the mesh moved by the shift, which is zero wherever that suffices.

    Raises
    ------
    OutputError
        It is too large, small or thin even about its own centre; the message says its name and where it was to go.
    """
    shift = np.zeros(3)
    rounded = rounded_hull(hull)
    if rounded is None:
        shift = (hull.vertices.min(axis=0) + hull.vertices.max(axis=0)) / 2
        rounded = rounded_hull(hull, shift)
    if rounded is None:
        size = float(np.ptp(hull.vertices, axis=0).max())
        least, most = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
        misfit = "large" if size / 2 > most else "small" if size < least else "thin"
        said = f"cannot write {name} {where}: it is too {misfit} for single precision"
        raise OutputError(f"{said}; scale the mesh, or write .obj, .ply or .stl in double precision.")
    return rounded, shift


def placed_mesh(mesh: Triangulated) -> tuple[Triangles, npt.NDArray[np.float64]]:
    """Do the same for a visible mesh, where a change below `VISIBLE_STEP` of its size cannot be seen."""
    used = mesh.vertices[np.unique(mesh.faces)]
    lower, upper = used.min(axis=0), used.max(axis=0)
    step = np.abs([lower, upper]).max() * np.finfo(np.float32).eps
    shift = np.zeros(3) if step <= VISIBLE_STEP * (upper - lower).max() else lower / 2 + upper / 2
    return Triangles(np.asarray(mesh.vertices - shift), np.asarray(mesh.faces)), shift


def _volume(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.integer]) -> float:
    # About a point of the mesh: far from the origin the signed tetrahedra would cancel to noise.
    about = np.asarray(vertices) - np.asarray(vertices)[0]
    return float(mesh_volume(about, np.ascontiguousarray(faces, dtype=np.int32)))
