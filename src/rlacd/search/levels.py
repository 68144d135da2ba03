"""Quality levels: how much to search after the first pass, and the limits of a search."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rlacd.clock import Clock
from rlacd.cut import CutCache, CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import drop_slivers
from rlacd.search.budget import SearchBudget
from rlacd.search.context import Ranking, SearchContext
from rlacd.search.neighbourhood import Neighbourhood, SearchOutcome, cost
from rlacd.search.tighten import tighten
from rlacd.solid.component import Part
from rlacd.work import Work

SHARE = 2 / 5
"""Passes over the whole solid are made while one takes at most this share of the seconds left."""

HOPELESS = 5
"""A pass is abandoned when its pieces outnumber the parts by this factor: merging will not make up for that."""

TIMES_FIRST_PASS = 3.5
"""Limit on the work of a search, as a multiple of the work of the first pass."""

LEAST_WORK, MOST_WORK = 0.15e6, 6e6
"""Absolute limits on that limit, in units: about 0.15 and 6 seconds of one core."""

TIMES_STEPPED, WORK_OF_A_STEP = 3, 1e5
"""The work allowed beyond that where only the number of steps is limited, for the passes and eliminations that are not
counted as steps, and for each step: far more than most take."""

ANOTHER_PASS = 1.5
"""A pass is abandoned when it exceeds this multiple of the work of the first."""

FEW = 20
"""With more parts than this, searching around the first pass gains more per unit of work than another pass."""

BOUNDED_PATIENCE = 4
"""A bounded search gives up after this many trials per part without a gain (research/search.md)."""

ROUNDS = 3
"""If time allows, the search starts this many times from every pass of the portfolio, each time with another seed."""

FURTHER = 1000
"""Added to the seed when the search continues after its opening."""


@dataclass(frozen=True)
class Level:
    """How much to search.

    Attributes
    ----------
    name : str
    steps : int or None
        Maximum number of steps of the neighbourhood search.
    seconds : float or None
        Maximum wall time of the search.
    bounded : bool
        The search starts with an opening whose work is limited to a multiple of that of the first pass. The opening is
        completed even if it takes longer than `seconds`.
    """

    name: str
    steps: int | None
    seconds: float | None
    bounded: bool = False


LEVELS = {
    "fast": Level("fast", 0, None),
    "balanced": Level("balanced", None, None, bounded=True),
    "best": Level("best", None, 5.0, bounded=True),
}
"""The levels when neither steps nor seconds are given. Each visits all states of the level below, so it is never
worse."""


def level(quality: str, seconds: float | None, steps: int | None) -> Level:
    """Get the level called `quality`; for levels that search, given limits replace all of its own."""
    if quality == "fast" or (seconds is None and steps is None):
        return LEVELS[quality]
    return Level(quality, steps, seconds)


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
        Trials of the neighbourhood search.
    accepted : int
        Trials that were accepted.
    exhausted : bool
        Nothing new was left to try, or no trial had saved a part for a long time.
    work : int
        Units of work done (see `rlacd.work`).
    allowed : int or None
        Limit on the work, if the level has one.
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

    def as_plain(self) -> dict[str, Any]:
        """All fields as plain values."""
        return asdict(self)


def search(
    context: SearchContext,
    parts: Sequence[Part],
    level: Level,
    clock: Clock,
    *,
    most_parts: int | None = None,
    first: str = "",
) -> tuple[list[Part], SearchSummary]:
    """Search for fewer parts, or for equally many with a smaller total hull volume.

    Parameters
    ----------
    context : SearchContext
    parts : sequence of Part
        A decomposition of the solid.
    level : Level
        Limits of the search.
    clock : Clock
        Its work so far is taken as the work of the first pass.
    most_parts : int, optional
        Limit on the number of parts. If there are no more parts than this and some do not meet the criterion, search
        for parts that come closer to meeting it instead.
    first : str
        The policy of the first pass, which is not repeated.

    Returns
    -------
    parts : list of Part
        Never worse than the given ones. They depend on the seed and the steps, and on time only if `seconds` or the
        clock ends the search.
    summary : SearchSummary
    """
    start = time.perf_counter()
    steps = math.inf if level.steps is None else level.steps
    # Slivers would be dropped at the end anyway; if they counted here, a level could end with more hulls than the one
    # below it.
    parts = drop_slivers(parts, context.workers)
    at_a_limit = most_parts is not None and not all(context.workers.map(context.criterion.is_met, parts))
    first_pass = clock.work.done
    bounded = level.bounded and not (at_a_limit and level.seconds is not None)
    allowed = TIMES_STEPPED * first_pass + MOST_WORK + WORK_OF_A_STEP * steps if level.seconds is None else math.inf
    if bounded:
        allowed = min(max(TIMES_FIRST_PASS * first_pass, LEAST_WORK), MOST_WORK)
    budget = SearchBudget(clock, level.seconds, len(parts), patient=bounded, work=Work(allowed))
    if most_parts is not None and at_a_limit:
        if len(parts) <= most_parts:
            outcome = tighten(context, parts, most_parts, budget, steps)
        else:  # merging could not reach the limit
            outcome = SearchOutcome(parts, 0, 0, True)
        from_portfolio = len(parts)
    else:
        # greedy has already used the first score
        others = context.rankings[1:] if first == "greedy" else context.rankings
        opening = others if not bounded else others[:1] if len(parts) <= FEW else []
        a_pass = _seconds_of_a_pass(clock)
        pieces = HOPELESS * len(parts)
        starts = _portfolio(context, parts, opening, budget, a_pass, pieces, ANOTHER_PASS * first_pass)
        from_portfolio = len(starts[0])
        if bounded:
            state = Neighbourhood(context, starts[0], BOUNDED_PATIENCE)
            outcome = state.run(budget, steps)
        else:
            outcome = _from_all(context, starts, budget, steps)
        if bounded and level.seconds is not None:
            budget.hurry()
            pieces = HOPELESS * len(outcome.parts)
            starts = _portfolio(context, outcome.parts, others[len(opening) :], budget, a_pass, pieces)
            further = replace(context, seed=context.seed + FURTHER)
            outcome = outcome.then(_from_all(further, starts, budget, steps))
    summary = SearchSummary(
        level=level.name,
        seconds=time.perf_counter() - start,
        first_pass=len(parts),
        portfolio=from_portfolio,
        parts=len(outcome.parts),
        steps=outcome.steps,
        accepted=outcome.accepted,
        exhausted=outcome.exhausted,
        work=budget.work.done,
        allowed=None if math.isinf(allowed) else math.floor(allowed),
    )
    return outcome.parts, summary


def eliminate_parts(context: SearchContext, parts: Sequence[Part], clock: Clock) -> list[Part]:
    """Try once to eliminate each part by redistributing it to the parts around it; parts that cannot go stay.

    This is the only search inside a pass, and only used where it is quick: where hulls are tested against balls.
    """
    state = Neighbourhood(replace(context, rankings=()), parts)
    state.redistribute_all(SearchBudget(clock, None, len(parts)))
    return state.parts


def _seconds_of_a_pass(clock: Clock) -> float:
    return clock.seconds.get("cut", 0.0) + clock.seconds.get("merge", 0.0)


def _portfolio(
    context: SearchContext,
    parts: list[Part],
    rankings: Sequence[Ranking],
    budget: SearchBudget,
    seconds: float,
    most: float,
    work: float = math.inf,
) -> list[list[Part]]:
    """The given parts and those of further passes, one for each ranking; best first.

    `seconds` is the expected duration of a pass. A pass that has more than `most` pieces or needs more than `work`
    is abandoned.
    """
    cache = CutCache()
    found = [parts]
    for ranking in rankings:
        if budget.is_over or len(parts) == 1 or seconds > SHARE * budget.left:
            break
        tree = CutTree(context.root, ranking(context.sweeps), context.workers, cache)
        with budget.allowance(work):
            other = cut_and_merge(tree, context.criterion, context.workers, budget, most=most, strict=True)
            if other.unmet or budget.is_over:
                continue
        if all(cost(other.parts) != cost(known) for known in found):
            found.append(other.parts)
            budget.parts = min(budget.parts, len(other.parts))
    return sorted(found, key=cost)


def _from_all(
    context: SearchContext, starts: Sequence[list[Part]], budget: SearchBudget, steps: float
) -> SearchOutcome:
    """Search from the best start, then from the next whenever a search is exhausted, for `ROUNDS` rounds."""
    best = starts[0]
    total = accepted = 0
    exhausted = False
    for number in range(ROUNDS * len(starts)):
        state = Neighbourhood(replace(context, seed=context.seed + number), starts[number % len(starts)])
        outcome = state.run(budget, steps - total)
        total += outcome.steps
        accepted += outcome.accepted
        exhausted = outcome.exhausted
        best = min(best, outcome.parts, key=cost)
        if not exhausted:
            break
    return SearchOutcome(best, total, accepted, exhausted)
