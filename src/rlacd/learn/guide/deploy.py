"""Judging a policy by what users get: parts after merging, on meshes it has not learned from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold

from rlacd.clock import Clock
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.policies import Policy
from rlacd.solid.component import Component
from rlacd.workers import Workers


@dataclass(frozen=True)
class Count:
    """Parts of one decomposition, before and after merging."""

    raw: int
    merged: int


def deploy(policy: Policy, solids: Sequence[Manifold], threshold: float) -> list[Count]:
    """Decompose solids by a policy, cutting and merging as `rlacd.decompose` does."""
    counts = []
    with Workers(1) as workers:
        for solid in solids:
            tree = CutTree(Component(solid), policy, workers)
            done = cut_and_merge(tree, Concavity(threshold), workers, Clock())
            counts.append(Count(len(done.pieces), len(done.parts)))
    return counts


def ratio(counts: Sequence[Count], baseline: Sequence[Count]) -> float:
    """Get the geometric mean of the ratios of merged parts, over solids that the baseline cuts at all."""
    logs = [np.log(c.merged / b.merged) for c, b in zip(counts, baseline, strict=True) if b.merged > 1]
    return float(np.exp(np.mean(logs))) if logs else 1.0
