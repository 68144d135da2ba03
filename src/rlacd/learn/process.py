"""The decision process: a solid's unfinished components, the valid cuts, and the reward of each.

The components, planes, splitting and criterion are those of `rlacd.decompose` (see `rlacd.cut`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from rlacd.criteria import Criterion
from rlacd.cut import CutCache
from rlacd.learn.options import TrainOptions
from rlacd.planes.candidates import Candidates
from rlacd.planes.sweep import paper_planes, valid_planes
from rlacd.solid.component import Component, Plane


@dataclass(frozen=True)
class Reward:
    """The two terms of a cut's reward, unweighted.

    Attributes
    ----------
    saved : float
        Eq. 2: (|CH(m_i)| - the sum of |CH| over its pieces) / |CH(m)|, where m is the original solid.
    finished : float
        Eq. 3: 1 / (1 + log(|M'| - 1)) if this cut leaves every component of the solid finished, else 0.
    """

    saved: float
    finished: float

    def worth(self, options: TrainOptions) -> float:
        """r = lambda_1 r_1 + lambda_2 r_2."""
        return options.volume_reward * self.saved + options.finish_reward * self.finished


@dataclass(eq=False)
class CutResult:
    """Components sorted by status.

    Attributes
    ----------
    unfinished : list of Component
        Connected components that miss the criterion and have a valid plane left: they join the frontier.
    finished : list of Component
        Components that meet the criterion.
    stuck : list of Component
        Components that miss the criterion and have no valid plane left.
    """

    unfinished: list[Component] = field(default_factory=list)
    finished: list[Component] = field(default_factory=list)
    stuck: list[Component] = field(default_factory=list)

    @property
    def all(self) -> list[Component]:
        """All components."""
        return self.unfinished + self.finished + self.stuck


@dataclass(eq=False, kw_only=True)
class Cut(CutResult):
    """Outcome of a cut.

    Attributes
    ----------
    reward : Reward
    discounts : list of float
        Eq. 9 for each unfinished component: |CH(child)| / |CH(component)|; their sum is at most 1.
    made : bool
        False if the plane left nothing, or only a sliver, on one side: the component is then `stuck`.
    """

    reward: Reward
    discounts: list[float]
    made: bool


def terminal_reward(parts: int) -> float:
    """Eq. 3 of a decomposition into `parts` >= 1 finished components: 1 / (1 + log(parts - 1)), at most 1."""
    return 1 / (1 + math.log(max(parts - 1, 1)))


class Memory:
    """Cuts, candidates, verdicts and features of components seen before: episodes of the same solid share them."""

    def __init__(self) -> None:
        self.cache = CutCache()
        self.candidates: dict[Component, Candidates] = {}
        self.met: dict[Component, bool] = {}
        self.features: dict[Component, Any] = {}


class CutProcess:
    """The decision process of one solid.

    The state is the *frontier*, the connected components that miss the criterion, and the parts finished so far. Every
    unfinished component has to be cut eventually, and its cuts do not depend on the other components, so the order is
    no part of the process.

    Parameters
    ----------
    solid : Component
    criterion : Criterion
        Decides when a component is finished.
    memory : Memory, optional
        That of earlier episodes with the same `solid` and criterion; affects only the time taken.
    """

    def __init__(self, solid: Component, criterion: Criterion, memory: Memory | None = None) -> None:
        self._criterion = criterion
        self.memory = memory or Memory()
        self._hull_volume = solid.hull.volume
        settled = self._settle(solid)
        self.frontier: list[Component] = settled.unfinished
        self.finished: list[Component] = settled.finished
        self.stuck: list[Component] = settled.stuck

    @property
    def count(self) -> int:
        """Number of all components, |M|."""
        return len(self.frontier) + len(self.finished) + len(self.stuck)

    @property
    def over(self) -> bool:
        """True if nothing is left to cut."""
        return not self.frontier

    @property
    def terminal(self) -> bool:
        """True if every component meets the criterion."""
        return not self.frontier and not self.stuck

    def candidates(self, component: Component) -> Candidates:
        """Get the candidate planes of a component of the frontier."""
        known = self.memory.candidates
        if component not in known:
            known[component] = paper_planes(component)
        return known[component]

    def largest(self) -> int:
        """Index in the frontier of the component with the largest hull, so that coarse cuts come first."""
        return max(range(len(self.frontier)), key=lambda i: self.frontier[i].hull.volume)

    def cut(self, index: int, plane: Plane) -> Cut:
        """Cut component `index` of the frontier by a plane."""
        cut = self.outcome(self.frontier[index], plane)
        self.frontier.pop(index)
        self.frontier += cut.unfinished
        self.finished += cut.finished
        self.stuck += cut.stuck
        return cut

    def outcome(self, component: Component, plane: Plane) -> Cut:
        """Work out what cutting a component of the frontier by a plane would leave and earn."""
        sides = self.memory.cache.sides(component, plane)
        made = bool(sides)
        settled = _together([self._settle(side) for side in sides]) if made else CutResult(stuck=[component])
        own, children = component.hull.volume, [child.hull.volume for child in settled.all] if made else []
        all_finished = len(settled.finished) == len(settled.all)
        last = all_finished and len(self.frontier) == 1 and not self.stuck
        reward = Reward(
            saved=(own - sum(children)) / self._hull_volume if made else 0.0,
            finished=terminal_reward(len(self.finished) + len(settled.finished)) if last else 0.0,
        )
        # Hulls of connected pieces may overlap (two links of a chain, say); discounts must not add up to more than 1.
        whole = max(own, sum(children))
        discounts = [child.hull.volume / whole for child in settled.unfinished]
        return Cut(**vars(settled), reward=reward, discounts=discounts, made=made)

    def _settle(self, component: Component) -> CutResult:
        """Evaluate a component, split it if it has to be cut, and evaluate its pieces."""
        met = self.memory.met
        if component not in met:
            met[component] = self._criterion.is_met(component)
        if met[component]:
            return CutResult(finished=[component])
        pieces = self.memory.cache.pieces(component)
        if pieces != [component]:
            return _together([self._settle(piece) for piece in pieces])
        if valid_planes(component, self.candidates(component)).any():
            return CutResult(unfinished=[component])
        return CutResult(stuck=[component])


def _together(all_settled: Sequence[CutResult]) -> CutResult:
    return CutResult(
        [c for settled in all_settled for c in settled.unfinished],
        [c for settled in all_settled for c in settled.finished],
        [c for settled in all_settled for c in settled.stuck],
    )
