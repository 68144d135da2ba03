"""Large-neighbourhood search: a few neighbouring parts are reunited and cut differently, again and again.

A state is the parts so far, all of them meeting the criterion. A trial takes a cluster of neighbours, two of which have
a joint hull that fits almost, reunites what they are made of into one solid, cuts that anew, and merges the pieces with
each other and with the parts around. It is accepted when fewer parts are left, or as many with less volume in their
hulls. Small clusters are quick to try, large ones can be cut in quite another way; which of them, and which ranking of
planes, is worth its time depends on the shape, so that is learned on the way. (P. Shaw, "Using Constraint Programming
and Local Search Methods to Solve Vehicle Routing Problems", CP 1998, and S. Ropke and D. Pisinger, "An Adaptive Large
Neighborhood Search Heuristic for the Pickup and Delivery Problem with Time Windows", 2006, are where the ideas come
from.)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.planes.views import Views
from rlacd.search.neighbours import Cluster, Neighbours
from rlacd.search.pace import Pace
from rlacd.search.rankings import Ranked, Ranking
from rlacd.search.recut import Exchange, recut
from rlacd.search.shift import shift
from rlacd.solid.component import Component, Part
from rlacd.workers import Workers

SIZES = (3, 4, 5, 6, 8)
"""So many parts are cut anew together: two seldom become one, and more take too long."""

BATCH = 8
"""Trials made of one state at a time; the same whatever the number of threads, so that the result is too."""

AS_LONG_AS = 3
"""A part that gives pieces away takes about as long as a cluster of so many that is cut anew."""

REPEATS = 4
"""So often a part may try to give pieces to the same others, each time drawing anew to whom and in which direction."""

DRAWS = 10
"""A way of trying is left for this batch when so many draws in a row gave nothing new."""

DRY = 4
"""The search ends when so many batches in a row found nothing new to try."""


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
        There was nothing left to try.
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
        self._policies = [Ranked(ranking, views) for ranking in rankings]
        self._workers = workers
        self._random = np.random.default_rng(seed)
        self._here = Neighbours(parts, criterion, workers)
        self._ways = _Ways(len(rankings))
        self._best = list(parts)
        self._near = min(criterion.reach, 2 * criterion.overhang)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._here.parts.values())

    def run(self, pace: Pace, most: float = math.inf, enough: int = 1) -> Outcome:
        """Try until nothing is left to try, the clock says no, `most` trials are made or `enough` parts are left."""
        steps = accepted = dry = 0
        here = self._here
        while pace.step(steps, None, len(here.parts)) and steps < most and len(here.parts) > enough and dry < DRY:
            batch = list(self._ways.draw(here, self._random, self._near))
            dry = 0 if batch else dry + 1
            batch = batch[: int(min(BATCH, most - steps))]  # drawn in full, so that more steps begin with the same
            found = self._workers.map(lambda trial: self._try(trial, pace), batch)
            for trial, exchange in zip(batch, found, strict=True):
                taken = exchange is not None and here.apply(exchange)
                self._ways.count(trial, exchange.gain if exchange is not None and taken else 0)
                steps += 1
                accepted += taken
            self._best = min(self._best, self.parts, key=cost)
            pace.steps += len(batch)
            pace.parts = min(pace.parts, len(here.parts))
        return Outcome(self._best, steps, accepted, dry == DRY or len(here.parts) == 1)

    def _try(self, trial: _Trial, pace: Pace) -> Exchange | None:
        parts = self._here.parts
        cluster = [parts[i] for i in trial.cluster]
        if trial.policy is None:
            around = [parts[i] for i in trial.around]
            return shift(cluster[0], around, self._criterion, np.random.default_rng(trial.seed), self._root)
        around = [parts[i] for i in self._here.around(trial.cluster)]
        return recut(cluster, around, self._policies[trial.policy], self._criterion, pace.left, self._root)


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """How many parts there are, and the volume of their hulls: the less, the better they fit."""
    return len(parts), sum(part.hull.volume for part in parts)


@dataclass(frozen=True)
class _Trial:
    """What to try: a cluster is cut anew by a policy, or, where there is none, a part gives pieces to those around."""

    cluster: Cluster
    policy: int | None = None
    around: Cluster = ()
    seed: int = 0


@dataclass
class _Tally:
    """How often something was tried, and how many parts that gained."""

    tried: int = 0
    gained: int = 0

    @property
    def rate(self) -> float:
        """Parts gained a try, from a hopeful start."""
        return (self.gained + 1) / (self.tried + 10)


class _Ways:
    """Ways of trying: so many parts cut anew by this policy, or one that gives pieces away.

    Those that turned out well are taken more often.
    """

    def __init__(self, policies: int) -> None:
        self._ways: list[tuple[int, int | None]] = [(size, policy) for size in SIZES for policy in range(policies)]
        self._ways.append((1, None))
        self._sizes = {size: _Tally() for size in (1, *SIZES)}
        self._policies = [_Tally() for _ in range(policies)]
        self._cut: list[set[Cluster]] = [set() for _ in range(policies)]
        self._shifted: dict[tuple[int, Cluster], int] = {}

    def draw(self, here: Neighbours, random: np.random.Generator, reach: float) -> Iterator[_Trial]:
        """Draw up to `BATCH` trials of disjoint clusters, none that was made before."""
        taken: set[int] = set()
        worth = np.array([self._worth(size, policy) for size, policy in self._ways])
        for way in random.choice(len(self._ways), BATCH, p=worth / worth.sum()):
            size, policy = self._ways[way]
            for _ in range(DRAWS):
                trial = _giver(here, random, reach) if policy is None else _cluster(here, random, size, policy)
                if trial is None:
                    break
                if taken.isdisjoint(trial.cluster) and self._is_new(trial):
                    taken.update(trial.cluster)
                    yield trial
                    break

    def count(self, trial: _Trial, gain: int) -> None:
        """Remember what a try gave."""
        tallies = [self._sizes[len(trial.cluster)]]
        if trial.policy is not None:
            tallies.append(self._policies[trial.policy])
        for tally in tallies:
            tally.tried += 1
            tally.gained += gain

    def _worth(self, size: int, policy: int | None) -> float:
        """Parts gained by the time it takes, which is about in proportion to the size of a cluster."""
        rate = self._sizes[size].rate
        if policy is None:
            return len(self._policies) * rate / AS_LONG_AS
        return rate * self._policies[policy].rate / self._usual / size

    @property
    def _usual(self) -> float:
        return sum(tally.rate for tally in self._policies) / len(self._policies)

    def _is_new(self, trial: _Trial) -> bool:
        """Whether the trial was not made before, or not too often; it is from now on."""
        if trial.policy is not None:
            known = trial.cluster in self._cut[trial.policy]
            self._cut[trial.policy].add(trial.cluster)
            return not known
        key = trial.cluster[0], trial.around
        self._shifted[key] = self._shifted.get(key, 0) + 1
        return self._shifted[key] <= REPEATS


def _cluster(here: Neighbours, random: np.random.Generator, size: int, policy: int) -> _Trial | None:
    cluster = here.draw(size, random)
    return None if cluster is None else _Trial(cluster, policy)


def _giver(here: Neighbours, random: np.random.Generator, reach: float) -> _Trial | None:
    if len(here.parts) < 2:
        return None
    giver = here.draw_small(random)
    return _Trial((giver,), None, here.near(giver, reach), int(random.integers(2**32)))
