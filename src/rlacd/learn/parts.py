"""The measure of a policy: how many parts its cuts leave of held-out solids."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.policies import Policy
from rlacd.run import Run
from rlacd.solid.component import Component


def count_parts(policy: Policy, solids: Sequence[Component], criterion: Concavity, most: float = math.inf) -> list[int]:
    """Cut solids and count their parts, without merging, on one thread.

    Parameters
    ----------
    policy : Policy
    solids : sequence of Component
    criterion : Concavity
    most : float
        Number of parts at which a decomposition is stopped, since some never end. The counts are then too small, not
        too large.
    """
    with Run(1) as run:
        return [
            len(cut_and_merge(CutTree(solid, policy, run), criterion, run, merge=False, most=most).pieces)
            for solid in solids
        ]


def mean_ratio(counts: Sequence[int], others: Sequence[int]) -> float:
    """Get the geometric mean of the ratios; a count of 0 is taken as 1, and without solids the result is 1."""
    logs = [math.log(max(a, 1) / max(b, 1)) for a, b in zip(counts, others, strict=True)]
    return math.exp(sum(logs) / len(logs)) if logs else 1.0
