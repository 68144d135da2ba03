"""Quality levels: how much to search after the first pass, and the limits of a search."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.cut import CutCache, CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import drop_slivers
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies.greedy import SCORES
from rlacd.search.budget import SearchBudget
from rlacd.search.neighbourhood import Neighbourhood, SearchOutcome, cost
from rlacd.search.rankings import Ranking, by_score
from rlacd.search.tighten import tighten
from rlacd.solid.component import Component, Part
from rlacd.work import Work
from rlacd.workers import Workers

PORTFOLIO = ("excess-norm", "hull-sum", "max-excess")
"""Scores for further passes over the whole solid, best first."""

assert set(PORTFOLIO) <= set(SCORES)

SHARE = 2 / 5
"""Passes over the whole solid are made while one takes at most this share of the seconds left."""

HOPELESS = 5
"""A pass is abandoned when its pieces outnumber the parts by this factor: merging will not make up for that."""

TIMES_FIRST_PASS = 7.5
"""Limit on the work of a search, as a multiple of the work of the first pass."""

MOST_WORK = 10e6
"""Absolute limit on the work of a search in units: about ten seconds of one core."""

ANOTHER_PASS = 1.5
"""A pass is abandoned when it exceeds this multiple of the work of the first."""

FEW = 20
"""With more parts than this, searching around the first pass gains more per unit of work than another pass."""

ROUNDS = 3
"""If time allows, the search starts this many times from every pass of the portfolio, each time with another seed."""

FURTHER = 1000
"""Added to the seed when the search continues after its opening."""

PLANES_PER_AXIS = 12
"""Neighbourhoods are small: half the planes give results as good in half the time."""

CONCAVE_EDGES = 2
"""Zero, two and four make little difference: 0.82, 0.81 and 0.81 of the parts after 4 s (nine meshes, one seed)."""


@dataclass(frozen=True)
class Level:
    """How much to search.

    Attributes
    ----------
    steps : int or None
        Maximum number of steps of the neighbourhood search.
    seconds : float or None
        Maximum wall time of the search.
    bounded : bool
        The search starts with an opening whose work is limited to a multiple of that of the first pass. The opening is
        completed even if it takes longer than `seconds`.
    """

    steps: int | None
    seconds: float | None
    bounded: bool = False


LEVELS = {
    "fast": Level(0, None),
    "balanced": Level(None, None, bounded=True),
    "best": Level(None, 5.0, bounded=True),
}
"""The levels when neither steps nor seconds are given. Each visits all states of the level below, so it is never
worse."""


def level(quality: str, seconds: float | None, steps: int | None) -> Level:
    """Get the level called `quality`; for levels that search, given limits replace all of its own."""
    if quality == "fast" or (seconds is None and steps is None):
        return LEVELS[quality]
    return Level(steps, seconds)


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
    root: Component,
    parts: Sequence[Part],
    criterion: Criterion,
    name: str,
    bounds: Level,
    sweeps: SweepCache,
    workers: Workers,
    clock: Clock,
    seed: int,
    most_parts: int | None = None,
    rankings: Sequence[Ranking] | None = None,
    first: str = "",
) -> tuple[list[Part], SearchSummary]:
    """Search for fewer parts, or for equally many with a smaller total hull volume.

    Parameters
    ----------
    root : Component
        The solid.
    parts : sequence of Part
        A decomposition of the solid.
    criterion : Criterion
        Every new part meets it.
    name : str
        Name of the level, for the summary.
    bounds : Level
        Limits of the search.
    sweeps : SweepCache
        Sweeps of the solid's components, including those of the first pass.
    workers : Workers
    clock : Clock
        Its work so far is taken as the work of the first pass.
    seed : int
    most_parts : int, optional
        Limit on the number of parts. If there are no more parts than this and some do not meet the criterion, search
        for parts that come closer to meeting it instead.
    rankings : sequence of Ranking, optional
        Used to cut neighbourhoods and, if time allows, for further passes over the whole solid; the scores of
        `PORTFOLIO` by default.
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
    steps = math.inf if bounds.steps is None else bounds.steps
    rankings = rankings or [by_score(score) for score in PORTFOLIO]
    near_sweeps = SweepCache(PLANES_PER_AXIS, CONCAVE_EDGES)
    # Slivers would be dropped at the end anyway; if they counted here, a level could end with more hulls than the one
    # below it.
    best = parts = drop_slivers(parts, workers)
    at_a_limit = most_parts is not None and not all(workers.map(criterion.is_met, best))
    first_pass = clock.work.done
    bounded = bounds.bounded and not (at_a_limit and bounds.seconds is not None)
    allowed = min(TIMES_FIRST_PASS * first_pass, MOST_WORK) if bounded else math.inf
    budget = SearchBudget(clock, bounds.seconds, len(parts), patient=bounded, work=Work(allowed))
    if most_parts is not None and at_a_limit:
        if len(best) <= most_parts:
            outcome = tighten(
                root, best, criterion, most_parts, rankings, sweeps, near_sweeps, workers, budget, steps, seed
            )
        else:  # merging could not reach the limit
            outcome = SearchOutcome(best, 0, 0, True)
        from_portfolio = len(parts)
    else:
        others = rankings[1:] if first == "greedy" else rankings  # greedy has already used the first score
        opening = others if not bounded else others[:1] if len(best) <= FEW else []
        a_pass = _seconds_of_a_pass(clock)
        starts = _portfolio(root, best, criterion, opening, sweeps, workers, budget, a_pass, ANOTHER_PASS * first_pass)
        from_portfolio = len(starts[0])
        outcome = _from_all(root, starts, criterion, rankings, near_sweeps, workers, budget, steps, seed)
        if bounded and bounds.seconds is not None:
            budget.hurry()
            starts = _portfolio(root, outcome.parts, criterion, others[len(opening) :], sweeps, workers, budget, a_pass)
            outcome = outcome.then(
                _from_all(root, starts, criterion, rankings, near_sweeps, workers, budget, steps, seed + FURTHER)
            )
    summary = SearchSummary(
        level=name,
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


def eliminate_parts(
    root: Component, parts: Sequence[Part], criterion: Criterion, workers: Workers, clock: Clock, seed: int
) -> list[Part]:
    """Try once to eliminate each part by redistributing it to the parts around it; parts that cannot go stay.

    This is the only search inside a pass, and only used where it is quick: where hulls are tested against balls.
    """
    state = Neighbourhood(root, parts, criterion, (), SweepCache(), workers, seed)
    state.redistribute_all(SearchBudget(clock, None, len(parts)))
    return state.parts


def _seconds_of_a_pass(clock: Clock) -> float:
    return clock.seconds.get("cut", 0.0) + clock.seconds.get("merge", 0.0)


def _portfolio(
    root: Component,
    parts: list[Part],
    criterion: Criterion,
    rankings: Sequence[Ranking],
    sweeps: SweepCache,
    workers: Workers,
    budget: SearchBudget,
    seconds: float,
    work: float = math.inf,
) -> list[list[Part]]:
    """The given parts and those of further passes, one for each ranking; best first.

    `seconds` is the expected duration of a pass. A pass that needs more than `work` is abandoned.
    """
    cache = CutCache()
    found = [parts]
    for ranking in rankings:
        if budget.is_over or len(parts) == 1 or seconds > SHARE * budget.left:
            break
        tree = CutTree(root, ranking(sweeps), workers, cache)
        with budget.allowance(work):
            other = cut_and_merge(tree, criterion, workers, budget, most=HOPELESS * len(parts), strict=True)
            if other.unmet or budget.is_over:
                continue
        if all(cost(other.parts) != cost(known) for known in found):
            found.append(other.parts)
            budget.parts = min(budget.parts, len(other.parts))
    return sorted(found, key=cost)


def _from_all(
    root: Component,
    starts: Sequence[list[Part]],
    criterion: Criterion,
    rankings: Sequence[Ranking],
    sweeps: SweepCache,
    workers: Workers,
    budget: SearchBudget,
    steps: float,
    seed: int,
) -> SearchOutcome:
    """Search from the best start, then from the next whenever a search is exhausted, for `ROUNDS` rounds."""
    best = starts[0]
    total = accepted = 0
    exhausted = False
    for number in range(ROUNDS * len(starts)):
        state = Neighbourhood(root, starts[number % len(starts)], criterion, rankings, sweeps, workers, seed + number)
        outcome = state.run(budget, steps - total)
        total += outcome.steps
        accepted += outcome.accepted
        exhausted = outcome.exhausted
        best = min(best, outcome.parts, key=cost)
        if not exhausted:
            break
    return SearchOutcome(best, total, accepted, exhausted)
