"""Large-neighbourhood search: a few neighbouring parts are reunited and cut differently, again and again.

A state is the parts so far, all of them meeting the criterion. A trial takes a cluster of neighbours, two of which have
a joint hull that fits almost, reunites what they are made of into one solid, cuts that anew, and merges the pieces with
each other and with the parts around. It is accepted when fewer parts are left, or as many with less volume in their
hulls. Or a part gives pieces of itself to those around, which is taken over even if no part is saved yet, or it is
divided among them altogether. Small clusters are quick to try, large ones can be cut in quite another way; which of
them, or giving, and which ranking of planes, is worth its time depends on the shape, so that is learned on the way.
(P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998, and S.
Ropke and D. Pisinger, "An Adaptive Large Neighborhood Search Heuristic for the Pickup and Delivery Problem with Time
Windows", 2006, are where the ideas come from.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd._native import Stopped
from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.planes.sweep_cache import SweepCache
from rlacd.search.budget import SearchBudget
from rlacd.search.operators import BATCH, Operator, OperatorSampler, Trial, giving_away
from rlacd.search.part_graph import PartGraph
from rlacd.search.rankings import Ranking
from rlacd.search.recut import Exchange, recut
from rlacd.search.redistribute import redistribute
from rlacd.search.transfer import transfer
from rlacd.solid.component import Component, Part
from rlacd.workers import Workers

DRY = 4
"""The search ends when so many batches in a row found nothing new to try."""

OPENING = 16
"""So many steps are made before parts are tried to be done without: what is cut anew later undoes some of that."""

SMALL = 0.5
"""The smaller half of the parts is tried before that: per unit of work, nothing saves more parts."""

OPENING_SHARE = 4
"""They take no more than this fraction of the time: a quarter."""

TOO_LITTLE = 0.02
"""Less than this share of the work allowed is not worth another batch."""

STEPS_PER_PART = 2
"""After so many steps a part each of them is tried again."""

PATIENCE = 24
"""It ends, too, after so many trials a part that saved none: giving pieces away finds something new to try for ever."""


@dataclass(frozen=True)
class SearchOutcome:
    """What a search has done.

    Attributes
    ----------
    parts : list of Part
    steps : int
        Trials made.
    accepted : int
        Trials that were taken over.
    exhausted : bool
        There was nothing left to try, or it had been in vain for long.
    """

    parts: list[Part]
    steps: int
    accepted: int
    exhausted: bool

    def then(self, other: SearchOutcome) -> SearchOutcome:
        """Get what this search and another that went on from it have done."""
        best = min(self.parts, other.parts, key=cost)
        return SearchOutcome(best, self.steps + other.steps, self.accepted + other.accepted, other.exhausted)


class Neighbourhood:
    """Parts that are being improved.

    Parameters
    ----------
    root : Component
        The solid.
    parts : sequence of Part
        Made of components with disjoint interiors; all that meet the criterion stay so.
    criterion : Criterion
    rankings : sequence of Ranking
        Who ranks planes; those that turn out well are asked more often.
    views : Views
        Where sweeps come from.
    workers : Workers
    seed : int
    """

    def __init__(
        self,
        root: Component,
        parts: Sequence[Part],
        criterion: Criterion,
        rankings: Sequence[Ranking],
        sweeps: SweepCache,
        workers: Workers,
        seed: int,
    ) -> None:
        self._root = root
        self._criterion = criterion
        self._policies = [ranking(sweeps) for ranking in rankings]
        self._workers = workers
        self._random = np.random.default_rng(seed)
        self._graph = PartGraph(parts, criterion, workers)
        self._operators = OperatorSampler(len(rankings))
        self._best = list(parts)
        self._steps = self._accepted = self._dry = self._vain = 0
        self._near = min(criterion.reach, 2 * criterion.overhang)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._graph.parts.values())

    def run(self, budget: SearchBudget, most: float = math.inf, enough: int = 1) -> SearchOutcome:
        """Search until there is no hope left, the clock says no, `most` steps are made or `enough` parts are left.

        An opening comes first: a few steps, then every part is tried to be done without. Such rounds are no steps.
        """
        exhausted = len(self._graph.parts) == 1
        try:
            if most > 0:
                self.redistribute_all(budget, enough, SMALL)
                with budget.share(OPENING_SHARE):
                    self._walk(budget, min(most, OPENING), enough)
                self.redistribute_all(budget, enough)
            exhausted = len(self._graph.parts) == 1
            while not exhausted and self._steps < most and len(self._graph.parts) > enough and not budget.is_over:
                exhausted = self._walk(budget, min(most, self._steps + STEPS_PER_PART * len(self._graph.parts)), enough)
                self.redistribute_all(budget, enough)
        except Stopped:  # between two exchanges: the best so far stays
            budget.note_stop()
        return SearchOutcome(self._best, self._steps, self._accepted, exhausted)

    def _walk(self, budget: SearchBudget, most: float, enough: int) -> bool:
        """Try at random until `most` steps are made in all; whether there is no hope left."""
        graph = self._graph
        while self._dry < DRY and self._vain < PATIENCE * len(graph.parts) and len(graph.parts) > 1:
            if (
                not budget.step(self._steps, None, len(graph.parts))
                or self._steps >= most
                or len(graph.parts) <= enough
            ):
                return False
            batch = self._affordable(list(self._operators.draw(graph, self._random, self._near)), budget)
            self._dry = 0 if batch else self._dry + 1
            batch = batch[: int(min(BATCH, most - self._steps))]  # drawn in full: more steps begin with the same
            self._make(batch, budget)
            self._steps += len(batch)
            budget.steps += len(batch)
        return True

    def redistribute_all(self, budget: SearchBudget, enough: int = 1, share: float = 1.0) -> None:
        """Try to do without each part, or a share of them, the smallest first, while there are more than `enough`."""
        graph = self._graph
        waiting = sorted(graph.parts, key=lambda i: (graph.parts[i].hull.volume, i))
        waiting = waiting[: math.ceil(share * len(waiting))]
        while waiting and len(graph.parts) > enough and budget.step(self._steps, None, len(graph.parts)):
            batch, waiting = waiting[:BATCH], waiting[BATCH:]
            trials = [
                giving_away(Operator.REDISTRIBUTE, graph, i, self._random, self._near)
                for i in batch
                if i in graph.parts
            ]
            self._make(self._affordable([trial for trial in trials if self._operators.is_new(trial)], budget), budget)

    def _affordable(self, trials: list[Trial], budget: SearchBudget) -> list[Trial]:
        """As many of the trials as there is work left for, by what others of their kind took."""
        if math.isinf(budget.work.left):
            return trials
        dearest = 0.0
        for count, trial in enumerate(trials, start=1):
            dearest = max(dearest, self._operators.price(trial))
            if count > 1 and count * dearest > budget.work.left:  # each is given an equal share
                return trials[: count - 1]
        return trials

    def _make(self, trials: Sequence[Trial], budget: SearchBudget) -> None:
        """Make trials side by side, and take over what is better."""
        if not trials:
            return
        clocks = [budget.trial(budget.work.share(len(trials))) for _ in trials]
        found = self._workers.map(lambda pair: self._try(*pair), zip(trials, clocks, strict=True))
        for trial, clock, exchange in zip(trials, clocks, found, strict=True):
            budget.work.pay(clock.work.done)
            taken = exchange is not None and self._graph.apply(exchange)
            gain = exchange.gain if exchange is not None and taken else 0
            self._operators.count(trial, gain, clock.work.done)
            self._accepted += taken
            self._vain = 0 if gain > 0 else self._vain + 1
            self._best = min(self._best, self.parts, key=cost)
        budget.parts = min(budget.parts, len(self._graph.parts))
        budget.work.pay(self._graph.collect())
        if all(clock.work.is_spent for clock in clocks) or budget.work.left < TOO_LITTLE * budget.work.most < math.inf:
            budget.work.close()

    def _try(self, trial: Trial, clock: Clock) -> Exchange | None:
        parts = self._graph.parts
        cluster = [parts[i] for i in trial.cluster]
        if trial.policy is not None:
            around = [parts[i] for i in self._graph.around(trial.cluster)]
            return recut(cluster, around, self._policies[trial.policy], self._criterion, clock, self._root)
        give = redistribute if trial.move is Operator.REDISTRIBUTE else transfer
        around = [parts[i] for i in trial.around]
        return give(cluster[0], around, self._criterion, np.random.default_rng(trial.seed), self._root, clock)


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """How many parts there are, and the volume of their hulls: the less, the better they fit."""
    return len(parts), sum(part.hull.volume for part in parts)
