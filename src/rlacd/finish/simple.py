"""Hulls with few corners: what room the criterion leaves is used to leave out corners that add little."""

from __future__ import annotations

import math

from rlacd.criteria import Criterion
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.limit_hull import limit_hull

ROOM = 0.2
"""A simple hull grows by at most this share of what the criterion allows beyond a part."""

MOST = 0.02
"""Nor by more than this (the longest side of the input is 2), however large the threshold."""

TRIES = 3
"""If the criterion is no longer met, half the growth is tried, and so on."""


def simple_part(
    part: Part, criterion: Criterion, max_vertices: int | None, max_faces: int | None, sides: FloatArray
) -> Part:
    """Get the part with a hull of few corners that still meets the criterion; the same part if there is none.

    Parameters
    ----------
    part : Part
    criterion : Criterion
        One that does not bound how far a hull may reach beyond its part leaves hulls as they are.
    max_vertices, max_faces : int, optional
        Limits on the hull's vertices and triangles. If the hull exceeds them, it is left for `limit_part`.
    sides : FloatArray
        Half-spaces that the hull stays in, as for `limit_hull`.
    """
    if not math.isfinite(criterion.overhang):
        return part
    growth = min(ROOM * criterion.overhang, MOST)
    for _ in range(TRIES):
        hull = limit_hull(part.hull, max_vertices, max_faces, tolerance=growth, sides=sides)
        if hull is part.hull:
            return part
        simple = part.with_hull(hull)
        if criterion.is_met(simple):
            return simple
        growth /= 2
    return part
