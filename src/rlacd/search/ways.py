"""What a search tries next: which clusters are cut anew by whom, and who gives pieces away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rlacd.search.neighbours import Cluster, Neighbours

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


@dataclass(frozen=True)
class Trial:
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


class Ways:
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

    def draw(self, here: Neighbours, random: np.random.Generator, reach: float) -> Iterator[Trial]:
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

    def count(self, trial: Trial, gain: int) -> None:
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

    def _is_new(self, trial: Trial) -> bool:
        """Whether the trial was not made before, or not too often; it is from now on."""
        if trial.policy is not None:
            known = trial.cluster in self._cut[trial.policy]
            self._cut[trial.policy].add(trial.cluster)
            return not known
        key = trial.cluster[0], trial.around
        self._shifted[key] = self._shifted.get(key, 0) + 1
        return self._shifted[key] <= REPEATS


def _cluster(here: Neighbours, random: np.random.Generator, size: int, policy: int) -> Trial | None:
    cluster = here.draw(size, random)
    return None if cluster is None else Trial(cluster, policy)


def _giver(here: Neighbours, random: np.random.Generator, reach: float) -> Trial | None:
    if len(here.parts) < 2:
        return None
    giver = here.draw_small(random)
    return Trial((giver,), None, here.near(giver, reach), int(random.integers(2**32)))
