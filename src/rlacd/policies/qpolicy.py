"""Choosing a plane by a Q network: the best of the 150 planes, or by the paper's deployment rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rlacd.policies.navacd import CONCAVE_EDGES
from rlacd.policies.observe import Float32Array, Observation, candidates_of, observe
from rlacd.policies.shortlist import least_hulls
from rlacd.solid.component import Component, Plane

if TYPE_CHECKING:
    from rlacd.policies.q_network import OnnxQ  # onnxruntime takes a while to import

SHORTLIST = 10
"""Number of planes of greatest value from which the paper takes the one with the least sum of hull volumes."""

QFunction = Callable[[Observation], Float32Array]
"""Values [150] of the planes of an observed component."""


class QPolicy:
    """Takes the plane of greatest value, or the one with the least hull sum among the best (the paper's deployment).

    Parameters
    ----------
    values : callable
        The Q network, in torch (`rlacd.learn.paper.torch_policy`) or exported (`rlacd.policies.q_network.OnnxQ`).
    threshold : float
        The criterion's threshold.
    points : int
        Number of points on each of the two surfaces.
    shortlist : int
        Number of best planes from which the one with the least sum of hull volumes is taken (paper: 10).
    concave_edges : int
        Number of concave edges whose planes join the shortlist (paper: 4, three planes each).
    """

    def __init__(
        self, values: QFunction, threshold: float, points: int = 2048, shortlist: int = 1, concave_edges: int = 0
    ) -> None:
        self._values = values
        self._threshold = threshold
        self._points = points
        self._shortlist = shortlist
        self._concave_edges = concave_edges

    @classmethod
    def deployed(cls, network: OnnxQ, scale: float | None = None) -> QPolicy:
        """Use an exported network as the paper does; `scale` is the criterion's length, if it has one."""
        threshold = network.threshold if scale is None else scale
        return cls(network, threshold, network.points, SHORTLIST, CONCAVE_EDGES)

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        candidates = candidates_of(component)
        seen = observe(component, candidates, self._threshold, self._points)
        if not seen.mask.any():
            return None
        best = best_planes(self._values(seen), seen.mask, self._shortlist)
        if len(best) == 1 and not self._concave_edges:
            return candidates.plane(int(best[0]))
        return least_hulls(component, candidates, best, self._concave_edges, threads)


def best_planes(values: Float32Array, mask: NDArray[np.bool_], count: int) -> NDArray[np.intp]:
    """Indices of up to `count` valid planes of greatest value, greatest first; ties in index order."""
    order = np.argsort(-np.where(mask, values, -np.inf), kind="stable")
    kept: NDArray[np.intp] = order[: min(count, int(mask.sum()))]
    return kept
