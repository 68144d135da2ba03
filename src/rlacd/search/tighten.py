"""Search under a limit on the number of hulls: reduce the error without exceeding the limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rlacd.criteria.criterion import Criterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.run import Run
from rlacd.search.context import SearchContext
from rlacd.search.neighbourhood import Neighbourhood, SearchOutcome
from rlacd.solid.component import Part

ROUNDS = 6
"""Number of thresholds to try between the requested one and the one reached."""

CLOSE = 1.02
"""Thresholds closer than this factor are treated as equal."""


def tighten(context: SearchContext, parts: Sequence[Part], most_parts: int, run: Run, steps: float) -> SearchOutcome:
    """Search for at most `most_parts` parts that meet a finer threshold than the given parts do.

    The factor by which the threshold is exceeded is bisected. For each factor, the solid is cut and merged again, and a
    neighbourhood search tries to reduce the number of parts to `most_parts`.

    Parameters
    ----------
    context : SearchContext
        With the requested criterion.
    parts : sequence of Part
        At most `most_parts`.
    steps : float
        Maximum number of trials; every factor gets an equal share of them, and of the time.

    Returns
    -------
    SearchOutcome
        Its parts exceed the threshold by no larger a factor than the given ones.
    """
    criterion = context.criterion
    tree = CutTree(context.root, context.rankings[0](context.sweeps), run)
    best = list(parts)
    total = accepted = 0
    least, reached = 1.0, _factor(best, criterion, run)
    for left in range(ROUNDS, 0, -1):
        if run.is_over or reached <= least * CLOSE:
            break
        factor = math.sqrt(least * reached)
        finer = criterion.scaled(factor)
        with run.quietly(), run.limited(run.work.left / left, run.seconds_left / left):
            fine = cut_and_merge(tree, finer, run, strict=True)
            if fine.unmet or run.is_over:
                least = factor
                continue
            found = Neighbourhood(replace(context, criterion=finer), fine.parts, run).improve(
                math.floor((steps - total) / left) if math.isfinite(steps) else steps, most_parts
            )
        total += found.steps
        accepted += found.accepted
        if len(found.parts) <= most_parts:
            best, reached = found.parts, factor
        else:
            least = factor
    return SearchOutcome(best, total, accepted, False)


def _factor(parts: Sequence[Part], criterion: Criterion, run: Run) -> float:
    """Smallest factor (to within `CLOSE`) by which a criterion must be scaled for all parts to meet it."""

    def meets(factor: float) -> bool:
        return all(run.map(criterion.scaled(factor).is_met, parts))

    upper = 1.0
    while not meets(upper):
        upper *= 2
    lower = upper / 2
    while upper > 1 and upper > lower * CLOSE:
        middle = math.sqrt(lower * upper)
        lower, upper = (lower, middle) if meets(middle) else (middle, upper)
    return upper
