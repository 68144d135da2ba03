"""Within the limits: parts whose hulls would have too many corners are cut on; parts are united until there are few."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion, LimitedCriterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import MOST_CUTTING, cut_and_merge
from rlacd.merge import merge_parts
from rlacd.merge.numbered import NumberedParts
from rlacd.merge.unite import ByGrowth, united
from rlacd.options import Options
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.run import Run, Work, work
from rlacd.search.levels import eliminate_parts
from rlacd.search.neighbourhood import SearchContext
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Part
from rlacd.solid.hull import NO_SIDES
from rlacd.solid.resting import resting_sides

TIMES_PARTS = 2
"""Cutting on for fewer corners multiplies the parts by at most this."""

SHARE_OF_WORK, LEAST_SHARE = 0.3, 0.4e6
"""Share of the work done so far that cutting on may take, and merging as much again; at least so many units."""

PIECES = 2
"""Cutting on stops at so many times the parts that may be added: merging leaves half of them."""

STILL_MANY = 1.5
"""Parts are not united if a coarser goal leaves more than so many times the hulls asked for: of 27 real meshes held to
8 hulls none takes more than 2.9 times as long as without the limit, not 9 times; they fit 2% worse."""

NEARLY_EQUAL = 1.02
"""Errors within this factor are equal: they are measured to a fiftieth of the threshold."""

FIRST_REACH = 0.05
"""Where few hulls are asked for, parts within this (the longest side is 2) are united before all others."""


def _limited(goal: Criterion, solid: Component, options: Options) -> LimitedCriterion:
    """A goal that limited hulls have to meet, too; they stay within the sides on which the solid rests."""
    sides = resting_sides(solid) if any(options.hull_limits) else NO_SIDES
    return LimitedCriterion(goal, options.hull_limits, sides=sides)


def cut_to_limits(parts: list[Part], goal: Criterion, solid: Component, options: Options, run: Run) -> list[Part]:
    """Cut on parts whose hulls fail the goal only because of the limits.

    First with hulls kept within the sides on which the solid rests, then without: the criterion comes first.
    """
    most = int(min(TIMES_PARTS * len(parts), options.max_hulls or math.inf))
    with run.stage("limit"), run.until_stopped():
        limited = _limited(goal, solid, options)
        for goal in (limited, replace(limited, sides=NO_SIDES)) if len(limited.sides) else (limited,):
            parts = _cut_for(goal, parts, most - len(parts), solid, options, run)
    return parts


def _cut_for(
    limited: LimitedCriterion, parts: list[Part], extra: int, solid: Component, options: Options, run: Run
) -> list[Part]:
    """Cut parts into at most `extra` more pieces, those that take few first.

    A part stays whole if its pieces would not meet it either, or if there would be too many parts. A body that is one
    part, such as a ball, always stays one.
    """
    if extra < 1 or len(parts) == 1:
        return parts
    cut = parts
    with run.until_stopped():
        met = run.map(limited.is_met, parts)
        with run.limited(max(SHARE_OF_WORK * run.work.done, LEAST_SHARE)):
            pieces: dict[Part, list[Part]] = {}
            for part, is_met in sorted(zip(parts, met, strict=True), key=lambda item: len(item[0].hull.vertices)):
                price = work.limiting(len(part.hull.vertices))
                if not is_met and limited.criterion.is_met(part) and run.work.pay(price):
                    pieces[part] = _cut_on(part, limited, solid, options, run, extra)
            kept = {part: [part] for part in parts}
            for part, new in sorted(pieces.items(), key=lambda item: len(item[1])):
                if 1 <= len(new) <= extra + 1:
                    extra -= len(new) - 1
                    kept[part] = new
            cut = [piece for part in parts for piece in kept[part]]
        if len(cut) > len(parts) and options.merge:
            with run.limited(max(SHARE_OF_WORK * run.work.done, LEAST_SHARE)):
                cut = merge_parts(cut, limited, run)
                context = SearchContext(solid, limited, options.seed)
                cut = eliminate_parts(context, cut, run)
    return cut


def _cut_on(part: Part, limited: Criterion, solid: Component, options: Options, run: Run, extra: int) -> list[Part]:
    """The pieces of a part, all of which meet the criterion; none if there are too many."""
    inside = solid.inside(part.hull)
    if inside is None:
        return []
    policy = make_policy(options.first_policy, SweepCache(), limited.outward_deviation)
    tree = CutTree(inside, policy, run)
    done = cut_and_merge(tree, limited, run, merge=options.merge, most=PIECES * (extra + 1), strict=True)
    return done.parts if len(done.parts) <= extra + 1 and not run.is_over else []


def at_most(
    most: int,
    decompositions: Iterable[Sequence[Part]],
    whole: Component,
    goal: Criterion,
    options: Options,
    run: Run,
) -> list[Part]:
    """Get at most `most` parts whose largest error is least.

    Parameters
    ----------
    most : int
        A larger number allows more of the same states, so the error is never larger.
    decompositions : iterable of sequence of Part
        Under coarser and coarser goals. Their parts are united two at a time, and every state on the way counts, unless
        a coarser one has more than `STILL_MANY` times `most`.
    whole : Component
        The solid, which is left as one part if there is no time.
    goal : Criterion
        Measures the error of the hulls that parts end with, within the limits; parts are united by that of their exact
        hulls.
    options : Options
    run : Run
    """
    best, least, errors = list[Part]([whole]), math.inf, dict[Part, float]()
    with run.until_stopped():
        limited = _limited(goal, whole, options)
        for parts in itertools.chain([[whole]], few_enough(decompositions, most)):
            for state, error in united_in_turn(parts, goal, Work(MOST_CUTTING), run):
                if error > NEARLY_EQUAL * least:
                    break  # unions only make it larger
                if len(state) > most:
                    continue
                new = [part for part in state if part not in errors]
                errors.update(zip(new, run.map(limited.error, new), strict=True))
                if (error := max(errors[part] for part in state)) < least:
                    best, least = state, error
    return best


def united_in_turn(
    parts: Sequence[Part], criterion: Criterion, account: Work, run: Run
) -> Iterator[tuple[list[Part], float]]:
    """Unite parts, always the pair whose union has the least error, until one is left; yield each state and its error.

    First neighbours are united, then any parts.

    Parameters
    ----------
    parts : sequence of Part
    criterion : Criterion
        Measures the errors; unions need not meet it.
    account : Work
        Pays for measuring. When it is spent, or the run ends, nothing is united any more.
    run : Run
    """
    alive = NumberedParts(parts, criterion)
    errors = dict(zip(alive.parts, run.map(criterion.error, parts), strict=True))
    yield alive.in_order(), max(errors.values())
    for reach in (FIRST_REACH, math.inf):
        if account.is_spent:
            return  # bounding all pairs would be in vain
        for pair, number in united(alive, _ByError(criterion, across=False, reach=reach), account, run):
            errors[number] = pair.cost
            del errors[pair.first], errors[pair.second]
            yield alive.in_order(), max(errors.values())


@dataclass(frozen=True)
class _ByError(ByGrowth):
    """The error of the union, which the volumes alone tell some of."""

    reach: float

    def pairs(self, alive: NumberedParts, new: Sequence[int]) -> IntArray:
        return alive.boxes.pairs(new, self.reach)

    def bounds(self, alive: NumberedParts, pairs: IntArray, account: Work, threads: int) -> FloatArray | None:
        hulls = _native.joint_hull_volumes(alive.bodies, pairs, threads)
        return np.array([*map(self.criterion.volume_error, alive.sums(pairs)[1].tolist(), hulls.tolist())])

    def cost(self, union: Part, bound: float) -> float:
        return self.criterion.error(union)


def few_enough(decompositions: Iterable[Sequence[Part]], most: int) -> Iterator[Sequence[Part]]:
    """The decompositions without those that a coarser one stands for; more are left for a larger number."""
    finer: list[Sequence[Part]] = []
    for parts in decompositions:
        finer = [parts] if len(parts) > STILL_MANY * most else [*finer, parts]
        if len(parts) <= most:
            yield from finer
            finer = []
    yield from finer
