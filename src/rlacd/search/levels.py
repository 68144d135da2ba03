"""Quality levels: how much is searched after the first pass of cuts, and the bounds of a search."""

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
"""Scores by which the whole solid is cut anew, the better first."""

assert set(PORTFOLIO) <= set(SCORES)

SHARE = 2 / 5
"""The whole solid is cut anew while that takes no more than this share of the seconds that are left."""

HOPELESS = 5
"""A pass that makes so many times more pieces than there are parts will not have fewer of them after merging."""

TIMES_FIRST_PASS = 7.5
"""The work a search may do, in that of the first pass."""

MOST_WORK = 10e6
"""And no more than this, about ten seconds of one core."""

ANOTHER_PASS = 1.5
"""A pass is given up when it is this many times the work of the first."""

FEW = 20
"""Among more parts than this, work gains more around the first pass than by cutting the whole solid anew."""

ROUNDS = 3
"""The search goes around so many times from every pass of the portfolio, with other chances, if there is time."""

FURTHER = 1000
"""Added to the seed when the search goes on after its opening."""

PLANES_PER_AXIS = 12
"""Neighbourhoods are small: half the planes are as good in them, and twice as fast."""

CONCAVE_EDGES = 2
"""None, two and four came out alike: 0.82, 0.81 and 0.81 of the parts after 4 s on nine meshes of one seed."""


@dataclass(frozen=True)
class Level:
    """How much is searched.

    Attributes
    ----------
    steps : int or None
        Steps of the neighbourhood search at most.
    seconds : float or None
        Wall time of the search at most.
    bounded : bool
        The search begins with an opening whose work is bounded by that of the first pass, even if the seconds do not
        suffice for it.
    """

    steps: int | None
    seconds: float | None
    bounded: bool = False


LEVELS = {
    "fast": Level(0, None),
    "balanced": Level(None, None, bounded=True),
    "best": Level(None, 5.0, bounded=True),
}
"""What the levels mean when neither steps nor seconds are given. Each goes through the states of the one before it, so
that it is never worse."""


def level(quality: str, seconds: float | None, steps: int | None) -> Level:
    """Get the level called `quality` with other bounds: those given replace its own."""
    if quality == "fast" or (seconds is None and steps is None):
        return LEVELS[quality]
    return Level(steps, seconds)


@dataclass
class SearchSummary:
    """What a search reports.

    Attributes
    ----------
    level : str
    seconds : float
        Wall time it took.
    first_pass, portfolio, parts : int
        Parts before it, after the best of the portfolio, and in the end.
    steps : int
        Trials of the neighbourhood search.
    accepted : int
        Trials that were taken over.
    exhausted : bool
        There was nothing left to try, or it had been in vain for long.
    work : int
        Units of work done (see `rlacd.work`).
    allowed : int or None
        The bound on it, where the level has one.
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
        """Everything as plain values."""
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
    """Look for fewer parts, or as many with less volume in their hulls.

    Parameters
    ----------
    root : Component
        The solid.
    parts : sequence of Part
        A decomposition of it.
    criterion : Criterion
        What every new part will meet.
    name : str
        Of the level, for the account.
    bounds : Level
        When to stop.
    views : Views
        Sweeps of the solid's components, those of the first pass among them.
    seed : int
    most_parts : int, optional
        Where the parts are so few and do not meet the criterion, look for parts that come closer to it instead.
    rankings : sequence of Ranking, optional
        Each cuts the whole solid anew, where that takes little time, and neighbourhoods; the scores of `PORTFOLIO` by
        default.
    first : str
        The policy of the first pass, which need not be repeated.

    Returns
    -------
    parts : list of Part
        Never worse than those given. Depends on the seed and the steps, and on time only where the seconds or the
        clock end the search.
    account : Account
    """
    start = time.perf_counter()
    steps = math.inf if bounds.steps is None else bounds.steps
    rankings = rankings or [by_score(score) for score in PORTFOLIO]
    near_sweeps = SweepCache(PLANES_PER_AXIS, CONCAVE_EDGES)
    # What the finish would drop must not count, or a level could end with more hulls than the one below it.
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
        else:  # parts that cannot be united
            outcome = SearchOutcome(best, 0, 0, True)
        from_portfolio = len(parts)
    else:
        others = rankings[1:] if first == "greedy" else rankings  # the first score is that policy's own
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
    """Try once to do without each part of a solid, by dividing it among those around; the same parts where that fails.

    All the search there is in one pass, and only where it is quick: where hulls are held against balls.
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
    """The given parts, made in so many seconds, and those of the whole solid cut by other rankings; the best first.

    A pass that needs more than the given work is given up.
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
    """Search around the best start; when nothing is left to try there, around the next, and all over again."""
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
