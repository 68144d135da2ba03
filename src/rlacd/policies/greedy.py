"""Policies that look one step ahead: the plane of least score among some candidates; the paper's deployment rule, and
its control, the same rule on random planes.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.planes.candidates import EDGES_PER_COMPONENT, Candidates, reflex_edge_planes
from rlacd.planes.sweep import Sweep, SweepCache, distinct_planes, least_excess, paper_planes
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

EXPONENT = 1.3
"""Exponent of the norm that gives the fewest parts (research/search.md)."""


def hull_sum(s: Sweep) -> FloatArray:
    """|CH(m_l)| + |CH(m_r)|: the paper's greedy baseline (its reward r1)."""
    return s.hull_below + s.hull_above


def excess_norm(s: Sweep) -> FloatArray:
    """p-th power of the p-norm of the two sides' |CH(m_i)| - |m_i|, p = `EXPONENT`: between the sum and the maximum."""
    below, above = np.maximum(s.hull_below - s.solid_below, 0), np.maximum(s.hull_above - s.solid_above, 0)
    return _native.powers(below, EXPONENT) + _native.powers(above, EXPONENT)


SCORES: Mapping[str, float] = MappingProxyType({"hull-sum": 1.0, "max-excess": math.inf, "excess-norm": EXPONENT})
"""Exponents of the norm of the two sides' |CH(m_i)| - |m_i| that orders planes: hull-sum is the paper's greedy baseline
(its reward r1), max-excess orders them as the larger R_v of the two sides does (CoACD's one-step cost)."""


Planes = Callable[[Component], Candidates]
"""Candidate planes of a component."""


class Greedy:
    """Chooses the plane with the least score.

    Parameters
    ----------
    score : str
        A key of `SCORES`.
    sweeps : SweepCache, optional
        Provides the planes, to share them with other policies.
    planes : callable, optional
        Provides the planes in place of `sweeps`.
    """

    def __init__(
        self, score: str = "excess-norm", sweeps: SweepCache | None = None, planes: Planes | None = None
    ) -> None:
        self._exponent = SCORES[score]
        self._planes = planes or (sweeps or SweepCache()).candidates

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if every candidate misses it or leaves a sliver."""
        return least_excess(component, self._planes(component), self._exponent, threads)


def paper_planes_and_edges(component: Component) -> Candidates:
    """Candidates of one component: the paper's 150, and those of four reflex edges."""
    return Candidates.joined(paper_planes(component), reflex_edge_planes(component))


def navacd_planes(component: Component) -> Candidates:
    """Candidates of one component: the middle of its box along x, y and z, and those of four reflex edges.

    J. Andrews, "Navigation-Driven Approximate Convex Decomposition", SIGGRAPH 2024, takes the one with the least sum of
    hull volumes. It cuts one part at a time, the largest |CH(m_i)| - |m_i| first, where here all unfinished components
    of a round are cut: the plane that cuts a component does not depend on the others, so both reach the same parts.
    """
    return Candidates.joined(mid_planes(component), reflex_edge_planes(component))


def mid_planes(component: Component) -> Candidates:
    """Candidates of one component: the planes that bisect its bounding box, one along each coordinate axis."""
    return Candidates(np.eye(3), component.box.mean(axis=0)[:, None])


def least_hulls(
    component: Component, candidates: Candidates, chosen: NDArray[np.intp], reflex_edges: int, threads: int = 1
) -> Plane | None:
    """Get the plane with the least sum of hull volumes among some candidates and those of reflex edges.

    Parameters
    ----------
    candidates : Candidates
        Candidates of this component, K directions with M planes each.
    chosen : int [N]
        Indices of the planes on the shortlist; the first is taken if none is valid.
    reflex_edges : int
        Number of reflex edges whose planes join the shortlist.
    """
    directions = candidates.directions[chosen // candidates.offsets.shape[1]]
    short = Candidates(directions, candidates.offsets.ravel()[chosen][:, None])
    if reflex_edges:
        short = Candidates.joined(short, reflex_edge_planes(component, reflex_edges))
    fallback = candidates.plane(int(chosen[0])) if len(chosen) else None
    return least_excess(component, short, SCORES["hull-sum"], threads) or fallback


class RandomShortlist:
    """Chooses the plane with the least sum of hull volumes among random planes and those of reflex edges.

    With ten planes and four edges, this is the paper's deployment of its network without the network.

    Parameters
    ----------
    planes : int
        Number of valid planes drawn from the 150.
    reflex_edges : int
        Number of reflex edges whose planes join them.
    seed : int
        The drawn planes depend on it and the component's vertices alone.
    """

    def __init__(self, planes: int = 10, reflex_edges: int = EDGES_PER_COMPONENT, seed: int = 0) -> None:
        self._planes = planes
        self._reflex_edges = reflex_edges
        self._seed = seed

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        candidates = paper_planes(component)
        valid = np.flatnonzero(distinct_planes(component, candidates))
        random = np.random.default_rng([self._seed, zlib.crc32(component.vertices.tobytes())])
        drawn = random.choice(valid, min(self._planes, len(valid)), replace=False)
        return least_hulls(component, candidates, drawn, self._reflex_edges, threads)
