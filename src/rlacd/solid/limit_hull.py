"""Simplifying hulls: physics engines limit the number of vertices, and each vertex costs time in every contact."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.errors import OptionError
from rlacd.solid.arrays import FloatArray
from rlacd.solid.hull import Hull

TOLERANCE = 1e-6
"""Corners that change the hull by no more than this (in the frame) are always removed."""

_NO_LIMIT = 2**31 - 1

NO_SIDES = np.empty((0, 4))


def limit_hull(
    hull: Hull,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    tolerance: float = TOLERANCE,
    sides: FloatArray = NO_SIDES,
) -> Hull:
    """Enclose a hull in one with at most the given numbers of corners and triangles, adding little volume.

    Parameters
    ----------
    hull : Hull
        Convex, closed, oriented outwards.
    max_vertices : int, optional
        At least 4; None means no limit.
    max_faces : int, optional
        Limit on triangles, at least 4; None means no limit. A triangulated hull of V corners has 2 V - 4 triangles.
    tolerance : float
        Removing nearly redundant corners and facets, which is always done, moves no point of the result farther than
        this from the hull.

    sides : FloatArray
        Half-spaces n.x <= d that hold the hull, rows of unit n and d [P, 4]. The result stays in them, unless the
        limits leave no such hull.

    Returns
    -------
    Hull
        Convex; contains the given hull (up to rounding, about 1e-12). The given hull itself if nothing changed.

    Raises
    ------
    OptionError
        A limit below 4, or a negative tolerance.

    Notes
    -----
    Edges are collapsed outwards, cheapest first, each by solving a linear program (progressive hulls: Sander et al.,
    "Silhouette Clipping", SIGGRAPH 2000). Then the remaining corners are moved one at a time to minimise the volume
    while the hull stays convex and contains the given one.
    """
    for name, limit in (("max_vertices", max_vertices), ("max_faces", max_faces)):
        if limit is not None and limit < 4:
            raise OptionError(f"{name} must be at least 4, the corners and faces of a tetrahedron, not {limit}.")
    if not tolerance >= 0:
        raise OptionError(f"The tolerance must not be negative, as {tolerance} is; 1e-6 is usual.")
    vertices, faces = _native.simplify_hull(
        hull.vertices,
        hull.faces,
        min(max_vertices or _NO_LIMIT, _NO_LIMIT),
        min(max_faces or _NO_LIMIT, _NO_LIMIT),
        tolerance,
        sides,
    )
    if len(vertices) == len(hull.vertices) and (vertices == hull.vertices).all():
        return hull
    return Hull(vertices, faces, _native.mesh_volume(vertices, faces))
