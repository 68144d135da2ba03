"""How many hulls any decomposition needs: a proof from below, by points of which no two can share a hull.

Every hull of a valid decomposition keeps its surface within a reach of the solid. A hull that holds two points holds
the segment between them. If the segment meets the exterior, from where a path leads to infinity farther from the solid
than the reach, the path leaves the hull too far from the solid: such points are *independent*, and of points that
are independent of each other, each needs its own hull (`native/solid/apart.hpp`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rlacd import _native
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, dots
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import PLACES
from rlacd.solid.frame import HALF_THICKNESS

UNCOVERED = HALF_THICKNESS
"""How far outside the hulls a point of the solid may lie, in the normalised frame."""

CANDIDATES = PLACES // 2
"""Points of the solid's surface to choose from, besides the corners of the hulls."""

POINTS, POINTS_PER_PART = 90, 3
"""Points chosen, far from each other. On 80 meshes of test/, half as many again prove no more of them minimal."""


def at_least(solid: Component, parts: Sequence[Part], reach: float, run: Run) -> int:
    """Get a lower bound on the number of hulls of any decomposition of a solid.

    Parameters
    ----------
    solid : Component
    parts : sequence of Part
        A decomposition, whose corners are good candidates; the search for a better bound ends at their number.
    reach : float
        How far from the solid the surface of a hull may lie, in the normalised frame. The hulls have to cover the
        solid but for points at most `UNCOVERED` outside.
    run : Run

    Returns
    -------
    int
        1 if the reach is infinite.
    """
    if not math.isfinite(reach) or len(parts) == 1:
        return 1
    surface = solid.against.surface
    samples, _ = _native.sample_surface(solid.vertices, solid.faces, CANDIDATES, 0)
    corners, _ = surface.closest(np.concatenate([part.hull.vertices for part in parts]), run.threads)
    points = np.concatenate([corners, samples])
    points = points[_spread(points, POINTS + POINTS_PER_PART * len(parts))]
    found = _native.apart_points(surface, points, reach + UNCOVERED, len(parts))
    return max(1, len(found))


def _spread(points: FloatArray, count: int) -> list[int]:
    """Choose `count` points by farthest-point sampling, from the one farthest from the centre on."""
    gaps = points - points.mean(axis=0)
    chosen = [int(dots(gaps, gaps).argmax())]
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        gaps = points - points[chosen[-1]]
        away = np.minimum(away, dots(gaps, gaps))
        chosen.append(int(away.argmax()))
    return chosen
