"""Greedy: the valid candidate plane with the best score of its two sides, one step ahead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from rlacd.planes.sweep import SLIVER, Sweep
from rlacd.planes.views import Views
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane


def hull_sum(s: Sweep) -> FloatArray:
    """|CH(m_l)| + |CH(m_r)|: the paper's greedy baseline (its reward r1)."""
    return s.hull_below + s.hull_above


def max_excess(s: Sweep) -> FloatArray:
    """max(|CH(m_i)| - |m_i|): orders planes as the larger R_v of the two sides does (CoACD's one-step cost)."""
    return np.maximum(s.hull_below - s.solid_below, s.hull_above - s.solid_above)


def excess_norm(s: Sweep) -> FloatArray:
    """p-norm of the two sides' |CH(m_i)| - |m_i| with p = 1.3: between the sum (p = 1) and the maximum."""
    below, above = np.maximum(s.hull_below - s.solid_below, 0), np.maximum(s.hull_above - s.solid_above, 0)
    norm: FloatArray = below**1.3 + above**1.3
    return norm


SCORES: Mapping[str, Callable[[Sweep], FloatArray]] = MappingProxyType(
    {"hull-sum": hull_sum, "max-excess": max_excess, "excess-norm": excess_norm}
)


TIE = 1e-9
"""Costs that differ by less than this share of the largest are equal."""


def cheapest(scored: Sweep, cost: FloatArray) -> Plane | None:
    """Get the valid plane of least cost; None when every plane misses the solid or shaves off a film.

    Planes that leave slivers are taken only where no other is left. Of planes that cost the same but for rounding, as
    they do in symmetric shapes, the first is taken, so that the cuts do not depend on the input's unit and place.
    """
    for sliver in (SLIVER, SLIVER / 100):
        valid = scored.valid(sliver)
        if valid.any():
            equal = cost[valid].min() + TIE * cost[valid].max()
            return scored.candidates.plane(int(np.argmax(valid & (cost <= equal))))
    return None


class Greedy:
    """The plane with the least score, out of the paper's 150 and those of a few concave edges.

    Parameters
    ----------
    score : str
        A key of `SCORES`.
    concave_edges : int
        How many concave edges add their planes; with 0, the paper's baseline.
    views : Views, optional
        Where the sweeps come from, to share them with others; decides about the planes then.
    """

    def __init__(self, score: str = "excess-norm", concave_edges: int = 4, views: Views | None = None) -> None:
        self.score = SCORES[score]
        self.views = views or Views(concave_edges=concave_edges)

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None when every candidate misses it or shaves off a film."""
        scored = self.views.of(component, threads)
        return cheapest(scored, self.score(scored))
