"""Completing a component by a policy, and counting the parts after merging.

This is `CutTree` one component at a time, with every sweep and cut cached: rollouts from the same state share their
first steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from rlacd.clock import Clock
from rlacd.criteria import Concavity
from rlacd.cut import is_shaving
from rlacd.merge import merge_parts
from rlacd.planes.candidates import OFFSETS_PER_AXIS, Candidates
from rlacd.planes.sweep import SLIVER, Sweep, sweep
from rlacd.policies.features import DIRECTIONS, candidates_of
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Component
from rlacd.workers import Workers

Cost = Callable[[Component, Sweep], FloatArray]
"""A policy: the cost of every plane of a component's sweep; the valid plane of least cost is taken."""

COARSE = slice(1, None, 2)
"""Stride between the planes of a direction in rollouts: half the work, for a few percent more parts."""


class RolloutState:
    """A connected component that misses the criterion, with its cached sweeps and cuts.

    Planes are always numbered as in the full sweep: direction by direction, then those of the concave edges.
    """

    def __init__(self, component: Component, across: Component | None) -> None:
        self.component = component
        self.across = across
        self.outcomes: dict[int, RolloutOutcome] = {}
        self.chosen: int | None = None  # by the policy in a rollout; -1 if no plane is left

    @cached_property
    def candidates(self) -> Candidates:
        """All planes."""
        return candidates_of(self.component, OFFSETS_PER_AXIS)

    @cached_property
    def sweep(self) -> Sweep:
        """The sweep over all candidates."""
        return sweep(self.component, self.candidates)

    @cached_property
    def valid(self) -> BoolArray:
        """Planes that may be taken."""
        return valid_planes(self.sweep)

    def choose(self, cost: Cost) -> int:
        """Choose a plane by the full sweep; -1 if none is valid."""
        if not self.valid.any():
            return -1
        costs = cost(self.component, self.sweep)
        return int(np.argmin(np.where(self.valid, costs, np.inf)))

    def choose_coarsely(self, cost: Cost) -> int:
        """Choose by a sweep over every second plane of a direction."""
        grid = np.arange(DIRECTIONS * OFFSETS_PER_AXIS).reshape(DIRECTIONS, OFFSETS_PER_AXIS)[:, COARSE]
        numbers = np.concatenate([grid.reshape(-1), np.arange(DIRECTIONS * OFFSETS_PER_AXIS, len(self.candidates))])
        scored = sweep(
            self.component, Candidates(self.candidates.directions[numbers], self.candidates.offsets[numbers])
        )
        valid = valid_planes(scored)
        if not valid.any():
            return -1
        costs = cost(self.component, scored)
        return int(numbers[np.argmin(np.where(valid, costs, np.inf))])


def valid_planes(scored: Sweep) -> BoolArray:
    """Planes that may be taken; those that leave slivers only if there are no others."""
    valid = scored.valid(SLIVER)
    return valid if valid.any() else scored.valid(SLIVER / 100)


class RolloutOutcome:
    """Result of a step: parts that meet the criterion or cannot be cut, and states to continue from."""

    def __init__(self, done: list[Component], open_states: list[RolloutState]) -> None:
        self.done = done
        self.open = open_states


class Rollouts:
    """Rollouts of one solid under one criterion and policy.

    Parameters
    ----------
    criterion : Concavity
    cost : Cost
        The policy.

    Attributes
    ----------
    sweeps : int
        Number of sweeps so far: a measure of work that is the same on every machine.
    """

    def __init__(self, criterion: Concavity, cost: Cost) -> None:
        self.criterion = criterion
        self.sweeps = 0
        self._cost = cost
        self._workers = Workers(1)

    def settle(self, component: Component, across: Component | None = None) -> RolloutOutcome:
        """Evaluate a component and split it into connected pieces, as `CutTree` does."""
        if self.criterion.is_met(component):
            return RolloutOutcome([component], [])
        pieces = component.pieces()
        if len(pieces) == 1:
            return RolloutOutcome([], [RolloutState(component, across)])
        done: list[Component] = []
        states: list[RolloutState] = []
        for piece in pieces:
            if across is not None and is_shaving(piece, across):
                continue
            if self.criterion.is_met(piece):
                done.append(piece)
            else:
                states.append(RolloutState(piece, across))
        return RolloutOutcome(done, states)

    def cut(self, state: RolloutState, plane: int) -> RolloutOutcome:
        """Cut a state by a plane of its sweep; if the plane does not cut, the state becomes a part."""
        if plane not in state.outcomes:
            below, above = state.component.cut(state.candidates.plane(plane)) if plane >= 0 else (None, None)
            if below is None or above is None:
                outcome = RolloutOutcome([state.component], [])
            else:
                sides = [
                    self.settle(side, other)
                    for side, other in ((below, above), (above, below))
                    if not is_shaving(side, other)
                ]
                outcome = RolloutOutcome([p for o in sides for p in o.done], [s for o in sides for s in o.open])
            state.outcomes[plane] = outcome
        return state.outcomes[plane]

    def choice(self, state: RolloutState) -> int:
        """Get the policy's plane for a state in a rollout."""
        if state.chosen is None:
            self.sweeps += 1
            state.chosen = state.choose_coarsely(self._cost)
        return state.chosen

    def complete(self, start: RolloutOutcome, most: int) -> list[Component] | None:
        """Follow the policy until nothing is left to cut; None if it takes more than `most` parts."""
        parts = list(start.done)
        states = list(start.open)
        while states:
            if len(parts) + len(states) > most:
                return None
            state = states.pop()
            outcome = self.cut(state, self.choice(state))
            parts += outcome.done
            states += outcome.open
        return parts

    def merged(self, parts: Sequence[Component]) -> int:
        """Count the parts after merging."""
        return len(merge_parts(parts, self.criterion, self._workers, Clock()))
