"""Hulls with few corners: physics engines limit them, and every corner costs time in every contact."""

from __future__ import annotations

from rlacd import _native
from rlacd.errors import OptionError
from rlacd.solid.hull import Hull

TOLERANCE = 1e-6
"""Corners that change the hull by no more than this (normalised frame) go in any case."""

_NO_LIMIT = 2**31 - 1


def limit_hull(
    hull: Hull, max_vertices: int | None = None, max_faces: int | None = None, tolerance: float = TOLERANCE
) -> Hull:
    """Return a hull around the hull with at most so many corners and triangles, and with little added volume.

    Parameters
    ----------
    hull : Hull
        Convex, closed, outward oriented.
    max_vertices
        At least 4; None is no limit.
    max_faces
        Triangles, at least 4; None is no limit. A triangulated hull of V corners has 2 V - 4 triangles.
    tolerance
        No point of the result is farther than this from the hull because of the clean-up alone, which takes away
        corners and facets that the hull hardly needs.

    Returns
    -------
    Hull
        Convex; holds the given hull (to rounding, about 1e-12). The given hull itself where nothing had to change.

    Raises
    ------
    OptionError
        A limit below 4, or a negative tolerance.

    Notes
    -----
    Edge collapses outwards (progressive hulls: Sander et al., "Silhouette Clipping", SIGGRAPH 2000), each the solution
    of a linear program, cheapest first; then the remaining corners move, one at a time, to where the volume is least
    while the hull stays convex and around the given one.
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
    )
    if len(vertices) == len(hull.vertices) and (vertices == hull.vertices).all():
        return hull
    return Hull(vertices, faces, _native.mesh_volume(vertices, faces))
