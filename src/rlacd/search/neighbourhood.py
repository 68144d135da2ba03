"""Adaptive large-neighbourhood search over the parts of a decomposition.

A state is a set of parts, all of which meet the criterion. Three operators change it:

- recut: a cluster of neighbours, two of which have a joint hull that almost fits, is reunited into one solid and cut
  again; the pieces are merged with each other and with the parts around. Accepted if it leaves fewer parts, or equally
  many with a smaller total hull volume.
- transfer: a part gives pieces to the parts around it. Accepted even if it saves no part yet.
- redistribute: a part is divided among the parts around it and disappears.

Small clusters are quick to try; large ones allow very different cuts. Which operator, cluster size and ranking of
planes pays off depends on the shape, so the search adapts their weights to the gains so far.

Sources: P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998;
S. Ropke and D. Pisinger, "An Adaptive Large Neighborhood Search Heuristic for the Pickup and Delivery Problem with Time
Windows", 2006.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd._native import Stopped
from rlacd.clock import Clock
from rlacd.search.budget import SearchBudget
from rlacd.search.context import SearchContext
from rlacd.search.operators import BATCH, Operator, OperatorSampler, Trial, giving_away
from rlacd.search.part_graph import PartGraph
from rlacd.search.recut import Exchange, recut
from rlacd.search.redistribute import redistribute
from rlacd.search.transfer import transfer
from rlacd.solid.component import Part

DRY = 4
"""The search ends after this many batches in a row with nothing new to try."""

OPENING = 16
"""Steps before the first attempt to eliminate all parts: later recuts undo some of what elimination gains."""

SMALL = 0.5
"""Share of the parts, the smallest, that the search tries to eliminate first: nothing saves more parts per unit of
work."""

OPENING_SHARE = 4
"""The steps of the opening take at most one part in this many of the time left."""

TOO_LITTLE = 0.02
"""The search ends when less than this share of the allowed work is left."""

STEPS_PER_PART = 2
"""Steps per part between two attempts to eliminate all parts."""

PATIENCE = 24
"""By default, the search also ends after this many trials per part without a gain: transfer always finds something new
to try."""

LEAST_TRIALS = 32
"""But not before this many trials without a gain: where parts are few, trials cost little."""


@dataclass(frozen=True)
class SearchOutcome:
    """Result of a neighbourhood search.

    Attributes
    ----------
    parts : list of Part
        The best parts found.
    steps : int
        Trials made.
    accepted : int
        Trials accepted.
    exhausted : bool
        Nothing new was left to try, or no trial had saved a part for a long time.
    """

    parts: list[Part]
    steps: int
    accepted: int
    exhausted: bool

    def then(self, other: SearchOutcome) -> SearchOutcome:
        """Combine this outcome with that of a search that continued from it."""
        best = min(self.parts, other.parts, key=cost)
        return SearchOutcome(best, self.steps + other.steps, self.accepted + other.accepted, other.exhausted)


class Neighbourhood:
    """A decomposition that is being improved.

    Parameters
    ----------
    context : SearchContext
    parts : sequence of Part
        Made of components with disjoint interiors.
    patience : int
        The search is exhausted after this many trials per part without a gain.
    """

    def __init__(self, context: SearchContext, parts: Sequence[Part], patience: int = PATIENCE) -> None:
        self._context = context
        self._patience = patience
        self._policies = [ranking(context.near_sweeps) for ranking in context.rankings]
        self._random = np.random.default_rng(context.seed)
        self._graph = PartGraph(parts, context.criterion, context.workers)
        self._operators = OperatorSampler(len(context.rankings))
        self._best = list(parts)
        self._steps = self._accepted = self._dry = self._without_gain = 0
        self._near = min(context.criterion.screen.reach, 2 * context.criterion.overhang)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._graph.parts.values())

    def run(self, budget: SearchBudget, most: float = math.inf) -> SearchOutcome:
        """Search until nothing is left to try, the budget is used up, `most` steps are made or one part is left.

        It opens with a few steps followed by an attempt to eliminate every part. Eliminations do not count as steps.
        """
        exhausted = len(self._graph.parts) == 1
        try:
            if most > 0:
                self.redistribute_all(budget, SMALL)
                with budget.share(OPENING_SHARE):
                    self._walk(budget, min(most, OPENING))
                self.redistribute_all(budget)
            exhausted = len(self._graph.parts) == 1
            while not exhausted and self._steps < most and len(self._graph.parts) > 1 and not budget.is_over:
                exhausted = self._walk(budget, min(most, self._steps + STEPS_PER_PART * len(self._graph.parts)))
                self.redistribute_all(budget)
        except Stopped:  # raised between two exchanges: the best state so far is kept
            budget.note_stop()
        return SearchOutcome(self._best, self._steps, self._accepted, exhausted)

    def _walk(self, budget: SearchBudget, most: float) -> bool:
        """Make random trials until `most` steps are made in total; whether the search is exhausted."""
        graph = self._graph
        while self._dry < DRY and not self._gave_up and len(graph.parts) > 1:
            if not budget.step(self._steps, None, len(graph.parts)) or self._steps >= most:
                return False
            batch = self._affordable(list(self._operators.draw(graph, self._random, self._near)), budget)
            self._dry = 0 if batch else self._dry + 1
            # The batch is drawn in full and then shortened, so a search with more steps starts with the same trials.
            batch = batch[: int(min(BATCH, most - self._steps))]
            self._make(batch, budget)
            self._steps += len(batch)
            budget.steps += len(batch)
        return True

    @property
    def _gave_up(self) -> bool:
        return self._without_gain >= max(self._patience * len(self._graph.parts), LEAST_TRIALS)

    def redistribute_all(self, budget: SearchBudget, share: float = 1.0) -> None:
        """Try to eliminate each part, or the smallest share of them, smallest first."""
        graph = self._graph
        waiting = sorted(graph.parts, key=lambda i: (graph.parts[i].hull.volume, i))
        waiting = waiting[: math.ceil(share * len(waiting))]
        while (
            waiting and not self._gave_up and len(graph.parts) > 1 and budget.step(self._steps, None, len(graph.parts))
        ):
            batch, waiting = waiting[:BATCH], waiting[BATCH:]
            trials = [
                giving_away(Operator.REDISTRIBUTE, graph, i, self._random, self._near)
                for i in batch
                if i in graph.parts
            ]
            self._make(self._affordable([trial for trial in trials if self._operators.is_new(trial)], budget), budget)

    def _affordable(self, trials: list[Trial], budget: SearchBudget) -> list[Trial]:
        """The first trials, as many as the work left pays for, estimated from earlier trials of their kind."""
        if math.isinf(budget.work.left):
            return trials
        dearest = 0.0
        for count, trial in enumerate(trials, start=1):
            dearest = max(dearest, self._operators.price(trial))
            if count > 1 and count * dearest > budget.work.left:  # each trial gets an equal share
                return trials[: count - 1]
        return trials

    def _make(self, trials: Sequence[Trial], budget: SearchBudget) -> None:
        """Make trials of the same state in parallel, then apply the exchanges they found in order."""
        if not trials:
            return
        clocks = [budget.trial(budget.work.share(len(trials))) for _ in trials]
        found = self._context.workers.map(lambda pair: self._try(*pair), zip(trials, clocks, strict=True))
        for trial, clock, exchange in zip(trials, clocks, found, strict=True):
            budget.work.pay(clock.work.done)
            taken = exchange is not None and self._graph.apply(exchange)
            gain = exchange.gain if exchange is not None and taken else 0
            self._operators.count(trial, gain, clock.work.done)
            self._accepted += taken
            self._without_gain = 0 if gain > 0 else self._without_gain + 1
            if taken:
                self._best = min(self._best, self.parts, key=cost)
        budget.parts = min(budget.parts, len(self._graph.parts))
        budget.work.pay(self._graph.collect())
        if all(clock.work.is_spent for clock in clocks) or budget.work.left < TOO_LITTLE * budget.work.most < math.inf:
            budget.work.close()

    def _try(self, trial: Trial, clock: Clock) -> Exchange | None:
        criterion, root = self._context.criterion, self._context.root
        parts = self._graph.parts
        cluster = [parts[i] for i in trial.cluster]
        if trial.policy is not None:
            around = [parts[i] for i in self._graph.around(trial.cluster)]
            return recut(cluster, around, self._policies[trial.policy], criterion, clock, root)
        give = redistribute if trial.move is Operator.REDISTRIBUTE else transfer
        around = [parts[i] for i in trial.around]
        return give(cluster[0], around, criterion, np.random.default_rng(trial.seed), root, clock)


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
