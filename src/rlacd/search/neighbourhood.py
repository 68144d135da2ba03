"""Large-neighbourhood search over the parts of a decomposition.

A state is a set of parts, all of which meet the criterion. Two operators change it, in turn:

- redistribute: a part is divided among the parts around it and disappears. Every part is tried, the smallest first.
- recut: a cluster of neighbours is reunited into one solid and cut again; the pieces are merged with each other and
  with the parts around. Accepted if it leaves fewer parts, or equally many with a smaller total hull volume.

Source: P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rlacd._native import Stopped
from rlacd.run import Run
from rlacd.search.context import SearchContext
from rlacd.search.part_graph import Cluster, PartGraph
from rlacd.search.recut import Exchange, recut
from rlacd.search.redistribute import redistribute
from rlacd.solid.component import Part

BATCH = 8
"""Trials made from the same state. It does not depend on the number of threads, so neither does the result."""

CLUSTER = 3
"""Parts that are recut together: two rarely become one, and of more, hardly any trial saves a part
(docs/search.md)."""

DRAWS = 10
"""Draws of a cluster before a trial is skipped for lack of a new one."""

REPEATS = 4
"""How often a part may be offered to the same parts, each time divided in other places."""

OPENING = 16
"""Recuts before the first attempt to redistribute all parts: later recuts undo some of what that gains."""

SMALL = 0.5
"""Share of the parts, the smallest, that are redistributed first: nothing saves more parts per unit of work."""

RECUTS_PER_PART = 2
"""Recuts per part between two attempts to redistribute all parts."""

PATIENCE = 24
"""By default the search is exhausted after this many trials per part without a gain, ..."""

LEAST_TRIALS = 32
"""... but not before this many: where parts are few, trials cost little."""


@dataclass(frozen=True)
class SearchOutcome:
    """Result of a neighbourhood search.

    Attributes
    ----------
    parts : list of Part
        The best parts found.
    steps : int
        Recuts tried.
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


_Trial = Callable[[Run], Exchange | None]


class Neighbourhood:
    """A decomposition that is being improved.

    Parameters
    ----------
    context : SearchContext
    parts : sequence of Part
        Made of components with disjoint interiors.
    run : Run
    patience : int
        The search is exhausted after this many trials per part without a gain.
    """

    def __init__(self, context: SearchContext, parts: Sequence[Part], run: Run, patience: int = PATIENCE) -> None:
        self._context = context
        self._run = run
        self._patience = patience
        self._policies = [ranking(context.near_sweeps) for ranking in context.rankings]
        self._random = np.random.default_rng(context.seed)
        self._graph = PartGraph(parts, context.criterion, run)
        self._best = list(parts)
        self._steps = self._accepted = self._without_gain = 0
        self._recut: set[tuple[Cluster, int]] = set()
        self._offered: dict[tuple[int, Cluster], int] = {}
        self._price = {"recut": 0.0, "redistribute": 0.0}  # units, of the last batch
        self._near = min(context.criterion.screen.reach, 2 * context.criterion.overhang)

    def improve(self, most: float = math.inf) -> SearchOutcome:
        """Search until nothing is left to try, the run is over, `most` recuts are made or no fewer parts can do."""
        exhausted = self._is_least
        try:
            if most > 0:
                self.redistribute_all(SMALL)
                self._recut_some(min(most, OPENING))
                self.redistribute_all()
            exhausted = self._is_least
            while not exhausted and self._steps < most and not self._is_least and not self._run.is_over:
                target = self._steps + RECUTS_PER_PART * len(self._graph.parts)
                exhausted = self._recut_some(min(most, target)) or self._gave_up
                self.redistribute_all()
        except Stopped:  # raised between two exchanges: the best state so far is kept
            self._run.note_stop()
        return SearchOutcome(self._best, self._steps, self._accepted, exhausted)

    def redistribute_all(self, share: float = 1.0) -> None:
        """Offer each part, or the smallest share of them, to those around."""
        graph = self._graph
        waiting = sorted(graph.parts, key=lambda i: (graph.parts[i].hull.volume, i))
        waiting = waiting[: math.ceil(share * len(waiting))]
        while waiting and not self._is_least and not self._gave_up and self._may_continue():
            batch, waiting = waiting[:BATCH], waiting[BATCH:]
            self._make("redistribute", [trial for i in batch if (trial := self._redistributing(i)) is not None])

    def _recut_some(self, most: float) -> bool:
        """Recut clusters until `most` steps are made in total; whether nothing new was left to recut."""
        while self._steps < most and not self._is_least and not self._gave_up and self._may_continue():
            taken: set[int] = set()
            trials = [trial for _ in range(BATCH) if (trial := self._recutting(taken)) is not None]
            if not trials:
                return True
            # Drawn in full and then shortened, so a search with more steps starts with the same trials.
            trials = trials[: int(min(BATCH, most - self._steps))]
            self._steps += self._make("recut", trials)
        return self._is_least

    @property
    def _is_least(self) -> bool:
        return len(self._graph.parts) <= self._context.enough

    @property
    def _gave_up(self) -> bool:
        return self._without_gain >= max(self._patience * len(self._graph.parts), LEAST_TRIALS)

    def _may_continue(self) -> bool:
        return self._run.step(self._steps, None, len(self._best))

    def _recutting(self, taken: set[int]) -> _Trial | None:
        """Draw a cluster disjoint from those taken that has not been recut by the drawn policy."""
        for _ in range(DRAWS):
            cluster = self._graph.draw(CLUSTER, self._random)
            if cluster is None:
                return None
            policy = int(self._random.integers(len(self._policies)))
            if taken.isdisjoint(cluster) and (cluster, policy) not in self._recut:
                taken.update(cluster)
                self._recut.add((cluster, policy))
                parts, around = self._graph.of(cluster), self._graph.of(self._graph.around(cluster))
                context, chosen = self._context, self._policies[policy]
                return lambda run: recut(parts, around, chosen, context.criterion, run, context.root)
        return None

    def _redistributing(self, which: int) -> _Trial | None:
        if which not in self._graph.parts:
            return None
        around = self._graph.near(which, self._near)
        key, seed = (which, around), int(self._random.integers(2**32))
        self._offered[key] = self._offered.get(key, 0) + 1
        if self._offered[key] > REPEATS:
            return None
        part, takers, context = self._graph.parts[which], self._graph.of(around), self._context
        return lambda run: redistribute(part, takers, context.criterion, np.random.default_rng(seed), context.root, run)

    def _make(self, kind: str, trials: list[_Trial]) -> int:
        """Make trials of the same state at a time, as many as the work left pays for; apply what they find in order."""
        run, account = self._run, self._run.work
        if not trials:
            return 0
        if self._price[kind] > 0 and math.isfinite(account.left):
            trials = trials[: max(1, int(account.left / self._price[kind]))]
        alone = [run.alone(account.share(len(trials))) for _ in trials]
        found = run.map(lambda pair: pair[0](pair[1]), zip(trials, alone, strict=True))
        for exchange, trial in zip(found, alone, strict=True):
            account.pay(trial.work.done)
            taken = exchange is not None and self._graph.apply(exchange)
            gain = exchange.gain if exchange is not None and taken else 0
            self._accepted += taken
            self._without_gain = 0 if gain > 0 else self._without_gain + 1
            if taken:
                self._best = min(self._best, self.parts, key=cost)
        self._price[kind] = max(trial.work.done for trial in alone)
        account.pay(self._graph.collect())
        if all(trial.work.is_spent for trial in alone):
            account.close()
        return len(trials)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._graph.parts.values())


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
