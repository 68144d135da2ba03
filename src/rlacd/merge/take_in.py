"""Growing hulls to points of the input just outside them, where repair moved the surface or a sliver was dropped."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rlacd.criteria import Criterion
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull

MOST = 10_000
"""Points looked at: the first ones."""


def take_in(parts: Sequence[Part], points: FloatArray, criterion: Criterion) -> list[Part]:
    """Grow hulls to points, for each the hull that has to grow least, unless its part then breaks the criterion.

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
    points = points[:MOST]
    growth = np.array([_beyond(part.hull, points) for part in parts])
    taker = np.where(growth > 0, growth, np.inf).argmin(axis=0)
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


def _beyond(hull: Hull, points: FloatArray) -> FloatArray:
    """How far the planes of a hull have to move outwards to take in points ``[N]``; 0 for those inside."""
    a, b, c = hull.vertices[hull.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    is_flat = lengths == 0
    normals, offsets = normals[~is_flat] / lengths[~is_flat, None], a[~is_flat]
    # Sums written out: a library's matrix product may round otherwise on another machine.
    beyond = sum(points[:, k, None] * normals[:, k] - offsets[:, k] * normals[:, k] for k in range(3))
    least: FloatArray = np.maximum(np.max(beyond, axis=1), 0.0)
    return least
