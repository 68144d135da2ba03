"""The paper's deployment rule, and the control that anything learned has to beat: the same rule on random planes."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.concave_edges import concave_edge_planes
from rlacd.planes.sweep import sweep
from rlacd.policies.greedy import cheapest, hull_sum
from rlacd.policies.navacd import EDGES_PER_COMPONENT
from rlacd.policies.observe import valid_planes
from rlacd.solid.component import Component, Plane


def least_hulls(
    component: Component, candidates: Candidates, chosen: NDArray[np.intp], concave_edges: int, threads: int = 1
) -> Plane | None:
    """Get the plane with the least sum of hull volumes among some candidates and those of concave edges.

    Parameters
    ----------
    candidates : Candidates
        Candidates of this component, K directions with M planes each.
    chosen : int [N]
        Indices of the planes on the shortlist; the first is taken if none is valid.
    concave_edges : int
        Number of concave edges whose planes join the shortlist.
    """
    directions = candidates.directions[chosen // candidates.offsets.shape[1]]
    short = Candidates(directions, candidates.offsets.ravel()[chosen][:, None])
    if concave_edges:
        short = Candidates.joined(short, concave_edge_planes(component, concave_edges))
    if not len(short):
        return None
    scored = sweep(component, short, threads)
    fallback = candidates.plane(int(chosen[0])) if len(chosen) else None
    return cheapest(scored, hull_sum(scored)) or fallback


def generator_of(component: Component, seed: int = 0) -> np.random.Generator:
    """Get a random generator that a component's vertices and the seed determine, whatever was cut before."""
    return np.random.default_rng([seed, zlib.crc32(component.vertices.tobytes())])


class RandomShortlist:
    """Chooses the plane with the least sum of hull volumes among random planes and those of concave edges.

    With ten planes and four edges, this is the paper's deployment of its network without the network.

    Parameters
    ----------
    planes : int
        Number of valid planes drawn from the 150.
    concave_edges : int
        Number of concave edges whose planes join them.
    seed : int
        See `generator_of`.
    """

    def __init__(self, planes: int = 10, concave_edges: int = EDGES_PER_COMPONENT, seed: int = 0) -> None:
        self._planes = planes
        self._concave_edges = concave_edges
        self._seed = seed

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        candidates = axis_and_principal(component)
        valid = np.flatnonzero(valid_planes(component, candidates))
        drawn = generator_of(component, self._seed).choice(valid, min(self._planes, len(valid)), replace=False)
        return least_hulls(component, candidates, drawn, self._concave_edges, threads)
