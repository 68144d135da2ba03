"""Simplifying hulls: physics engines limit the number of vertices, and each vertex costs time in every contact."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.errors import OptionError
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray
from rlacd.solid.hull import Hull

TOLERANCE = 1e-6
"""Lengths in the frame that do not count: corners that change the hull by no more are always removed, hulls that are no
farther apart touch, and one that moves no farther on its way to the input's unit is not measured again."""

_NO_LIMIT = 2**31 - 1

NO_SIDES = np.empty((0, 4))


NO_LIMITS = HullLimits()


def keeps(hull: Hull, limits: HullLimits) -> bool:
    """Tell whether a hull has no more vertices and triangles than the limits allow."""
    return limits.allow(len(hull.vertices), len(hull.faces))


def limit_hull(
    hull: Hull, limits: HullLimits = NO_LIMITS, tolerance: float = TOLERANCE, sides: FloatArray = NO_SIDES
) -> Hull:
    """Enclose a hull in one with at most the given numbers of corners and triangles, adding little volume.

    Parameters
    ----------
    hull : Hull
        Convex, closed, oriented outwards.
    limits : HullLimits, optional
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
    for name, limit in limits._asdict().items():
        if limit is not None and limit < 4:
            raise OptionError(f"{name} must be at least 4, the corners and faces of a tetrahedron, not {limit}.")
    if not tolerance >= 0:
        raise OptionError(f"The tolerance must not be negative, as {tolerance} is; 1e-6 is usual.")
    most, most_faces = (min(limit or _NO_LIMIT, _NO_LIMIT) for limit in limits)
    vertices, faces = _native.simplify_hull(hull.vertices, hull.faces, most, most_faces, tolerance, sides)
    if len(vertices) == len(hull.vertices) and (vertices == hull.vertices).all():
        return hull
    return Hull(vertices, faces, _native.mesh_volume(vertices, faces))
