"""Choosing a plane by the paper's Q network: the best of the 150 planes, or by the paper's deployment rule (4.2)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rlacd.policies.navacd import EDGES_PER_COMPONENT
from rlacd.policies.network import load_network
from rlacd.policies.observe import Float32Array, paper_planes, valid_planes
from rlacd.policies.shortlist import least_hulls
from rlacd.policies.sweep_features import FEATURES, PLANES, sweep_features
from rlacd.solid.component import Component, Plane

SHORTLIST = 10
"""Number of planes of greatest value from which the paper takes the one with the least sum of hull volumes."""

KIND = "rl-acd"

QFunction = Callable[[Component], Float32Array]
"""Values [150] of a component's planes (`paper_planes`)."""


class QPolicy:
    """Takes the plane of greatest value, or the one with the least hull sum among the best (the paper's deployment).

    Parameters
    ----------
    values : callable
    shortlist : int
        Number of best planes from which the one with the least sum of hull volumes is taken (paper: 10).
    concave_edges : int
        Number of concave edges whose planes join the shortlist (paper: 4, three planes each).
    """

    def __init__(self, values: QFunction, shortlist: int = 1, concave_edges: int = 0) -> None:
        self._values = values
        self._shortlist = shortlist
        self._concave_edges = concave_edges

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        candidates = paper_planes(component)
        valid = valid_planes(component, candidates)
        if not valid.any():
            return None
        best = best_planes(self._values(component), valid, self._shortlist)
        if len(best) == 1 and not self._concave_edges:
            return candidates.plane(int(best[0]))
        return least_hulls(component, candidates, best, self._concave_edges, threads)


def deployed(path: str, scale: float | None = None) -> QPolicy:
    """Deploy a network as the paper does; `path` is a file written by ``rlacd train``.

    `scale` is the criterion's length in the frame; the network's own by default.
    """
    network = load_network(path, KIND, FEATURES, PLANES)
    threshold = network.threshold if scale is None else scale
    return QPolicy(
        lambda c: network(sweep_features(c, threshold, bool(network.about.get("hull", True)))),
        SHORTLIST,
        EDGES_PER_COMPONENT,
    )


def best_planes(values: Float32Array, mask: NDArray[np.bool_], count: int) -> NDArray[np.intp]:
    """Indices of up to `count` valid planes of greatest value, greatest first; ties in index order."""
    order = np.argsort(-np.where(mask, values, -np.inf), kind="stable")
    kept: NDArray[np.intp] = order[: min(count, int(mask.sum()))]
    return kept
