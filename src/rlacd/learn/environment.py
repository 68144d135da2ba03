"""The environment (the paper's 3.1): components, valid cuts, rewards. Splitting and criterion are `rlacd.cut`'s."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from rlacd.criteria import Criterion
from rlacd.learn.options import TrainOptions
from rlacd.planes.candidates import Candidates
from rlacd.planes.sweep import paper_planes, valid_planes
from rlacd.solid.component import Component, Plane


@dataclass(eq=False)
class Settled:
    """Components by status: those that miss the criterion are *unfinished*, or *stuck* if no valid plane is left."""

    unfinished: list[Component] = field(default_factory=list)
    finished: list[Component] = field(default_factory=list)
    stuck: list[Component] = field(default_factory=list)

    @property
    def all(self) -> list[Component]:
        """Get all of them."""
        return self.unfinished + self.finished + self.stuck


@dataclass(frozen=True, eq=False)
class Step:
    """Outcome of a cut."""

    left: Settled
    """The pieces; the component itself, stuck, if the plane left nothing, or only a sliver, on one side."""
    saved: float
    """r_1 (eq. 2): (|CH(m_i)| - the sum of |CH| over its pieces) / |CH(m)|, where m is the original solid."""
    finishes: float
    """r_2 (eq. 3): 1 / (1 + log(|M'| - 1)) if this cut leaves every component of the solid finished, else 0."""
    discounts: list[float]
    """Eq. 9 for each unfinished component: |CH(child)| / |CH(component)|; their sum is at most 1."""

    def reward(self, options: TrainOptions) -> float:
        """r = lambda_1 r_1 + lambda_2 r_2."""
        return options.volume_reward * self.saved + options.finish_reward * self.finishes


def terminal_reward(parts: int) -> float:
    """Eq. 3 of a decomposition into `parts` >= 1 finished components: 1 / (1 + log(parts - 1)), at most 1."""
    return 1 / (1 + math.log(max(parts - 1, 1)))


class CutCache:
    """Pieces and sides of components, computed once for all episodes: they share their first cuts."""

    def __init__(self) -> None:
        self._pieces: dict[Component, list[Component]] = {}
        self._sides: dict[tuple[Component, Plane], list[Component]] = {}

    def pieces(self, component: Component) -> list[Component]:
        """Get the connected pieces of a component; ``[component]`` if it is connected."""
        if component not in self._pieces:
            pieces = component.pieces()
            self._pieces[component] = pieces if len(pieces) > 1 else [component]
        return self._pieces[component]

    def sides(self, component: Component, plane: Plane) -> list[Component]:
        """Get the sides below and above a plane; an empty list if one side would be empty."""
        key = component, plane
        if key not in self._sides:
            below, above = component.cut(plane)
            self._sides[key] = [] if below is None or above is None else [below, above]
        return self._sides[key]


class Memory:
    """Cuts, candidates, verdicts and features of components seen before: episodes of the same solid share them."""

    def __init__(self) -> None:
        self.cache = CutCache()
        self.candidates: dict[Component, Candidates] = {}
        self.met: dict[Component, bool] = {}
        self.features: dict[Component, Any] = {}


class CutEnv(Settled):
    """The decision process of one solid; `reset` and `step` are those of Gymnasium, with components for observations.

    Components are connected, and finished when they meet the criterion. Every unfinished one has to be cut eventually,
    and its cuts do not depend on the others, so the order matters for r_2 alone. `memory` is that of earlier episodes
    with the same solid and criterion; it affects only the time taken.
    """

    def __init__(self, solid: Component, criterion: Criterion, memory: Memory | None = None) -> None:
        super().__init__()
        self._criterion, self.memory = criterion, memory or Memory()
        self._solid, self._hull_volume = solid, solid.hull.volume
        self.reset()

    def reset(self) -> list[Component]:
        """Begin again with the whole solid; returns its unfinished components."""
        self.unfinished, self.finished, self.stuck = [], [], []
        self._settle(self._solid, self)
        return self.unfinished

    @property
    def terminal(self) -> bool:
        """True if every component meets the criterion."""
        return not self.unfinished and not self.stuck

    def candidates(self, component: Component) -> Candidates:
        """Get the candidate planes of an unfinished component."""
        known = self.memory.candidates
        if component not in known:
            known[component] = paper_planes(component)
        return known[component]

    def excess(self, component: Component) -> float:
        """Most that r_1 can still earn from a component on: (|CH(m_i)| - |m_i|) / |CH(m)|."""
        return max(component.hull.volume - component.volume, 0.0) / self._hull_volume

    def largest(self) -> Component:
        """The unfinished component with the largest hull, which the policy cuts first."""
        return max(self.unfinished, key=lambda component: component.hull.volume)

    def step(self, component: Component, plane: Plane) -> Step:
        """Cut an unfinished component by a plane."""
        self.unfinished.remove(component)
        sides, left = self.memory.cache.sides(component, plane), Settled()
        for side in sides:
            self._settle(side, left)
        own = component.hull.volume
        hulls = sum(child.hull.volume for child in left.all)
        if not sides:
            left, hulls = Settled(stuck=[component]), own
        self.unfinished += left.unfinished
        self.finished += left.finished
        self.stuck += left.stuck
        # Hulls of connected pieces may overlap (two links of a chain, say); discounts must not add up to more than 1.
        discounts = [child.hull.volume / max(own, hulls) for child in left.unfinished]
        finishes = terminal_reward(len(self.finished)) if self.terminal else 0.0
        return Step(left, (own - hulls) / self._hull_volume, finishes, discounts)

    def _settle(self, component: Component, into: Settled) -> None:
        """Evaluate a component, split it if it has to be cut, and evaluate its pieces."""
        met = self.memory.met
        if component not in met:
            met[component] = self._criterion.is_met(component)
        if met[component]:
            into.finished.append(component)
        elif (pieces := self.memory.cache.pieces(component)) != [component]:
            for piece in pieces:
                self._settle(piece, into)
        elif valid_planes(component, self.candidates(component)).any():
            into.unfinished.append(component)
        else:
            into.stuck.append(component)
