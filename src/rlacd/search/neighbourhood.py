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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
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
    first_pass : int
        The work of cutting and merging, which bounds that of the search.
    enough : callable
        Returns a lower bound on the number of parts, at which the search ends; may wait for it.
    """

    root: Component
    criterion: Criterion
    seed: int = 0
    first_pass: int = 0
    enough: Callable[[], int] = lambda: 1


AHEAD = 16
"""Trials chosen ahead, each as if those before it changed nothing; one whose part or neighbours they do change is made
between what is there then. So it starts from the state that they leave, whatever the number of threads."""

MOST_TRIES = 6
"""How often a part is divided in each way. Those around it mostly grow meanwhile, which seldom makes room for it."""


class _Trial(NamedTuple):
    """Division of a part among those around it; where it `gives`, what none of them can take stays."""

    gives: bool
    part: int


@dataclass
class _Chosen:
    """A trial between some parts, and the work it may do; it is under way once there is a thread for it."""

    trial: _Trial
    near: tuple[int, ...]
    exchange: Callable[[Run], Exchange | None]
    units: float
    apart: Apart[Exchange | None] | None = None


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
        self._now = NumberedParts(parts, context.criterion)
        self.best = list(parts)
        self.gained = time.perf_counter()
        self.steps = self.accepted = 0
        self._around: dict[int, tuple[int, ...]] = {}
        self._chosen: deque[_Chosen] = deque()
        self._stale: list[Apart[Exchange | None]] = []  # may still be under way
        self._tries: dict[_Trial, int] = {}
        self._in_vain = dict.fromkeys((False, True), 0)  # units since trials that give, or do not, last saved a part

    @property
    def parts(self) -> list[Part]:
        """The parts as they are."""
        return list(self._now.parts.values())

    def improve(self, most: float = math.inf, patience: float = math.inf) -> None:
        """Search until the run or `most` trials are over, `patience` units save nothing, or no fewer parts can do."""
        self._in_vain = dict.fromkeys((False, True), 0)

        def goes_on() -> bool:
            is_in_time = self.steps < most and sum(self._in_vain.values()) < patience
            return is_in_time and len(self.best) > self._context.enough()

        self._make(self._most_due, goes_on)

    def redistribute_all(self) -> None:
        """Offer each part to those around, the smallest first."""
        trials = iter([_Trial(False, which) for which in self._by_size()])
        self._make(lambda: next(trials, None))
        self.steps = 0

    def _most_due(self) -> _Trial | None:
        """A trial of the kind that has done the least work in vain."""
        found = map(self._least_tried, sorted(self._in_vain, key=self._in_vain.__getitem__))
        return next((trial for trial in found if trial is not None), None)

    def _least_tried(self, gives: bool) -> _Trial | None:
        """The part tried least often; the smallest of several."""
        around = self._neighbours()
        tries = {i: self._tries.get(_Trial(gives, i), 0) for i in self._by_size() if around[i]}
        which = min(tries, key=tries.__getitem__, default=None)
        return None if which is None or tries[which] == MOST_TRIES else _Trial(gives, which)

    def _by_size(self) -> list[int]:
        parts = self._now.parts
        return sorted(parts, key=lambda i: (parts[i].hull.volume, i))

    def _neighbours(self) -> dict[int, tuple[int, ...]]:
        """The parts that each part may be divided among, in ascending order."""
        if not self._around:
            around: dict[int, list[int]] = {i: [] for i in self._now.parts}
            for i, j in self._now.boxes.pairs([*around], self._context.criterion.reach).tolist():
                around[i].append(j)
                around[j].append(i)
            self._around = {i: tuple(sorted(near)) for i, near in around.items()}
        return self._around

    def _choose(self, trial: _Trial) -> None:
        """Choose a trial, unless its part has gone. What it draws depends on what it is, not on others."""
        parts, context = self._now.parts, self._context
        if trial.part not in parts:
            return
        near = self._neighbours()[trial.part]
        tries = self._tries[trial] = self._tries.get(trial, 0) + 1
        exchange = partial(
            divide,
            parts[trial.part],
            [parts[i] for i in near],
            context.criterion,
            np.random.default_rng([context.seed, trial.gives, trial.part, tries, *near]),
            keeps_rest=trial.gives,
            again=trial.gives or tries > 1,
        )
        self._chosen.append(_Chosen(trial, near, exchange, self._run.work.left))

    def _make(self, due: Callable[[], _Trial | None], goes_on: Callable[[], bool] = lambda: True) -> None:
        """Make trials as they are due, and apply what they find."""
        run = self._run
        with run.until_stopped():
            try:
                while goes_on() and run.step(self.steps, len(self.best)):
                    trial = due()
                    if trial is not None:
                        self._choose(trial)
                    elif not self._chosen:
                        break
                    if trial is None or len(self._chosen) == AHEAD:
                        self._settle()
            finally:
                run.abandon([*self._stale, *(one.apart for one in self._chosen if one.apart)])
                self._chosen.clear()
                self._stale.clear()

    def _settle(self) -> None:
        """Apply what the first trial chosen has found."""
        run = self._run
        for one in islice(self._chosen, run.threads + 1):  # more would be made in vain
            one.apart = one.apart or run.apart(one.exchange, one.units)
        trial, apart = self._chosen[0].trial, self._chosen[0].apart
        assert apart is not None
        exchange = run.result(apart.begun)
        self._chosen.popleft()
        run.work.pay(apart.account.done)
        if apart.account.is_spent:  # it was given all that was left
            run.work.close()
        self.steps += 1
        self._in_vain[trial.gives] += apart.account.done
        if exchange is None:
            return
        self._apply(exchange)
        self.accepted += 1
        if exchange.gain > 0:
            self._in_vain[trial.gives] = 0
        if cost(self.parts) < cost(self.best):
            if len(self.parts) < len(self.best):
                self.gained = time.perf_counter()
            self.best = self.parts

    def _apply(self, exchange: Exchange) -> None:
        """Apply an exchange, and choose trials between parts that it changes again."""
        numbers = {id(part): i for i, part in self._now.parts.items()}
        self._now.remove([numbers[id(part)] for part in exchange.out])
        for part in exchange.into:
            self._now.add(part)
        self._around = {}
        around, chosen = self._neighbours(), self._chosen
        self._chosen = deque()
        for one in chosen:
            if around.get(one.trial.part) == one.near:
                self._chosen.append(one)
                continue
            if one.apart is not None:
                one.apart.account.close()
                self._stale.append(one.apart)
            self._tries[one.trial] -= 1
            self._choose(one.trial)


def cost(parts: Sequence[Part]) -> tuple[int, float]:
    """The number of parts, then the total volume of their hulls: what the search minimises."""
    return len(parts), sum(part.hull.volume for part in parts)
