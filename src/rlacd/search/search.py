"""Search for fewer parts: the quality levels, and the bounds of each."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rlacd.cut import CutCache, CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import drop_slivers, grow_cover
from rlacd.policies import Greedy
from rlacd.run import Run
from rlacd.search.neighbourhood import FEW_PARTS, PATIENCE, Neighbourhood, SearchContext, SearchOutcome, cost
from rlacd.solid.component import Part

BEST_SECONDS = 5.0
"""What ``best`` may take by default, more if its first search takes longer."""

TIMES_FIRST_PASS = 4.0
"""Limit on the work of a bounded search, as a multiple of the work of the first pass."""

LEAST_WORK, MOST_WORK = 0.15e6, 6e6
"""Absolute limits on that limit, in units: about 0.15 and 6 seconds of one core."""

WORK_OF_A_STEP = 1e5
"""Where only the number of steps is limited, the work allowed for each: far more than most take."""

BOUNDED_PATIENCE = 2
"""A bounded search gives up after this many trials per part without a gain."""

ANOTHER_PASS = 1.5
"""Another pass over the whole solid is abandoned when it exceeds this multiple of the work of the first, ..."""

HOPELESS = 5
"""... or when its pieces outnumber the parts by this factor: merging will not make up for that."""

SHARE_OF_TIME = 2 / 5
"""Further passes are made while one takes at most this share of the seconds left."""

ROUNDS = 3
"""If time allows, the search starts this many times from every pass, each time with another seed."""


@dataclass
class SearchSummary:
    """Summary of a search.

    Attributes
    ----------
    level : str
    seconds : float
        Wall time of the search.
    first_pass, portfolio, parts : int
        Number of parts before the search, after the best pass of the portfolio, and at the end.
    steps : int
        Recuts of clusters.
    accepted : int
        Trials that were accepted.
    exhausted : bool
        No trial had saved a part for a long time, or no fewer can do.
    work : int
        Units of work done (see `rlacd.run.work`).
    allowed : int or None
        Limit on the work, if the level has one.
    at_least : int
        No decomposition to this tolerance has fewer parts.
    """

    level: str
    seconds: float
    first_pass: int
    portfolio: int
    parts: int
    steps: int
    accepted: int
    exhausted: bool
    work: int
    allowed: int | None
    at_least: int

    def as_plain(self) -> dict[str, Any]:
        """All fields as plain values."""
        return asdict(self)


def search(
    context: SearchContext,
    parts: Sequence[Part],
    run: Run,
    quality: str,
    seconds: float | None = None,
    steps: int | None = None,
) -> tuple[list[Part], SearchSummary]:
    """Search for fewer parts, or for equally many with a smaller total hull volume.

    Without limits of its own, the search does a bounded multiple of the work of the first pass; ``best`` then goes on
    until its seconds are over.

    Parameters
    ----------
    context : SearchContext
    parts : sequence of Part
        A decomposition of the solid.
    run : Run
        Its work so far is taken as the work of the first pass.
    quality : "balanced" or "best"
    seconds : float, optional
        Wall time of the search, in place of that bound.
    steps : int, optional
        Recuts of clusters, in place of that bound.

    Returns
    -------
    parts : list of Part
        Never worse than the given ones. They depend on the seed and the steps, and on time only if `seconds` or the
        run ends the search.
    summary : SearchSummary
    """
    # Slivers would be dropped at the end anyway; if they counted here, a level could end with more hulls than the one
    # below it.
    parts = drop_slivers(parts, run)
    begin, first_pass, so_far = time.perf_counter(), run.work.done, run.seconds.copy()
    a_pass = so_far.get("cut", 0.0) + so_far.get("merge", 0.0)
    bounded = seconds is None and steps is None
    allowed = math.inf
    if bounded:
        allowed = min(max(TIMES_FIRST_PASS * first_pass, LEAST_WORK), MOST_WORK)
    elif steps is not None and seconds is None:
        allowed = TIMES_FIRST_PASS * first_pass + MOST_WORK + WORK_OF_A_STEP * steps
    others = context.scores[1:] if context.first_policy == "greedy" else context.scores
    state = _Search(context, others, run, first_pass, a_pass, HOPELESS * len(parts))
    if bounded:
        with run.limited(allowed):
            starts = state.passes(parts, others[:1] if len(parts) <= FEW_PARTS else [])
            done = Neighbourhood(context, starts[0], run, BOUNDED_PATIENCE).improve()
        if quality == "best":
            with run.limited(seconds=BEST_SECONDS - (time.perf_counter() - begin)):
                done = done.then(state.from_all(done.parts))
    else:
        with run.limited(allowed, math.inf if seconds is None else seconds):
            done = state.from_all(parts, math.inf if steps is None else steps)
    summary = SearchSummary(
        level=quality,
        seconds=time.perf_counter() - begin,
        first_pass=len(parts),
        portfolio=int(min(state.fewest, len(parts))),
        parts=len(done.parts),
        steps=done.steps,
        accepted=done.accepted,
        exhausted=done.exhausted,
        work=run.work.done - first_pass,
        allowed=None if math.isinf(allowed) else math.floor(allowed),
        at_least=context.enough(),
    )
    return done.parts, summary


def eliminate_parts(context: SearchContext, parts: Sequence[Part], run: Run) -> list[Part]:
    """Try once to redistribute each part to the parts around it; parts that cannot go stay.

    With `fast` it is the only search, for criteria that ask for it (`Criterion.eliminates`).
    """
    state = Neighbourhood(replace(context, scores=()), parts, run)
    state.redistribute_all()
    return state.parts


@dataclass
class _Search:
    """Passes over the whole solid, and searches from each."""

    context: SearchContext
    others: Sequence[str]
    run: Run
    first_pass: int
    seconds_of_a_pass: float
    hopeless: int
    fewest: float = math.inf

    def passes(self, parts: list[Part], scores: Sequence[str]) -> list[list[Part]]:
        """The given parts and those of further passes, one for each score; best first."""
        run, context, cache = self.run, self.context, CutCache()
        found = [parts]
        for score in scores:
            if (
                run.is_over
                or len(parts) <= context.enough()
                or self.seconds_of_a_pass > SHARE_OF_TIME * run.seconds_left
            ):
                break
            tree = CutTree(context.root, Greedy(score, sweeps=context.sweeps), run, cache)
            with run.quietly(), run.limited(ANOTHER_PASS * self.first_pass):
                other = cut_and_merge(tree, context.criterion, run, most=self.hopeless, strict=True)
                if other.unmet or run.is_over:
                    continue
            if all(cost(other.parts) != cost(known) for known in found):
                found.append(other.parts)
        for i, each in enumerate(found):
            with run.limited(self.first_pass):
                found[i] = grow_cover(each, context.criterion, run, context.root)
        found.sort(key=cost)
        self.fewest = min(self.fewest, len(found[0]))
        return found

    def from_all(self, parts: list[Part], steps: float = math.inf) -> SearchOutcome:
        """Search from the best pass, then from the next whenever a search is exhausted, for `ROUNDS` rounds."""
        starts = self.passes(parts, self.others)
        done = SearchOutcome(starts[0], 0, 0, False)
        for number in range(ROUNDS * len(starts)):
            context = replace(self.context, seed=self.context.seed + 1 + number)
            state = Neighbourhood(context, starts[number % len(starts)], self.run, PATIENCE)
            done = done.then(state.improve(steps - done.steps))
            if not done.exhausted:
                break
        return done
