"""What a search tries next: which clusters are cut anew by whom, and which parts are given away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rlacd.search.part_graph import Cluster, PartGraph

SIZES = (3, 4, 5, 6, 8)
"""So many parts are cut anew together: two seldom become one, and more take too long."""

BATCH = 8
"""Trials made of one state at a time; the same whatever the number of threads, so that the result is too."""

REPEATS = 4
"""So often a part may be given to the same others, each time by other cuts."""

PRIOR = 2
"""The work of a kind of trial is supposed as if so many had been made."""

DRAWS = 10
"""A way of trying is left for this batch when so many draws in a row gave nothing new."""


class Operator(Enum):
    """What can be done to a state."""

    RECUT = "a cluster is cut anew by a policy"
    TRANSFER = "a part gives pieces to those around"
    REDISTRIBUTE = "a part is divided among those around"


AS_MUCH_AS = {Operator.TRANSFER: 3.0, Operator.REDISTRIBUTE: 0.6}
"""Giving a part away is about as much work as it is to cut a cluster of so many anew."""


@dataclass(frozen=True)
class Trial:
    """What to try: with which parts, the ids of those around, which policy cuts, and the seed of what is drawn."""

    move: Operator
    cluster: Cluster
    policy: int | None = None
    around: Cluster = ()
    seed: int = 0


@dataclass
class _Tally:
    """How often something was tried, how many parts that gained, and how much work it was."""

    tried: int = 0
    gained: int = 0
    work: float = 0.0

    @property
    def rate(self) -> float:
        """Parts gained a try, from a hopeful start."""
        return (self.gained + 1) / (self.tried + 10)


class OperatorSampler:
    """Ways of trying: so many parts cut anew by this policy, or one that is given away in this manner.

    Those that turned out well are taken more often.
    """

    def __init__(self, policies: int) -> None:
        self._operators: list[tuple[Operator, int, int | None]] = [
            *((Operator.RECUT, size, policy) for size in SIZES for policy in range(policies)),
            (Operator.TRANSFER, 1, None),
            (Operator.REDISTRIBUTE, 1, None),
        ]
        self._kinds = {(move, size): _Tally() for move, size, _ in self._operators}
        self._policies = [_Tally() for _ in range(policies)]
        self._cut: list[set[Cluster]] = [set() for _ in range(policies)]
        self._given: dict[tuple[Operator, int, Cluster], int] = {}
        self._units = self._spent = 0.0

    def draw(self, graph: PartGraph, random: np.random.Generator, reach: float) -> Iterator[Trial]:
        """Draw up to `BATCH` trials of disjoint clusters, none that was made before."""
        taken: set[int] = set()
        worth = np.array([self._worth(*way) for way in self._operators])
        for way in random.choice(len(self._operators), BATCH, p=worth / worth.sum()):
            move, size, policy = self._operators[way]
            for _ in range(DRAWS):
                trial = _giver(graph, random, move, reach) if policy is None else _cluster(graph, random, size, policy)
                if trial is None:
                    break
                if taken.isdisjoint(trial.cluster) and self.is_new(trial):
                    taken.update(trial.cluster)
                    yield trial
                    break

    def is_new(self, trial: Trial) -> bool:
        """Whether the trial was not made before, or not too often; it is from now on."""
        if trial.policy is not None:
            known = trial.cluster in self._cut[trial.policy]
            self._cut[trial.policy].add(trial.cluster)
            return not known
        key = trial.move, trial.cluster[0], trial.around
        self._given[key] = self._given.get(key, 0) + 1
        return self._given[key] <= REPEATS

    def price(self, trial: Trial) -> float:
        """Get the work that a trial is likely to be, by those made so far; 0 at first."""
        return self._work(trial.move, len(trial.cluster)) * self._unit

    def count(self, trial: Trial, gain: int, work: float) -> None:
        """Remember what a try gave, and how much work it was."""
        self._units += _size(trial.move, len(trial.cluster))
        self._spent += work
        tallies = [self._kinds[trial.move, len(trial.cluster)]]
        if trial.policy is not None:
            tallies.append(self._policies[trial.policy])
        for tally in tallies:
            tally.tried += 1
            tally.gained += gain
            tally.work += work

    def _worth(self, move: Operator, size: int, policy: int | None) -> float:
        """Parts gained by the work it is."""
        rate = self._kinds[move, size].rate / self._work(move, size)
        return len(self._policies) * rate if policy is None else rate * self._policies[policy].rate / self._usual

    def _work(self, move: Operator, size: int) -> float:
        """The work of a trial, that of cutting one part anew being 1: at first about the size of the cluster."""
        tally = self._kinds[move, size]
        known = tally.work / self._unit if self._unit > 0 else 0.0
        return (PRIOR * _size(move, size) + known) / (PRIOR + tally.tried)

    @property
    def _unit(self) -> float:
        """Units of work in what was supposed to be 1."""
        return self._spent / self._units if self._units else 0.0

    @property
    def _usual(self) -> float:
        return sum(tally.rate for tally in self._policies) / len(self._policies)


def _size(move: Operator, size: int) -> float:
    return AS_MUCH_AS.get(move, float(size))


def _cluster(graph: PartGraph, random: np.random.Generator, size: int, policy: int) -> Trial | None:
    cluster = graph.draw(size, random)
    return None if cluster is None else Trial(Operator.RECUT, cluster, policy)


def _giver(graph: PartGraph, random: np.random.Generator, move: Operator, reach: float) -> Trial | None:
    if len(graph.parts) < 2:
        return None
    return giving_away(move, graph, graph.draw_small(random), random, reach)


def giving_away(move: Operator, graph: PartGraph, giver: int, random: np.random.Generator, reach: float) -> Trial:
    """Let a part be given to those within reach."""
    return Trial(move, (giver,), None, graph.near(giver, reach), int(random.integers(2**32)))
