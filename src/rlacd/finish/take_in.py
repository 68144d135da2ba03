"""Growing hulls to points of the input just outside them, where repair moved the surface or a sliver was dropped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rlacd.criteria import Criterion
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull

MOST_POINTS_TAKEN_IN = 10_000
"""Of more points than this, only every second, third, ... is looked at."""


def take_in(parts: Sequence[Part], points: FloatArray, criterion: Criterion) -> list[Part]:
    """Grow the hull nearest to each point to take it in, unless the hull's part then breaks the criterion.

    Parameters
    ----------
    parts : sequence of Part
    points : float64 [N, 3]
        A hull that holds one already is not asked: its part is going to be dropped.
    criterion : Criterion

    Returns
    -------
    list of Part
        In the same order, some with larger hulls.
    """
    points = points[:: 1 + len(points) // MOST_POINTS_TAKEN_IN]
    distance = np.array([hull_union([part.hull], 1).distance(points, 1) for part in parts])
    taker = np.where(distance > 0, distance, np.inf).argmin(axis=0)
    grown = list(parts)
    for i in np.unique(taker):
        part = parts[i]
        hull = Hull.of(np.concatenate([part.hull.vertices, points[taker == i]]))
        if hull is None:
            continue
        larger = part.with_hull(hull)
        if criterion.is_met(larger) or not criterion.is_met(part):
            grown[i] = larger
    return grown
