"""Final hulls inside limits on vertices and faces."""

from __future__ import annotations

import math

from rlacd.criteria import Criterion
from rlacd.finish.in_input import plain_hull
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.limit_hull import NO_SIDES, limit_hull


def limit_roughly(part: Part, max_vertices: int | None, max_faces: int | None) -> Part:
    """Get the part with a hull inside the limits, cheaply: if its hull exceeds them, a box or tetrahedron around it."""
    vertices, faces = len(part.hull.vertices), len(part.hull.faces)
    if vertices <= (max_vertices or vertices) and faces <= (max_faces or faces):
        return part
    return part.with_hull(plain_hull(part.hull.vertices, max_vertices, max_faces))


def limit_part(
    part: Part,
    max_vertices: int | None,
    max_faces: int | None,
    criterion: Criterion | None = None,
    sides: FloatArray = NO_SIDES,
) -> Part:
    """Get the part with a hull inside the limits and without nearly redundant corners; the same part if unchanged.

    Without such corners a hull is up to 1e-6 larger. They stay if the part would then no longer meet a given criterion.
    For `sides` see `limit_hull`.
    """
    hull = limit_hull(part.hull, max_vertices, max_faces, sides=sides)
    if hull is part.hull:
        return part
    limited = part.with_hull(hull)
    fits = len(part.hull.vertices) <= (max_vertices or math.inf) and len(part.hull.faces) <= (max_faces or math.inf)
    spoilt = criterion is not None and fits and not criterion.is_met(limited) and criterion.is_met(part)
    return part if spoilt else limited
