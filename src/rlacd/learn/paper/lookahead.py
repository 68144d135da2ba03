"""Lookahead: a few planes are cut for real, and the network values what they leave."""

from __future__ import annotations

import numpy as np
import torch

from rlacd.criteria import Concavity
from rlacd.learn.encoders import Encoder, describe
from rlacd.learn.paper.mdp import CutProcess
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.planes.least_excess import SLIVERS
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies.greedy import hull_sum
from rlacd.policies.observe import observe
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane


class Lookahead:
    """Takes the plane whose sides have the greatest values, among a few of least hull sum.

    Parameters
    ----------
    network : QNetwork
        Values components.
    encoder : Encoder
    options : TrainOptions
    """

    def __init__(self, network: QNetwork, encoder: Encoder, options: TrainOptions) -> None:
        self._network, self._encoder, self._options = network, encoder, options

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if no candidate is valid."""
        planes = promising(component, self._options.lookahead, threads)
        if len(planes) < 2:
            return planes[0] if planes else None
        cutting = CutProcess(component, Concavity(self._options.threshold))
        return planes[int(self.values(cutting, component, planes).argmax())]

    def values(self, cutting: CutProcess, component: Component, planes: list[Plane]) -> FloatArray:
        """Values [N] of planes, eq. 8: their reward and the discounted values of what they leave; -inf if they miss."""
        options = self._options
        cuts = [cutting.outcome(component, plane) for plane in planes]
        left = [(n, *child) for n, cut in enumerate(cuts) for child in zip(cut.unfinished, cut.discounts, strict=True)]
        total = np.array([cut.reward.worth(options) if cut.made else -np.inf for cut in cuts])
        if left:
            seen = [observe(c, cutting.candidates(c), options.threshold, options.points) for _, c, _ in left]
            features = torch.from_numpy(describe(self._encoder, seen, options.scale_input))
            with torch.inference_mode():
                worth = self._network(features.to(next(self._network.parameters()).device))[:, 0].double().cpu().numpy()
            shares = np.array([share for _, _, share in left])
            discounts = shares if options.discount == "hull" else options.static_discount
            np.add.at(total, [n for n, _, _ in left], discounts * worth)
        return total


def promising(component: Component, count: int, threads: int = 1) -> list[Plane]:
    """Up to `count` valid planes of least hull sum, of the 150 and those of concave edges; no two are neighbours."""
    scored = SweepCache().of(component, threads)
    cost = hull_sum(scored)
    valid = next((v for sliver in SLIVERS if (v := scored.valid(sliver)).any()), np.zeros(len(cost), dtype=np.bool_))
    kept: list[int] = []
    for plane in np.argsort(np.where(valid, cost, np.inf), kind="stable")[: int(valid.sum())].tolist():
        if len(kept) == count:
            break
        if all(abs(plane - other) > 1 for other in kept):
            kept.append(plane)
    return [scored.candidates.plane(plane) for plane in kept]
