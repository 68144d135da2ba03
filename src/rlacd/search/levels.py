"""Search for fewer parts: the quality levels, the bounds of each, and where a search starts."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import grow_cover
from rlacd.planes.sweep import SweepCache
from rlacd.policies import Greedy
from rlacd.report import SearchSummary
from rlacd.run import Apart, Run
from rlacd.search.neighbourhood import Neighbourhood, SearchContext, cost
from rlacd.solid.component import Part

BEST_SECONDS = 5.0
"""Seconds of ``best`` by default; more if its first search takes longer."""

TIMES_FIRST_PASS = 2.5
"""Limit on the work of a bounded search, as a multiple of the work of the first pass."""

LEAST_WORK, MOST_WORK = 0.15e6, 8e6
"""Least and greatest limit on the work of a bounded search, in units: about 0.15 and 8 seconds of one core."""

WORK_OF_A_STEP = 1e5
"""Where only the number of steps is limited, the work allowed for each: far more than most take."""

STARTS = ("excess-norm", "hull-sum")
"""Scores of the greedy policy for further passes over the whole solid, in turn, each among other planes."""

ANOTHER_PASS = 1.5
"""Another pass is abandoned when it exceeds this multiple of the work of the first, and not begun with less left."""

HOPELESS = 5
"""Another pass is abandoned when its pieces outnumber the parts by this factor: merging will not make up for that."""

IN_VAIN = 8
"""A search ends after so many starts in a row without a gain."""


def search(
    context: SearchContext,
    parts: Sequence[Part],
    run: Run,
    quality: str,
    seconds: float | None = None,
    steps: int | None = None,
) -> tuple[list[list[Part]], SearchSummary]:
    """Search for fewer parts, or for equally many with a smaller total hull volume.

    Without other limits, the search does a bounded multiple of the first pass's work; ``best`` goes on for its seconds.

    Parameters
    ----------
    context : SearchContext
    parts : sequence of Part
        A decomposition of the solid.
    run : Run
    quality : "balanced" or "best"
    seconds : float, optional
        Wall time of the search, in place of that bound.
    steps : int, optional
        Trials, in place of that bound.

    Returns
    -------
    found : list of list of Part
        The parts that ``fast`` and ``balanced`` find, and the best; never worse than the given ones. They depend on the
        seed and the steps, and on time only if `seconds` or the run ends the search.
    summary : SearchSummary
    """
    begin, done = time.perf_counter(), run.work.done
    allowed, bounded = math.inf, seconds is None and steps is None
    if seconds is None:
        allowed = min(max(TIMES_FIRST_PASS * context.first_pass, LEAST_WORK), MOST_WORK)
        if steps is not None:
            allowed = TIMES_FIRST_PASS * context.first_pass + MOST_WORK + WORK_OF_A_STEP * steps
    state = _Search(context, list(parts), run)
    most = math.inf if steps is None else steps
    with run.limited(allowed, math.inf if seconds is None else seconds):
        state.go_on(most)
    earlier = state.best
    if bounded and quality == "best":
        with run.limited(seconds=BEST_SECONDS - (time.perf_counter() - begin)):
            state.go_on(most)
    summary = SearchSummary(
        level=quality,
        seconds=time.perf_counter() - begin,
        last_gain=max(state.gained - begin, 0.0),
        first_pass=len(parts),
        parts=len(state.best),
        starts=state.starts,
        steps=state.steps,
        accepted=state.accepted,
        work=run.work.done - done,
        allowed=None if math.isinf(allowed) else math.floor(allowed),
        lower_bound=context.enough(),
    )
    return [state.early, earlier, state.best], summary


def eliminate_parts(context: SearchContext, parts: Sequence[Part], run: Run) -> list[Part]:
    """Try once to redistribute each part to the parts around it; parts that cannot go stay.

    With `fast` it is the only search, for criteria that ask for it (`Criterion.eliminates`).
    """
    state = Neighbourhood(context, parts, run)
    state.redistribute_all()
    return state.parts


class _Search:
    """Searches from one start after another, of which the best so far goes on.

    What it does depends on time only in where it ends: with more time it is never worse.

    Parameters
    ----------
    context : SearchContext
    parts : list of Part
        The first start.
    run : Run

    Attributes
    ----------
    early, best : list of Part
        The parts that ``fast`` ends with, and the best so far.
    gained : float
        When the best parts last became fewer, by `time.perf_counter`.
    starts, steps, accepted : int
        Starts searched from, trials made and trials accepted.
    """

    def __init__(self, context: SearchContext, parts: list[Part], run: Run) -> None:
        self.early = self.best = parts
        self.gained = 0.0
        self.starts = self.steps = self.accepted = 0
        self._context = context
        self._run = run
        self._most = HOPELESS * len(parts)
        self._passes = 1
        self._state: Neighbourhood | None = None
        self._ahead = 0  # number of its parts once each had been offered to others
        self._next: list[Apart[list[Part]]] = []  # the next pass, once it is under way

    def go_on(self, most: float) -> None:
        """Search until the run is over, `most` trials are made, or parts are as few as the lower bound."""
        run, enough, in_vain = self._run, self._context.enough, 0
        try:
            while self.steps < most and not run.is_over and len(self.best) > enough() and in_vain < IN_VAIN:
                self._begin_pass()
                before = len(self.best)
                if self._state is None:
                    self._state = self._begun(self.best)
                    self._ahead = len(self._state.parts)
                    if self._context.criterion.eliminates:
                        self.early = self._state.parts
                self._improve(self._state, most)
                if self.steps < most and not run.is_over:
                    with run.quietly():
                        self._challenge(self._state, most)
                in_vain = in_vain + 1 if len(self.best) == before else 0
        finally:
            run.abandon(self._next)
            self._next = []

    def _challenge(self, best: Neighbourhood, most: float) -> None:
        """Search from another start unless it is behind already; the better of two goes on."""
        start = self._another_pass()
        if not start:
            return
        other = self._begun(start)
        early = len(other.parts)
        if early < self._ahead:
            self._improve(other, most)
        if cost(other.best) < cost(best.best):
            self._state, self._ahead = other, early

    def _improve(self, state: Neighbourhood, most: float) -> None:
        """Search from a start until it has saved nothing in the work of the first pass.

        That is about what another start takes until it shows what it is worth.
        """
        steps, accepted = state.steps, state.accepted
        state.improve(most - self.steps + steps, self._context.first_pass)
        self.steps += state.steps - steps
        self.accepted += state.accepted - accepted
        self._note(state)

    def _note(self, state: Neighbourhood) -> None:
        if cost(state.best) < cost(self.best):
            if len(state.best) < len(self.best):
                self.gained = state.gained
            self.best = state.best

    def _begun(self, parts: list[Part]) -> Neighbourhood:
        """Offer each part of a start to those around."""
        run, context = self._run, self._context
        with run.limited(self._context.first_pass):
            parts = grow_cover(parts, context.criterion, run)
        if self._state is None:
            self.early = parts
        state = Neighbourhood(replace(context, seed=context.seed + self.starts), parts, run)
        self.starts += 1
        state.redistribute_all()
        self.accepted += state.accepted
        self._note(state)
        return state

    def _begin_pass(self) -> None:
        """Begin the next pass beside what goes on, if enough work is left for both."""
        most = ANOTHER_PASS * self._context.first_pass
        if not self._next and self._run.work.left >= 2 * most:
            self._next = [self._run.apart(partial(self._pass, self._passes), most)]

    def _another_pass(self) -> list[Part]:
        """The parts of the next pass; none if it takes too much work."""
        run, most = self._run, ANOTHER_PASS * self._context.first_pass
        if run.work.left < most:
            return []
        other = self._next.pop() if self._next else run.apart(partial(self._pass, self._passes), most)
        self._passes += 1
        parts = run.result(other.begun)
        run.work.pay(other.account.done)
        return parts

    def _pass(self, number: int, run: Run) -> list[Part]:
        """The parts of a pass by another score, among other planes; none if it takes too much work."""
        context = self._context
        policy = Greedy(STARTS[number % len(STARTS)], sweeps=SweepCache(seed=(context.seed, number)))
        tree = CutTree(context.root, policy, run)
        other = cut_and_merge(tree, context.criterion, run, most=self._most, strict=True)
        return [] if run.is_over else other.parts
