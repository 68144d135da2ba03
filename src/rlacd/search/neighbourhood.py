"""Large-neighbourhood search over the parts of a decomposition.

A state is a set of parts, all of which meet the criterion. Two operators change it, in turn:

- redistribute: a part is divided among the parts around it and disappears. Every part is tried, the smallest first.
- recut: a cluster of neighbours is reunited into one solid and cut again; the pieces are merged with each other and
  with the parts around. Accepted if it leaves fewer parts, or equally many with a smaller total hull volume.

Source: P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rlacd._native import Stopped
from rlacd.criteria.criterion import Criterion
from rlacd.planes.candidates import EDGES_PER_COMPONENT, OFFSETS_PER_AXIS
from rlacd.planes.sweep import SweepCache
from rlacd.policies import Greedy, Policy
from rlacd.run import Begun, Run
from rlacd.search.operators import Exchange, recut, redistribute
from rlacd.search.part_graph import Cluster, PartGraph
from rlacd.solid.component import Component, Part

PLANES_PER_AXIS = OFFSETS_PER_AXIS // 2
"""Neighbourhoods are small: half the planes give results as good in half the time."""

CONCAVE_EDGES = EDGES_PER_COMPONENT // 2
"""Zero, two and four make little difference: 0.82, 0.81 and 0.81 of the parts after 4 s (nine meshes, one seed)."""

FEW_PARTS = 20
"""With more parts than this, trials begin at once: they gain more per unit of work than another pass over the solid,
and do not wait for the least number of parts."""

PORTFOLIO = ("excess-norm", "hull-sum", "max-excess")
"""Scores of the greedy policy for further passes over the whole solid, best first."""


@dataclass(frozen=True)
class SearchContext:
    """The problem that a search solves and the tools it solves it with.

    Attributes
    ----------
    root : Component
        What is cut: the solid, or its proxy.
    criterion : Criterion
        Every new part meets it.
    seed : int
    sweeps : SweepCache
        Sweeps of the solid's components, including those of the first pass.
    scores : sequence of str
        Of the greedy policies that cut neighbourhoods and, if time allows, make further passes over the whole solid.
    first_policy : str or Policy
        The policy of the first pass, which is not repeated: ``greedy`` has the first of the scores.
    enough : callable
        Returns the least number of parts of any decomposition: the search ends there. May wait for that.
    near_sweeps : SweepCache
        Coarser sweeps of components in neighbourhoods.
    """

    root: Component
    criterion: Criterion
    seed: int = 0
    sweeps: SweepCache = field(default_factory=SweepCache)
    scores: Sequence[str] = PORTFOLIO
    first_policy: str | Policy = "greedy"
    enough: Callable[[], int] = lambda: 1
    near_sweeps: SweepCache = field(default_factory=lambda: SweepCache(PLANES_PER_AXIS, CONCAVE_EDGES))


LAG = 8
"""A trial starts from the state that all trials but the `LAG` - 1 before it have left, so that many can be under way
at a time. It does not depend on the number of threads, so neither does the result."""

CLUSTER = 3
"""Parts that are recut together: two rarely become one, and of more, hardly any trial saves a part
(docs/search.md)."""

DRAWS = 10
"""Draws of a cluster before a trial is skipped for lack of a new one."""

SMALLEST_FIRST = 0.5
"""Share of the parts, the smallest, that are redistributed first: nothing saves more parts per unit of work."""

PARTS_PER_RECUT = 4
"""Between two attempts to redistribute all parts, one cluster is recut for every so many parts: a recut takes the work
of four attempts to redistribute a part and saves a fifth as many parts, but changes what there is to redistribute."""

PATIENCE = 3 * LAG
"""By default the search is exhausted after this many trials per part without a gain, ..."""

LEAST_TRIALS = 4 * LAG
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
        No trial had saved a part for a long time, or no fewer can do.
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


@dataclass(frozen=True)
class _UnderWay:
    """A trial under way: its own run, and what it will find."""

    run: Run
    found: Begun[Exchange | None]


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
        self._policies = [Greedy(score, sweeps=context.near_sweeps) for score in context.scores]
        self._random = np.random.default_rng(context.seed)
        self._graph = PartGraph(parts, context.criterion, run)
        self._best = list(parts)
        self._steps = self._accepted = self._without_gain = 0
        self._begun: deque[_UnderWay] = deque()
        self._recut: set[tuple[Cluster, int]] = set()
        self._price = 0.0  # units that the last trials took
        self._near = min(context.criterion.screen.reach, 2 * context.criterion.overhang)

    def improve(self, most: float = math.inf) -> SearchOutcome:
        """Search until patience or the run is over, `most` recuts are made or no fewer parts can do."""
        if most > 0:
            self._make(self._trials(most))
        return SearchOutcome(self._best, self._steps, self._accepted, self._gave_up or self._is_least)

    def redistribute_all(self) -> None:
        """Offer each part to those around."""
        self._make(self._redistributions())

    def _trials(self, most: float) -> Iterator[_Trial]:
        yield from self._redistributions(SMALLEST_FIRST)
        while self._steps < most and self._may_continue():
            yield from self._recuts(min(most, self._steps + math.ceil(len(self._graph.parts) / PARTS_PER_RECUT)))
            yield from self._redistributions()

    def _redistributions(self, share: float = 1.0) -> Iterator[_Trial]:
        """Offer each part, or the smallest share of them, to those around."""
        graph = self._graph
        waiting = sorted(graph.parts, key=lambda i: (graph.parts[i].hull.volume, i))
        for which in waiting[: math.ceil(share * len(waiting))]:
            if not self._may_continue():
                return
            if (trial := self._redistributing(which)) is not None:
                yield trial

    def _recuts(self, most: float) -> Iterator[_Trial]:
        """Recut clusters until `most` steps are made in total."""
        failed = 0
        while self._steps < most and self._may_continue():
            drawn = self._recutting()
            if drawn is not None:
                failed = 0
                self._steps += 1
                yield drawn
            elif self._begun:  # what they find may bring new clusters
                self._settle()
            elif (failed := failed + 1) == LAG:
                return

    @property
    def _is_least(self) -> bool:
        """Whether no fewer parts can do; of many parts, this is not asked before recuts begin, for it takes a while."""
        count = len(self._graph.parts)
        return (self._steps > 0 or count <= FEW_PARTS) and count <= self._context.enough()

    @property
    def _gave_up(self) -> bool:
        return self._without_gain >= max(self._patience * len(self._graph.parts), LEAST_TRIALS)

    def _may_continue(self) -> bool:
        return not self._gave_up and self._run.step(self._steps, None, len(self._best))

    def _recutting(self) -> _Trial | None:
        """Draw a cluster and a policy by which it has not been recut."""
        for _ in range(DRAWS):
            cluster = self._graph.draw(CLUSTER, self._random)
            if cluster is None:
                return None
            policy = int(self._random.integers(len(self._policies)))
            if (cluster, policy) not in self._recut:
                self._recut.add((cluster, policy))
                parts, around = self._graph.of(cluster), self._graph.of(self._graph.around(cluster))
                context = self._context
                return partial(recut, parts, around, context.criterion, self._policies[policy], context.root)
        return None

    def _redistributing(self, which: int) -> _Trial | None:
        if which not in self._graph.parts:
            return None
        around = self._graph.of(self._graph.near(which, self._near))
        random = np.random.default_rng(int(self._random.integers(2**32)))
        context = self._context
        return partial(redistribute, self._graph.parts[which], around, context.criterion, random, context.root)

    def _make(self, trials: Iterator[_Trial]) -> None:
        """Make trials, `LAG` at a time, and apply what they find."""
        try:
            while True:
                while self._begun and (len(self._begun) == LAG or self._allowance < self._price):
                    if self._is_least:
                        return
                    self._settle()
                if (trial := next(trials, None)) is None:
                    break
                alone = self._run.alone(self._allowance)
                self._begun.append(_UnderWay(alone, self._run.start(partial(trial, alone))))
            while self._begun and not self._is_least:
                self._settle()
        except Stopped:  # raised between two exchanges: the best state so far is kept
            self._run.note_stop()
        finally:
            self._run.drop([begun.found for begun in self._begun])
            self._begun.clear()

    @property
    def _allowance(self) -> float:
        """Units for another trial: an equal share of what those under way leave, or twice what the last ones took."""
        free = self._run.work.left
        if math.isinf(free):
            return free
        free -= sum(begun.run.work.most for begun in self._begun)
        return max(free // (LAG - len(self._begun)), min(free, 2 * self._price))

    def _settle(self) -> None:
        """Apply what the first of the trials under way has found, unless parts that it changes have gone."""
        account, begun = self._run.work, self._begun[0]
        exchange = self._run.result(begun.found)
        self._begun.popleft()
        account.pay(begun.run.work.done)
        taken = exchange is not None and self._graph.apply(exchange)
        gain = exchange.gain if exchange is not None and taken else 0
        self._accepted += taken
        self._without_gain = 0 if gain > 0 else self._without_gain + 1
        if taken:
            self._best = min(self._best, self.parts, key=cost)
        self._price = max(begun.run.work.done, self._price / 2)
        if begun.run.work.is_spent and not self._begun:
            account.close()

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return list(self._graph.parts.values())


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
