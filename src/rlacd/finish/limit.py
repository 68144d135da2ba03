"""Final hulls inside limits on vertices and faces, and with few corners."""

from __future__ import annotations

import math

from rlacd.criteria import Criterion
from rlacd.finish.in_input import plain_hull
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.limit_hull import NO_SIDES, keeps, limit_hull

SHARE_OF_OVERHANG = 0.2
"""A simple hull grows by at most this share of what the criterion allows beyond a part."""

MOST_GROWTH = 0.02
"""Nor by more than this (the longest side of the input is 2), however large the threshold."""

GROWTHS_TRIED = 3
"""If the criterion is no longer met, half the growth is tried, and so on."""


def simple_part(part: Part, criterion: Criterion, limits: HullLimits, sides: FloatArray = NO_SIDES) -> Part:
    """Get the part with a hull of few corners that still meets the criterion; the same part if there is none.

    A criterion that does not bound how far a hull may reach beyond its part leaves hulls as they are. A hull that
    exceeds the limits is left for `limit_part`. For `sides` see `limit_hull`.
    """
    if not math.isfinite(criterion.overhang):
        return part
    growth = min(SHARE_OF_OVERHANG * criterion.overhang, MOST_GROWTH)
    for _ in range(GROWTHS_TRIED):
        hull = limit_hull(part.hull, limits, growth, sides)
        if hull is part.hull:
            return part
        simple = part.with_hull(hull)
        if criterion.is_met(simple):
            return simple
        growth /= 2
    return part


def limit_part(
    part: Part, limits: HullLimits, criterion: Criterion | None = None, sides: FloatArray = NO_SIDES
) -> Part:
    """Get the part with a hull inside the limits and without nearly redundant corners; the same part if unchanged.

    Without such corners a hull is up to 1e-6 larger. They stay if the part would then no longer meet a given criterion.
    For `sides` see `limit_hull`.
    """
    hull = limit_hull(part.hull, limits, sides=sides)
    if hull is part.hull:
        return part
    limited = part.with_hull(hull)
    fits = criterion is not None and keeps(part.hull, limits)
    spoilt = fits and criterion is not None and not criterion.is_met(limited) and criterion.is_met(part)
    return part if spoilt else limited


def limit_roughly(part: Part, limits: HullLimits) -> Part:
    """Get the part with a hull inside the limits, cheaply: if its hull exceeds them, a box or tetrahedron around it."""
    return part if keeps(part.hull, limits) else part.with_hull(plain_hull(part.hull.vertices, limits))
