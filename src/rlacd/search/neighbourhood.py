"""Large-neighbourhood search: a few neighbouring parts are reunited and cut differently, again and again.

A state is the parts so far, all of them meeting the criterion. A trial takes a cluster of neighbours, two of which have
a joint hull that fits almost, reunites what they are made of into one solid, cuts that anew, and merges the pieces with
each other and with the parts around. It is accepted when fewer parts are left, or as many with less volume in their
hulls. Or a part gives pieces of itself to those around, which is taken over even if no part is saved yet. Small
clusters are quick to try, large ones can be cut in quite another way; which of them, or giving, and which ranking of
planes, is worth its time depends on the shape, so that is learned on the way. (P. Shaw, "Using Constraint Programming
and Local Search Methods to Solve Vehicle Routing Problems", CP 1998, and S. Ropke and D. Pisinger, "An Adaptive Large
Neighborhood Search Heuristic for the Pickup and Delivery Problem with Time Windows", 2006, are where the ideas come
from.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.planes.views import Views
from rlacd.search.neighbours import Neighbours
from rlacd.search.pace import Pace
from rlacd.search.rankings import Ranking
from rlacd.search.recut import Exchange, recut
from rlacd.search.shift import shift
from rlacd.search.ways import BATCH, Trial, Ways
from rlacd.solid.component import Component, Part
from rlacd.workers import Workers

DRY = 4
"""The search ends when so many batches in a row found nothing new to try."""

PATIENCE = 16
"""It ends, too, after so many trials a part that saved none: giving pieces away finds something new to try for ever."""


@dataclass(frozen=True)
class Outcome:
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
        views: Views,
        workers: Workers,
        seed: int,
    ) -> None:
        self._root = root
        self._criterion = criterion
        self._policies = [ranking(views) for ranking in rankings]
        self._workers = workers
        self._random = np.random.default_rng(seed)
        self._here = Neighbours(parts, criterion, workers)
        self._ways = Ways(len(rankings))
        self._best = list(parts)
        self._near = min(criterion.reach, 2 * criterion.overhang)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._here.parts.values())

    def run(self, pace: Pace, most: float = math.inf, enough: int = 1) -> Outcome:
        """Try until there is no hope left, the clock says no, `most` trials are made or `enough` parts are left."""
        steps = accepted = dry = vain = 0
        here = self._here
        exhausted = len(here.parts) == 1
        while pace.step(steps, None, len(here.parts)) and steps < most and len(here.parts) > enough and not exhausted:
            batch = list(self._ways.draw(here, self._random, self._near))
            dry = 0 if batch else dry + 1
            batch = batch[: int(min(BATCH, most - steps))]  # drawn in full, so that more steps begin with the same
            found = self._workers.map(lambda trial: self._try(trial, pace), batch)
            for trial, exchange in zip(batch, found, strict=True):
                taken = exchange is not None and here.apply(exchange)
                self._ways.count(trial, exchange.gain if exchange is not None and taken else 0)
                steps += 1
                accepted += taken
                vain = 0 if exchange is not None and taken and exchange.gain > 0 else vain + 1
                self._best = min(self._best, self.parts, key=cost)
            pace.steps += len(batch)
            pace.parts = min(pace.parts, len(here.parts))
            exhausted = dry == DRY or vain >= PATIENCE * len(here.parts) or len(here.parts) == 1
        return Outcome(self._best, steps, accepted, exhausted)

    def _try(self, trial: Trial, pace: Pace) -> Exchange | None:
        parts = self._here.parts
        cluster = [parts[i] for i in trial.cluster]
        if trial.policy is None:
            around = [parts[i] for i in trial.around]
            return shift(cluster[0], around, self._criterion, np.random.default_rng(trial.seed), self._root, pace.left)
        around = [parts[i] for i in self._here.around(trial.cluster)]
        return recut(cluster, around, self._policies[trial.policy], self._criterion, pace.left, self._root)


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """How many parts there are, and the volume of their hulls: the less, the better they fit."""
    return len(parts), sum(part.hull.volume for part in parts)
