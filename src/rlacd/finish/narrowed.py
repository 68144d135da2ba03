"""Passages of the solid that its hulls narrow or close: where, how wide they were, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.limited import LimitedCriterion, least_kept
from rlacd.find_parts import Reached
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray, dots
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS, ROUNDING
from rlacd.solid.hull import Hull
from rlacd.solid.passages import FACES, Density, passage_balls
from rlacd.solid.primitive import Balls

NARROWEST = 8 * HALF_THICKNESS
"""Radius of the narrowest passages looked for (the longest side is 2): folds of scans and gaps of sheets are such."""

LEAST_LOSS = 0.1
"""Share of its radius that a passage has to lose to be listed."""

MOSTLY = 1 / 2
"""Share of its radius below which there is a warning of a passage wider than the tolerance."""

DENSITY = Density(600, 0.5)

MOST_BALLS = 600
"""Balls that are looked at: the wide ones that lose most come first."""

MOST_NAMED = 3
"""Passages of which a warning says the place."""

BETWEEN = 0.02
"""Share of its radius that a passage kept open may lose more: its walls are kept off balls that are apart."""

_NEIGHBOURS = 8
_ON_THE_WAY = np.linspace(0, 1, 9)[1:-1, None]


class Narrowed(NamedTuple):
    """The passages that hulls narrow by more than a tenth, the most narrowed first.

    Attributes
    ----------
    passages
        One entry each: around ``at_abs``, a ball of ``radius_abs`` fits in the input, one of ``left_abs`` between the
        hulls.
    is_every
        Whether these are all: no triangle and no ball was left out.
    by_limits
        Whether a limit on hulls undid what cutting had kept open.
    """

    passages: list[dict[str, Any]]
    is_every: bool = True
    by_limits: bool = False


def narrowed(reached: Reached, hulls: Sequence[Hull], over: float, run: Run) -> Narrowed:
    """Find the passages that hulls narrow, which reach out by at most `over` in the frame: no passage loses more."""
    most = min(over / LEAST_LOSS, 2.0)
    if reached.root is None or most <= NARROWEST:
        return Narrowed([])
    threads, frame, solid = run.threads, reached.solid.frame, reached.solid.mesh
    surface, union = reached.root.filling.surface, hull_union(hulls, threads)

    def lose(balls: Balls) -> BoolArray:
        return union.distance(balls.centres, threads) < (1 - LEAST_LOSS) * balls.radii

    balls = passage_balls(solid, surface, (NARROWEST, most), DENSITY, threads, lose)
    is_every = len(solid[1]) <= FACES and len(balls) <= MOST_BALLS
    # Wide and narrow ones apart: neither hides what is left of the other.
    wide = (balls.radii[:, None] >= _wide(reached)).sum(axis=1)
    covered = union.distance(balls.centres, threads) / balls.radii
    kept = np.lexsort([covered, -wide])[:MOST_BALLS]
    balls, wide, covered = balls.some(kept), wide[kept], covered[kept]
    order = np.argsort(covered, kind="stable")
    passage = _passages(balls, wide, surface, threads)[order]
    worst = order[np.sort(np.unique(passage, return_index=True)[1])]  # of each passage
    worst = worst[covered[worst] < 1 - LEAST_LOSS]
    left = np.where(covered[worst] > ROUNDING, covered[worst], 0.0) * balls.radii[worst]
    places, lengths = frame.to_input(balls.centres[worst]), np.stack([balls.radii[worst], left]) / frame.scale
    entries = [
        {"at_abs": at, "radius_abs": radius, "left_abs": rest}
        for at, radius, rest in zip(places.tolist(), *lengths.tolist(), strict=True)
    ]
    return Narrowed(entries, is_every, _by_limits(reached, union, threads))


def _by_limits(reached: Reached, union: _native.HullUnion, threads: int) -> bool:
    options, goal = reached.options, reached.goal
    if not isinstance(goal, LimitedCriterion) or (options.max_hulls is None and not any(options.hull_limits)):
        return False
    return bool((union.distance(goal.kept.centres, threads) < goal.kept.radii - ROUNDING).any())


def _wide(reached: Reached) -> list[float]:
    """Radii in the frame from which passages are warned of, and from which they were to stay open."""
    return [reached.options.threshold, least_kept(reached.options, reached.solid.frame.scale)]


def _passages(balls: Balls, kind: NDArray[np.intp], surface: _native.Surface, threads: int) -> NDArray[np.int64]:
    """The number of the passage in which each ball stands: between near ones of a kind, half of the larger can go."""
    each = np.arange(len(balls))
    passage, joined = each.astype(np.int64), np.empty((2, 0), dtype=np.int64)
    ways = balls.centres[:, None] - balls.centres
    squares = np.where(kind[:, None] == kind, dots(ways, ways), np.inf)
    while True:  # near ones of other passages, until none meet
        away = np.where(passage[:, None] == passage, np.inf, squares)
        near = np.argsort(away, axis=1, kind="stable")[:, :_NEIGHBOURS]
        pairs = np.stack([np.repeat(each, near.shape[1]), near.ravel()])
        pairs = pairs[:, np.isfinite(away[pairs[0], pairs[1]])]
        meet = _have_a_way(balls, pairs, np.sqrt(squares[pairs[0], pairs[1]]), surface, threads)
        if not meet.any():
            return passage
        joined = np.concatenate([joined, pairs[:, meet]], axis=1)
        passage = _native.components(len(balls), *joined)[1]


def _have_a_way(
    balls: Balls, pairs: NDArray[np.intp], lengths: FloatArray, surface: _native.Surface, threads: int
) -> BoolArray:
    # With so much room at both ends and in every eighth of the way, nothing stands in it between them either.
    room, (first, second) = lengths / 16, pairs
    ends = np.sort(balls.radii[pairs], axis=0)
    needed = np.where(ends[0] > room, np.maximum(ends[1] / 2, room), np.inf)
    start, end = balls.centres[first, None], balls.centres[second, None]
    ways = np.ascontiguousarray((start + _ON_THE_WAY * (end - start)).reshape(-1, 3))
    free: BoolArray = surface.distance(ways, threads).reshape(-1, len(_ON_THE_WAY)).min(axis=1) > needed
    return free


def too_narrow(found: Narrowed, reached: Reached, is_stopped: bool) -> list[str]:
    """Warn of passages that keep less than asked for, and of others wider than the tolerance that lose over half."""
    options, scale, asked, others = reached.options, reached.solid.frame.scale, [], []
    for at, radius, left in (one.values() for one in found.passages):
        if radius * scale >= least_kept(options, scale):
            if left < (options.keep_open or 0.0) * radius + (options.keep_open_abs or 0.0) - BETWEEN * radius:
                asked.append((at, radius, left))
        elif radius * scale >= options.threshold and left < MOSTLY * radius:
            others.append((at, radius, left))
    by_limits = "limits on the hulls leave no other way" if found.by_limits else ""
    reason = "the work was stopped before" if is_stopped else by_limits
    cure = (
        f"--keep-open, or a smaller {'threshold' if 'threshold' in options.numbers else 'tolerance'}, keeps more open"
    )
    return [
        _narrows(lost, "" if found.is_every else "At least ", by, then)
        for lost, by, then in ((asked, "more than --keep-open allows", reason), (others, "over half", cure))
        if lost
    ]


def _narrows(lost: list[tuple[list[float], float, float]], at_least: str, share: str, then: str) -> str:
    closed = sum(left == 0 for _, _, left in lost)
    lost = sorted(lost, key=lambda one: (one[2] / one[1], -one[1]))
    named = [
        f"near ({', '.join(f'{x:.4g}' for x in at)}) from a radius of {radius:.4g} to {left:.4g}"
        for at, radius, left in lost[:MOST_NAMED]
    ]
    more = "" if len(lost) <= MOST_NAMED else " and others (see `passages`)"
    return (
        f"{at_least}{len(lost)} passage{'s narrow' if len(lost) > 1 else ' narrows'} by {share}"
        f"{f', {closed} to nothing' if closed else ''}: {', '.join(named)}{more}{then and f'; {then}'}."
    )
