"""Large-neighbourhood search over the parts of a decomposition.

A state is a set of parts, all of which meet the criterion. Three operators change it:

- redistribute: a part is divided among the parts around it and disappears.
- give: a part gives what the parts around can take; what is left of it is smaller, and they are different.
- recut: a cluster of neighbours is reunited into one solid and cut again; the pieces are merged with each other and
  with the parts around. Accepted if it leaves fewer parts, or equally many with a smaller total hull volume.

The next trial is always one of the operator that has done the least work since it last saved a part.

Source: P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial

import numpy as np

from rlacd._native import Stopped
from rlacd.criteria.criterion import Criterion
from rlacd.planes.candidates import EDGES_PER_COMPONENT, OFFSETS_PER_AXIS
from rlacd.planes.sweep import SweepCache
from rlacd.policies import Greedy
from rlacd.run import Begun, Run
from rlacd.search.operators import Exchange, give, recut, redistribute
from rlacd.search.part_graph import Cluster, PartGraph
from rlacd.solid.component import Component, Part

PLANES_PER_AXIS = OFFSETS_PER_AXIS // 2
"""Neighbourhoods are small: half the planes give results as good in half the time."""

CONCAVE_EDGES = EDGES_PER_COMPONENT // 2
"""Zero, two and four make little difference: 0.82, 0.81 and 0.81 of the parts after 4 s (nine meshes, one seed)."""

PORTFOLIO = ("excess-norm", "hull-sum", "max-excess")
"""Scores of the greedy policies that cut neighbourhoods."""


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
    scores : sequence of str
        Of the greedy policies that cut neighbourhoods.
    enough : callable
        Returns the least number of parts of any decomposition: the search ends there. May wait for that.
    near_sweeps : SweepCache
        Coarser sweeps of components in neighbourhoods.
    """

    root: Component
    criterion: Criterion
    seed: int = 0
    scores: Sequence[str] = PORTFOLIO
    enough: Callable[[], int] = lambda: 1
    near_sweeps: SweepCache = field(default_factory=lambda: SweepCache(PLANES_PER_AXIS, CONCAVE_EDGES))


LAG = 4
"""A trial starts from the state that all trials but the `LAG` - 1 before it have left, so that several can be under way
at a time. It does not depend on the number of threads, so neither does the result."""

CLUSTER = 3
"""Parts that are recut together: two rarely become one, and of more, hardly any trial saves a part
(docs/search.md)."""

MOST_TRIES = 3
"""How often a part is divided between the same parts: of 470 further trials none saved one."""

DRAWS = 10
"""Draws of a cluster before it is given up to find a new one."""


class Operator(Enum):
    """How a trial changes the parts."""

    REDISTRIBUTE = "a part is divided among those around"
    GIVE = "a part gives to those around what they can take"
    RECUT = "a cluster is cut again"


@dataclass(frozen=True)
class _Trial:
    """An operator applied to some parts; recuts have a policy."""

    operator: Operator
    parts: Cluster
    policy: int = 0


@dataclass(frozen=True)
class _UnderWay:
    """A trial under way: its own run, and what it will find."""

    trial: _Trial
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

    Attributes
    ----------
    best : list of Part
        The best parts so far.
    gained : float
        When they became so few, by `time.perf_counter`.
    steps, accepted : int
        Recuts tried, and trials accepted.
    """

    def __init__(self, context: SearchContext, parts: Sequence[Part], run: Run) -> None:
        self._context = context
        self._run = run
        self._policies = [Greedy(score, sweeps=context.near_sweeps) for score in context.scores]
        self._random = np.random.default_rng(context.seed)
        self._graph = PartGraph(parts, context.criterion, run)
        self.best = list(parts)
        self.gained = time.perf_counter()
        self.steps = self.accepted = 0
        self._nears: dict[int, Cluster] = {}
        self._begun: deque[_UnderWay] = deque()
        self._again: deque[_Trial] = deque()  # what they found came too late
        self._recut: set[tuple[Cluster, int]] = set()
        self._tries: dict[tuple[Operator, int, Cluster], int] = {}
        self._in_vain = dict.fromkeys(Operator, 0)  # units since each last saved a part
        self._near = min(context.criterion.screen.reach, 2 * context.criterion.overhang)

    @property
    def parts(self) -> list[Part]:
        """The parts as they are."""
        return list(self._graph.parts.values())

    @property
    def is_least(self) -> bool:
        """Whether no fewer parts can do."""
        return len(self.best) <= self._context.enough()

    def improve(self, most: float = math.inf, patience: float = math.inf) -> None:
        """Search until the run is over, `most` recuts are made in total, so many units have saved nothing, or no fewer
        parts can do."""
        self._in_vain = dict.fromkeys(Operator, 0)
        self._make(self._trials(patience), most)

    def redistribute_all(self) -> None:
        """Offer each part to those around, the smallest first."""
        self._make(_Trial(Operator.REDISTRIBUTE, (which,)) for which in self._by_size())

    def _trials(self, patience: float) -> Iterator[_Trial]:
        """Trials of the operator that has done the least work in vain."""
        while sum(self._in_vain.values()) < patience and not self.is_least:
            for operator in sorted(Operator, key=self._in_vain.__getitem__):
                trial = self._cluster() if operator is Operator.RECUT else self._least_tried(operator)
                if trial is not None:
                    yield trial
                    break
            else:
                if not self._begun:
                    return
                self._settle()  # what they find may bring something new to try

    def _cluster(self) -> _Trial | None:
        """Draw a cluster and a policy by which it has not been recut."""
        for _ in range(DRAWS if self._policies else 0):
            cluster = self._graph.draw(CLUSTER, self._random)
            if cluster is None:
                break
            policy = int(self._random.integers(len(self._policies)))
            if (cluster, policy) not in self._recut:
                self._recut.add((cluster, policy))
                return _Trial(Operator.RECUT, cluster, policy)
        return None

    def _least_tried(self, operator: Operator) -> _Trial | None:
        """The part that was tried the fewest times between the same parts, of those the smallest."""
        tries = {i: self._tries.get((operator, i, near), 0) for i in self._by_size() if (near := self._around(i))}
        which = min(tries, key=tries.__getitem__, default=None)
        return None if which is None or tries[which] == MOST_TRIES else _Trial(operator, (which,))

    def _by_size(self) -> list[int]:
        parts = self._graph.parts
        return sorted(parts, key=lambda i: (parts[i].hull.volume, i))

    def _around(self, which: int) -> Cluster:
        """The parts that a part may be divided among."""
        if which not in self._nears:
            self._nears[which] = self._graph.near(which, self._near)
        return self._nears[which]

    def _exchange(self, trial: _Trial) -> Callable[[Run], Exchange | None] | None:
        """What finds an exchange of the parts as they are; None if those of the trial have gone."""
        graph, context, operator = self._graph, self._context, trial.operator
        if not all(i in graph.parts for i in trial.parts):
            return None
        parts = graph.of(trial.parts)
        if operator is Operator.RECUT:
            around = graph.of(graph.around(trial.parts))
            return partial(recut, parts, around, context.criterion, self._policies[trial.policy], context.root)
        near = self._around(trial.parts[0])
        key = operator, trial.parts[0], near
        tries = self._tries[key] = self._tries.get(key, 0) + 1
        random = np.random.default_rng(int(self._random.integers(2**32)))
        divide = give if operator is Operator.GIVE else partial(redistribute, again=tries > 1)
        return partial(divide, parts[0], graph.of(near), context.criterion, random, context.root)

    def _make(self, trials: Iterator[_Trial], most: float = math.inf) -> None:
        """Make trials, `LAG` at a time, and apply what they find, until there are `most` recuts."""
        run = self._run
        try:
            while self.steps < most and run.step(self.steps, None, len(self.best)):
                trial = self._again.popleft() if self._again else next(trials, None)
                if trial is None and not self._begun:
                    return
                if trial is not None and (exchange := self._exchange(trial)) is not None:
                    alone = run.alone(run.work.left)
                    self._begun.append(_UnderWay(trial, alone, run.start(partial(exchange, alone))))
                if trial is None or len(self._begun) == LAG:
                    self._settle()
        except Stopped:  # raised between two exchanges: the best state so far is kept
            run.note_stop()
        finally:
            run.drop([begun.found for begun in self._begun])
            self._begun.clear()

    def _settle(self) -> None:
        """Apply what the first trial under way has found, or make it again if parts that it changes have gone."""
        begun = self._begun.popleft()
        exchange = self._run.result(begun.found)
        self._run.work.pay(begun.run.work.done)
        if begun.run.work.is_spent:  # it was given all that was left
            self._run.work.close()
        self.steps += begun.trial.operator is Operator.RECUT
        self._in_vain[begun.trial.operator] += begun.run.work.done
        if exchange is None:
            return
        if not self._graph.apply(exchange):
            self._again.append(begun.trial)
            return
        self._nears.clear()
        self.accepted += 1
        if exchange.gain > 0:
            self._in_vain[begun.trial.operator] = 0
        if cost(self.parts) < cost(self.best):
            if len(self.parts) < len(self.best):
                self.gained = time.perf_counter()
            self.best = self.parts


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
