"""The operators of the search, and how the next trials are drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rlacd.search.part_graph import Cluster, PartGraph

SIZES = (3, 4, 5, 6, 8)
"""Cluster sizes for recuts: two parts rarely become one, and more than eight take too long."""

BATCH = 8
"""Trials made from the same state. It does not depend on the number of threads, so neither does the result."""

REPEATS = 4
"""How often a part may be given to the same parts, each time with other random cuts."""

PRIOR = 2
"""Weight of the prior estimate of the work of a kind of trial, in trials."""

DRAWS = 10
"""Draws of one operator in a batch before it is skipped for lack of anything new."""


class Operator(Enum):
    """A way to change the parts of a state."""

    RECUT = "a cluster is cut again by a policy"
    TRANSFER = "a part gives pieces to those around"
    REDISTRIBUTE = "a part is divided among those around"


EXPECTED = {Operator.RECUT: 0.06, Operator.TRANSFER: 0.03, Operator.REDISTRIBUTE: 0.1}
"""Prior estimate of the parts a trial saves (measured: research/search.md)."""

EXPECTED_OF_LARGE = 0.015
"""The same for recuts of clusters larger than the smallest."""

OPINION = 10
"""Weight of this prior, in trials."""

AS_MUCH_AS = {Operator.TRANSFER: 3.0, Operator.REDISTRIBUTE: 0.6}
"""Prior estimate of the work of giving a part away: that of recutting a cluster of this many parts."""


@dataclass(frozen=True)
class Trial:
    """One application of an operator: to which parts, the ids of those around, the policy (recut only), and a seed."""

    move: Operator
    cluster: Cluster
    policy: int | None = None
    around: Cluster = ()
    seed: int = 0


@dataclass
class _Tally:
    """Number of trials, parts they saved, and work they took."""

    expected: float
    tried: int = 0
    gained: int = 0
    work: float = 0.0

    @property
    def rate(self) -> float:
        """Parts saved per trial; the prior weighs `OPINION` trials."""
        return (self.gained + OPINION * self.expected) / (self.tried + OPINION)


class OperatorSampler:
    """Draws trials: recuts of each cluster size by each policy, transfers and redistributions.

    The weight of each is its estimated gain per unit of work.
    """

    def __init__(self, policies: int) -> None:
        self._operators: list[tuple[Operator, int, int | None]] = [
            *((Operator.RECUT, size, policy) for size in SIZES for policy in range(policies)),
            (Operator.TRANSFER, 1, None),
            (Operator.REDISTRIBUTE, 1, None),
        ]
        self._kinds = {(move, size): _Tally(_expected(move, size)) for move, size, _ in self._operators}
        self._policies = [_Tally(EXPECTED[Operator.RECUT]) for _ in range(policies)]
        self._cut: list[set[Cluster]] = [set() for _ in range(policies)]
        self._given: dict[tuple[Operator, int, Cluster], int] = {}
        self._units = self._spent = 0.0

    def draw(self, graph: PartGraph, random: np.random.Generator, reach: float) -> Iterator[Trial]:
        """Draw up to `BATCH` new trials of disjoint clusters."""
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
        """Whether the trial may be made: a recut once, giving a part away `REPEATS` times. The call counts as made."""
        if trial.policy is not None:
            known = trial.cluster in self._cut[trial.policy]
            self._cut[trial.policy].add(trial.cluster)
            return not known
        key = trial.move, trial.cluster[0], trial.around
        self._given[key] = self._given.get(key, 0) + 1
        return self._given[key] <= REPEATS

    def price(self, trial: Trial) -> float:
        """Estimate the work of a trial from those made so far; 0 before the first."""
        return self._work(trial.move, len(trial.cluster)) * self._unit

    def count(self, trial: Trial, gain: int, work: float) -> None:
        """Record the gain and the work of a trial."""
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
        """Estimated parts saved per unit of work, up to a common factor."""
        rate = self._kinds[move, size].rate / self._work(move, size)
        return len(self._policies) * rate if policy is None else rate * self._policies[policy].rate / self._usual

    def _work(self, move: Operator, size: int) -> float:
        """Estimated work of a trial, relative to recutting one part; the prior is the size of the cluster."""
        tally = self._kinds[move, size]
        known = tally.work / self._unit if self._unit > 0 else 0.0
        return (PRIOR * _size(move, size) + known) / (PRIOR + tally.tried)

    @property
    def _unit(self) -> float:
        """Units of work per unit of the prior estimate."""
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
    """Make the trial that gives a part to those within reach."""
    return Trial(move, (giver,), None, graph.near(giver, reach), int(random.integers(2**32)))


def _expected(move: Operator, size: int) -> float:
    return EXPECTED_OF_LARGE if size > SIZES[0] else EXPECTED[move]
