"""Greedy: the valid candidate plane whose two sides have the best score, looking one step ahead."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from rlacd.planes.least_excess import SLIVERS, TIE, least_excess
from rlacd.planes.sweep import Sweep
from rlacd.planes.sweep_cache import SweepCache
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

EXPONENT = 1.3
"""Exponent of the norm that gives the fewest parts (research/search.md)."""


def hull_sum(s: Sweep) -> FloatArray:
    """|CH(m_l)| + |CH(m_r)|: the paper's greedy baseline (its reward r1)."""
    return s.hull_below + s.hull_above


def max_excess(s: Sweep) -> FloatArray:
    """max(|CH(m_i)| - |m_i|): orders planes as the larger R_v of the two sides does (CoACD's one-step cost)."""
    return np.maximum(s.hull_below - s.solid_below, s.hull_above - s.solid_above)


def excess_norm(s: Sweep) -> FloatArray:
    """p-th power of the p-norm of the two sides' |CH(m_i)| - |m_i|, p = `EXPONENT`: between the sum and the maximum."""
    below, above = np.maximum(s.hull_below - s.solid_below, 0), np.maximum(s.hull_above - s.solid_above, 0)
    norm: FloatArray = below**EXPONENT + above**EXPONENT
    return norm


SCORES: Mapping[str, float] = MappingProxyType({"hull-sum": 1.0, "max-excess": math.inf, "excess-norm": EXPONENT})
"""Exponents of the norms that order planes as the functions of a sweep above do."""


def cheapest(scored: Sweep, cost: FloatArray) -> Plane | None:
    """Get the valid plane of least cost; None if every plane misses the solid or shaves off a film.

    Planes that leave slivers are taken only if there is no other. Of planes whose costs are equal up to rounding, as in
    symmetric shapes, the first is taken, so that the cuts do not depend on the unit and position of the input.
    """
    for sliver in SLIVERS:
        valid = scored.valid(sliver)
        if valid.any():
            equal = cost[valid].min() + TIE * cost[valid].max()
            return scored.candidates.plane(int(np.argmax(valid & (cost <= equal))))
    return None


class Greedy:
    """Chooses the plane with the least score among the paper's 150 and those of a few concave edges.

    Parameters
    ----------
    score : str
        A key of `SCORES`.
    concave_edges : int
        Number of concave edges whose planes are added; 0 with `hull-sum` is the paper's baseline.
    sweeps : SweepCache, optional
        Provides the planes, to share them with other policies; `concave_edges` is then ignored.
    """

    def __init__(self, score: str = "excess-norm", concave_edges: int = 4, sweeps: SweepCache | None = None) -> None:
        self._exponent = SCORES[score]
        self._sweep_cache = sweeps or SweepCache(concave_edges=concave_edges)

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if every candidate misses it or shaves off a film."""
        return least_excess(component, self._sweep_cache.candidates(component), self._exponent, threads)
