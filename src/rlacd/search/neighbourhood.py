"""Large-neighbourhood search over the parts of a decomposition.

A state is a set of parts, all of which meet the criterion. One operator changes it: a part is divided among the parts
around it and disappears, or gives them what they can take and stays as a smaller part.

Of the two, the next trial is always the one that has done the least work since it last saved a part.

Source: P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle Routing Problems", CP 1998.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.merge.numbered import NumberedParts
from rlacd.run import Apart, Run
from rlacd.search.divide import Exchange, divide
from rlacd.solid.component import Component, Part


@dataclass(frozen=True)
class SearchContext:
    """The problem that a search solves.

    Attributes
    ----------
    root : Component
        The component that is cut: the solid or its proxy.
    criterion : Criterion
        Every new part meets it.
    seed : int
    enough : callable
        Returns a lower bound on the number of parts, at which the search ends; may wait for it.
    """

    root: Component
    criterion: Criterion
    seed: int = 0
    enough: Callable[[], int] = lambda: 1


LAG = 4
"""A trial starts from the state before the latest `LAG` - 1 trials, which may still be under way. The lag does not
depend on the number of threads, so neither does the result."""

MOST_TRIES = 3
"""How often a part is divided between the same parts: of 470 further trials none saved one."""


class _Trial(NamedTuple):
    """Division of a part among those around it; where it `gives`, what none of them can take stays."""

    gives: bool
    part: int


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
        When their number last fell, by `time.perf_counter`.
    steps, accepted : int
        Trials made after the first of each part, and trials accepted.
    """

    def __init__(self, context: SearchContext, parts: Sequence[Part], run: Run) -> None:
        self._context = context
        self._run = run
        self._random = np.random.default_rng(context.seed)
        self._now = NumberedParts(parts, context.criterion)
        self.best = list(parts)
        self.gained = time.perf_counter()
        self.steps = self.accepted = 0
        self._near = min(context.criterion.reach, 2 * context.criterion.outward_deviation)
        self._around: dict[int, tuple[int, ...]] = {}
        self._begun: deque[tuple[_Trial, Apart[Exchange | None]]] = deque()
        self._again: deque[_Trial] = deque()  # to be repeated: what they found came too late
        self._tries: dict[tuple[_Trial, tuple[int, ...]], int] = {}
        self._in_vain = dict.fromkeys((False, True), 0)  # units since trials that give, or do not, last saved a part

    @property
    def parts(self) -> list[Part]:
        """The parts as they are."""
        return list(self._now.parts.values())

    @property
    def is_least(self) -> bool:
        """Whether the parts are as few as the lower bound."""
        return len(self.best) <= self._context.enough()

    def improve(self, most: float = math.inf, patience: float = math.inf) -> None:
        """Search until the run or `most` trials are over, `patience` units save nothing, or no fewer parts can do."""
        self._in_vain = dict.fromkeys((False, True), 0)
        self._make(self._trials(patience), most)

    def redistribute_all(self) -> None:
        """Offer each part to those around, the smallest first."""
        self._make(_Trial(False, which) for which in self._by_size())
        self.steps = 0

    def _trials(self, patience: float) -> Iterator[_Trial]:
        """Trials of the kind that has done the least work in vain."""
        while sum(self._in_vain.values()) < patience and not self.is_least:
            found = map(self._least_tried, sorted(self._in_vain, key=self._in_vain.__getitem__))
            trial = next((trial for trial in found if trial is not None), None)
            if trial is not None:
                yield trial
            elif self._begun:
                self._settle()  # what they find may bring something new to try
            else:
                return

    def _least_tried(self, gives: bool) -> _Trial | None:
        """The part tried least often between the same neighbours; the smallest of several."""
        around = self._neighbours()
        tries = {i: self._tries.get((_Trial(gives, i), around[i]), 0) for i in self._by_size() if around[i]}
        which = min(tries, key=tries.__getitem__, default=None)
        return None if which is None or tries[which] == MOST_TRIES else _Trial(gives, which)

    def _by_size(self) -> list[int]:
        parts = self._now.parts
        return sorted(parts, key=lambda i: (parts[i].hull.volume, i))

    def _neighbours(self) -> dict[int, tuple[int, ...]]:
        """The parts that each part may be divided among, in ascending order."""
        if not self._around:
            around: dict[int, list[int]] = {i: [] for i in self._now.parts}
            for i, j in self._now.boxes.pairs([*around], self._near).tolist():
                around[i].append(j)
                around[j].append(i)
            self._around = {i: tuple(sorted(near)) for i, near in around.items()}
        return self._around

    def _exchange(self, trial: _Trial) -> Callable[[Run], Exchange | None] | None:
        """Make the function that finds the exchange of a trial; None if the trial's part has gone."""
        parts, context = self._now.parts, self._context
        if trial.part not in parts:
            return None
        near = self._neighbours()[trial.part]
        tries = self._tries[trial, near] = self._tries.get((trial, near), 0) + 1
        return partial(
            divide,
            parts[trial.part],
            [parts[i] for i in near],
            context.criterion,
            np.random.default_rng(int(self._random.integers(2**32))),
            keeps_rest=trial.gives,
            again=trial.gives or tries > 1,
        )

    def _make(self, trials: Iterator[_Trial], most: float = math.inf) -> None:
        """Make trials, `LAG` at a time, and apply what they find, until there are `most`."""
        run = self._run
        with run.until_stopped():
            try:
                while self.steps < most and run.step(self.steps, None, len(self.best)):
                    trial = self._again.popleft() if self._again else next(trials, None)
                    if trial is None and not self._begun:
                        break
                    if trial is not None and (exchange := self._exchange(trial)) is not None:
                        self._begun.append((trial, run.apart(exchange, run.work.left)))
                    if trial is None or len(self._begun) == LAG:
                        self._settle()
            finally:
                run.abandon(apart for _, apart in self._begun)
                self._begun.clear()

    def _settle(self) -> None:
        """Apply what the first trial under way has found, or make it again if parts that it changes have gone."""
        trial, apart = self._begun.popleft()
        exchange = self._run.result(apart.begun)
        self._run.work.pay(apart.account.done)
        if apart.account.is_spent:  # it was given all that was left
            self._run.work.close()
        self.steps += 1
        self._in_vain[trial.gives] += apart.account.done
        if exchange is None:
            return
        if not self._apply(exchange):
            self._again.append(trial)
            return
        self.accepted += 1
        if exchange.gain > 0:
            self._in_vain[trial.gives] = 0
        if cost(self.parts) < cost(self.best):
            if len(self.parts) < len(self.best):
                self.gained = time.perf_counter()
            self.best = self.parts

    def _apply(self, exchange: Exchange) -> bool:
        """Apply an exchange; False if some of the parts it takes out are already gone."""
        numbers = {id(part): i for i, part in self._now.parts.items()}
        if any(id(part) not in numbers for part in exchange.out):
            return False
        self._now.remove([numbers[id(part)] for part in exchange.out])
        for part in exchange.into:
            self._now.add(part)
        self._around = {}
        return True


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
