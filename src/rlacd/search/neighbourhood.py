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
from rlacd.search.rankings import Ranking
from rlacd.search.recut import Exchange, recut
from rlacd.solid.component import Component, Part
from rlacd.workers import Workers

SIZES = (3, 4, 5, 6, 8)
"""So many parts are cut anew together: two seldom become one, and more take too long."""

BATCH = 8
"""Trials made of one state at a time; the same whatever the number of threads, so that the result is too."""

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
        self._policies = [ranking(views) for ranking in rankings]
        self._workers = workers
        self._random = np.random.default_rng(seed)
        self._here = Neighbours(parts, criterion, workers)
        self._ways = _Ways(len(rankings))

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._here.parts.values())

    def run(self, pace: Pace, most: float = math.inf, enough: int = 1) -> Outcome:
        """Try until nothing is left to try, the clock says no, `most` trials are made or `enough` parts are left."""
        steps = accepted = dry = 0
        here = self._here
        while pace.step(steps, None, len(here.parts)) and steps < most and len(here.parts) > enough and dry < DRY:
            batch = list(self._ways.draw(here, self._random))
            dry = 0 if batch else dry + 1
            batch = batch[: int(min(BATCH, most - steps))]  # drawn in full, so that more steps begin with the same
            found = self._workers.map(lambda trial: self._try(*trial, pace), batch)
            for (cluster, policy), exchange in zip(batch, found, strict=True):
                taken = exchange is not None and here.apply(exchange)
                self._ways.count(cluster, policy, exchange.gain if exchange is not None and taken else 0)
                steps += 1
                accepted += taken
            pace.steps += len(batch)
            pace.parts = min(pace.parts, len(here.parts))
        return Outcome(self.parts, steps, accepted, dry == DRY or len(here.parts) == 1)

    def _try(self, cluster: Cluster, policy: int, pace: Pace) -> Exchange | None:
        parts = [self._here.parts[i] for i in cluster]
        around = [self._here.parts[i] for i in self._here.around(cluster)]
        return recut(parts, around, self._policies[policy], self._criterion, pace.left, self._root)


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
    """Ways of trying: so many parts at once, cut by this policy. Those that turned out well are taken more often."""

    def __init__(self, policies: int) -> None:
        self._ways = [(size, policy) for size in SIZES for policy in range(policies)]
        self._sizes = {size: _Tally() for size in SIZES}
        self._policies = [_Tally() for _ in range(policies)]
        self._seen: list[set[Cluster]] = [set() for _ in range(policies)]

    def draw(self, here: Neighbours, random: np.random.Generator) -> Iterator[tuple[Cluster, int]]:
        """Draw up to `BATCH` disjoint clusters, each with a policy that it was not cut by before."""
        # A try takes time about in proportion to its size.
        worth = np.array([self._sizes[s].rate * self._policies[p].rate / s for s, p in self._ways])
        taken: set[int] = set()
        for way in random.choice(len(self._ways), BATCH, p=worth / worth.sum()):
            size, policy = self._ways[way]
            for _ in range(DRAWS):
                cluster = here.draw(size, random)
                if cluster is None:
                    break
                if cluster not in self._seen[policy] and taken.isdisjoint(cluster):
                    self._seen[policy].add(cluster)
                    taken.update(cluster)
                    yield cluster, policy
                    break

    def count(self, cluster: Cluster, policy: int, gain: int) -> None:
        """Remember what a try gave."""
        for tally in (self._sizes[len(cluster)], self._policies[policy]):
            tally.tried += 1
            tally.gained += gain
