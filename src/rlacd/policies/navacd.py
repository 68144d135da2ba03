"""NavACD's choice of planes: the middle of the box and a few concave edges, looking one step ahead."""

from __future__ import annotations

import numpy as np

from rlacd.planes.candidates import Candidates
from rlacd.planes.concave_edges import concave_edge_planes
from rlacd.planes.sweep import sweep
from rlacd.policies.greedy import cheapest, hull_sum
from rlacd.solid.component import Component, Plane

EDGES_PER_COMPONENT = 4
"""Maximum number of concave edges whose planes are tried."""


class NavACD:
    """Chooses the plane with the least sum of the two sides' hull volumes among at most 15.

    Candidates are the planes through the middle of the component's box along x, y and z, and those of up to four
    concave edges (J. Andrews, "Navigation-Driven Approximate Convex Decomposition", SIGGRAPH 2024).

    Notes
    -----
    NavACD cuts one part at a time, starting with the largest |CH(m_i)| - |m_i|. Here all unfinished components of a
    round are cut. The plane that cuts a component does not depend on the others, so both reach the same parts. The
    order matters only if the process is stopped early (`timeout`); `max_hulls` counts parts of finished
    decompositions.
    """

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if every candidate misses it or shaves off a film."""
        candidates = Candidates.joined(mid_planes(component), concave_edge_planes(component, EDGES_PER_COMPONENT))
        scored = sweep(component, candidates, threads)
        return cheapest(scored, hull_sum(scored))


def mid_planes(component: Component) -> Candidates:
    """Candidates of one component: the planes that bisect its bounding box, one along each coordinate axis."""
    return Candidates(np.eye(3), component.box.mean(axis=0)[:, None])
