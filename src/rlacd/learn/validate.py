"""How good a Q network is at what it is for: how many parts its cuts leave of solids it never learned on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch

from rlacd.clock import Clock
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.learn.encoders import Encoder, describe
from rlacd.learn.options import TrainOptions
from rlacd.learn.qnetwork import QNetwork
from rlacd.policies import Policy
from rlacd.policies.observe import Float32Array, Observation
from rlacd.policies.qpolicy import QPolicy
from rlacd.solid.component import Component
from rlacd.workers import Workers

MOST_PARTS = 64
"""A policy that makes more of one solid is stopped there: early in training some never end. Its counts are then too
small, not too large."""


@dataclass(frozen=True)
class Score:
    """Parts of each solid: after cutting, and after merging."""

    raw: list[int]
    merged: list[int]

    def against(self, other: Score) -> dict[str, float]:
        """Get this score's mean counts, and their geometric means relative to another policy's."""
        return {
            "parts": sum(self.raw) / len(self.raw),
            "merged": sum(self.merged) / len(self.merged),
            "parts_ratio": _mean_ratio(self.raw, other.raw),
            "merged_ratio": _mean_ratio(self.merged, other.merged),
        }


def count_parts(policy: Policy, solids: Sequence[Component], criterion: Concavity) -> Score:
    """Decompose solids and count, on one thread."""
    raw, merged = [], []
    with Workers(1) as workers:
        for solid in solids:
            done = cut_and_merge(CutTree(solid, policy, workers), criterion, workers, Clock(), most=MOST_PARTS)
            raw.append(len(done.pieces))
            merged.append(len(done.parts))
    return Score(raw, merged)


def torch_policy(network: QNetwork, encoder: Encoder, options: TrainOptions, **deployment: int) -> QPolicy:
    """Make a policy of the network as it is now; `deployment` is `QPolicy`'s shortlist and concave_edges."""
    device = next(network.parameters()).device

    def values(seen: Observation) -> Float32Array:
        features = torch.from_numpy(describe(encoder, [seen], options.scale_input)).to(device)
        with torch.inference_mode():
            q: Float32Array = network(features)[0].cpu().numpy()
        return q

    return QPolicy(values, options.threshold, options.points, **deployment)


def _mean_ratio(counts: Sequence[int], others: Sequence[int]) -> float:
    return math.exp(sum(math.log(max(a, 1) / max(b, 1)) for a, b in zip(counts, others, strict=True)) / len(counts))
