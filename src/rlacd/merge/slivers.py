"""Slivers: thin hulls that growing leaves beside grown ones, dropped if the other hulls cover them."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Part, is_thin
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import SLIVER_RADIUS, Hull

SLIVER_LOSS = 2 * HALF_THICKNESS
"""A sliver is dropped if none of its points is farther than this from the other hulls (0.1 % of the longest side)."""


def drop_slivers(parts: list[Part], run: Run) -> list[Part]:
    """Drop slivers that the other hulls cover; all others stay, such as those of thin solids.

    Parameters
    ----------
    parts : list of Part
        Parts; they may overlap where the solid was clipped.

    Returns
    -------
    list of Part
        The remaining parts in the same order.
    """
    thin = run.map(lambda part: is_thin(part) or is_sliver(part.hull), parts)
    boxes = np.array([part.box for part in parts])
    kept = np.ones(len(parts), dtype=bool)
    stood_in: dict[int, BoolArray] = {}  # the hulls near each sliver when it was dropped

    def is_missed(own: int) -> bool:
        others = stood_in[own] = kept & _near(boxes, boxes[own])
        near = [parts[i].hull for i in np.flatnonzero(others)]
        return not near or _misses(hull_union(near, run.threads), parts[own], run.threads)

    smallest_first = sorted(np.flatnonzero(thin).tolist(), key=lambda i: parts[i].hull.volume)
    for own in smallest_first:
        kept[own] = False
        kept[own] = is_missed(own)
    for own in reversed(smallest_first):  # in a stack of slivers, each would cover the next
        if not kept[own] and (stood_in[own] & ~kept).any():
            kept[own] = is_missed(own)
    return [parts[i] for i in np.flatnonzero(kept)]


def _misses(union: _native.HullUnion, sliver: Part, threads: int) -> bool:
    """Whether a point of a sliver is too far from the other hulls; corners, tested first, decide most."""
    if (union.distance(sliver.vertices[np.unique(sliver.faces)], threads) > SLIVER_LOSS).any():
        return True
    return union.under(sliver.vertices, sliver.faces, SLIVER_LOSS / 4, threads)[1] > SLIVER_LOSS


def is_sliver(hull: Hull, radius: float = SLIVER_RADIUS) -> bool:
    """Whether the radius of the hull's inscribed ball is less than `radius` times its largest extent."""
    least = radius * float(np.ptp(hull.vertices, axis=0).max())
    # A convex body's inradius lies between volume / area and three times that.
    ratio = hull.volume / _native.mesh_area(hull.vertices, hull.faces)
    return ratio <= least and (3 * ratio < least or not _native.holds_ball(hull.vertices, hull.faces, least))


def _near(boxes: FloatArray, sliver: FloatArray) -> BoolArray:
    """Which of the boxes [N, 2, 3] are within `SLIVER_LOSS` of a sliver's."""
    gap = np.maximum(boxes[:, 0] - sliver[1], sliver[0] - boxes[:, 1])
    return np.asarray((gap <= SLIVER_LOSS).all(axis=1))
