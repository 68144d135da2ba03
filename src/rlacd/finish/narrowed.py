"""Passages of the solid that its hulls narrow or close: where, how wide they were, and what is left."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.limited import least_kept
from rlacd.find_parts import Reached
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray, dots
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import Hull
from rlacd.solid.passages import passage_balls
from rlacd.solid.primitive import Balls

NARROWEST = 8 * HALF_THICKNESS
"""Radius of the narrowest passages looked for (the longest side is 2): folds of scans and gaps of sheets are such."""

LEAST_LOSS = 0.1
"""Share of its radius that a passage has to lose to be listed."""

MOSTLY = 2 / 3
"""Share of its radius below which there is a warning."""

LEAST_EXTENT = 0.1
"""Of a passage along an axis; smaller ones are nicks. At a threshold of 0.05, 16 of 27 real meshes lose a passage of
any extent, 11 one of this."""

STARTS = 600
"""Points of the surface from which balls start, and as many triangles; of more balls, those that lose most count."""

MOST_LISTED = 50

LOOKED_AT = 5
"""Places along a passage at which what is left is measured."""

ACCURACY = LEAST_LOSS / 2
"""Share of its radius to within which what is left of a ball is measured; less counts as closed."""

_NEIGHBOURS = 8
_ON_THE_WAY = np.linspace(0, 1, 9)[1:-1, None]
_INSIDE = np.array(list(itertools.product(np.linspace(-0.5, 0.5, 7), repeat=3)))
_AROUND = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
_SEARCH = [(1.0, _INSIDE), *((2.0**-i, _AROUND) for i in (2, 3, 4, 5, 6) for _ in range(3))]


def narrowed(reached: Reached, hulls: Sequence[Hull], over: float, run: Run) -> list[dict[str, Any]]:
    """Find the passages that hulls narrow by more than a tenth, one entry each, the most narrowed first.

    A ball of ``radius_abs`` around ``at_abs`` fits in the input, and in it one of ``left_abs`` between the hulls, which
    reach out by at most `over` in the frame: they cannot narrow a passage by more.
    """
    most = min(over / LEAST_LOSS, 2.0)
    if reached.root is None or most <= NARROWEST:
        return []
    threads, frame = run.threads, reached.solid.frame
    surface, union = reached.root.filling.surface, hull_union(hulls, threads)

    def lose(balls: Balls) -> BoolArray:
        return union.distance(balls.centres, threads) < (1 - LEAST_LOSS) * balls.radii

    balls = passage_balls(reached.solid.mesh, surface, (NARROWEST, most), STARTS, threads, lose)
    covered = union.distance(balls.centres, threads) / balls.radii
    kept = np.argsort(covered, kind="stable")[:STARTS]
    balls, covered = balls.some(kept), covered[kept]
    passage = _passages(balls, surface, threads)
    first = np.sort(np.unique(passage, return_index=True)[1])[:MOST_LISTED]
    every = [_looked_at(balls, np.flatnonzero(passage == passage[i]), covered) for i in first]
    some = np.concatenate([np.empty(0, dtype=np.intp), *every])
    passage, balls = passage[some], balls.some(some)
    left = _left(balls, union, threads)
    order = np.argsort(left / balls.radii, kind="stable")
    worst = order[np.sort(np.unique(passage[order], return_index=True)[1])]  # of each passage
    worst = worst[left[worst] < (1 - LEAST_LOSS) * balls.radii[worst]]
    places, lengths = frame.to_input(balls.centres[worst]), np.stack([balls.radii, left])[:, worst] / frame.scale
    return [
        {"at_abs": at, "radius_abs": radius, "left_abs": rest}
        for at, radius, rest in zip(places.tolist(), *lengths.tolist(), strict=True)
    ]


def _passages(balls: Balls, surface: _native.Surface, threads: int) -> IntArray:
    """The number of the passage in which each ball stands: between near ones, half of the larger can go straight."""
    away = balls.centres[:, None] - balls.centres
    squares = dots(away, away)
    near = np.argsort(squares, axis=1, kind="stable")[:, 1 : 1 + _NEIGHBOURS]
    first, second = np.repeat(np.arange(len(balls)), near.shape[1]), near.ravel()
    # At so much room in every eighth of the way, nothing stands in it between them either.
    needed = np.maximum(np.maximum(balls.radii[first], balls.radii[second]) / 2, np.sqrt(squares[first, second]) / 16)
    start, end = balls.centres[first, None], balls.centres[second, None]
    ways = np.ascontiguousarray((start + _ON_THE_WAY * (end - start)).reshape(-1, 3))
    is_free = surface.distance(ways, threads).reshape(-1, len(_ON_THE_WAY)).min(axis=1) > needed
    return _native.components(len(balls), first[is_free], second[is_free])[1].astype(np.int32)


def _looked_at(balls: Balls, own: NDArray[np.intp], covered: FloatArray) -> NDArray[np.intp]:
    """Those of a passage's balls of which least may be left; none of a nick (see `LEAST_EXTENT`).

    Of balls whose centres are about as much covered, some along the passage are looked at: where it opens, part of a
    ball is outside of it.
    """
    centres, radii = balls.centres[own], balls.radii[own, None]
    if np.ptp(np.concatenate([centres - radii, centres + radii]), axis=0).max() < LEAST_EXTENT:
        return own[:0]
    some = np.flatnonzero(covered[own] <= covered[own].min() + LEAST_LOSS)
    along = own[some[np.argsort(centres[some, np.ptp(centres, axis=0).argmax()], kind="stable")]]
    looked_at: NDArray[np.intp] = along[np.unique(np.linspace(0, len(along) - 1, LOOKED_AT).astype(int))]
    return looked_at


def _left(balls: Balls, union: _native.HullUnion, threads: int) -> FloatArray:
    """Radius [B] of the largest ball that fits inside each ball and outside the hulls, to within `ACCURACY`.

    Its centre is that of the ball to within half the radius: beside a plate thinner than the ball, much of it is free.
    """
    centres, radii = balls.centres[:, None], balls.radii[:, None]
    at, left, each = balls.centres, np.zeros(len(balls)), np.arange(len(balls))
    for step, around in _SEARCH:
        there = at[:, None] + step * radii[..., None] * around
        away = np.sqrt(dots(there - centres, there - centres))
        free = union.distance(there.reshape(-1, 3), threads).reshape(away.shape)
        fits = np.where(away <= radii / 2, np.minimum(free, radii - away), 0.0)
        best = fits.argmax(axis=1)
        better = fits[each, best] > left
        at = np.where(better[:, None], there[each, best], at)
        left = np.where(better, fits[each, best], left)
    return left


def too_narrow(found: Sequence[dict[str, Any]], reached: Reached, is_stopped: bool) -> list[str]:
    """Warn of passages that keep less than asked for, and of others that lose over a third of their radius."""
    options, scale, asked, others = reached.options, reached.solid.frame.scale, [], []
    ball, told = options.keep_open_abs, MOSTLY if options.keep_open_abs is None else 1 - LEAST_LOSS
    for at, radius, left in (one.values() for one in found):
        if radius * scale >= least_kept(options, scale):
            if left < (options.keep_open or 0.0) * radius + (ball or 0.0) - ACCURACY * radius:
                asked.append((at, radius, left))
        elif left < told * radius:
            others.append((at, radius, left))
    reason = "the work was stopped before" if is_stopped else "limits on the hulls leave no other way"
    smaller = "threshold" if "threshold" in options.numbers else "tolerance"
    share = "over a third" if ball is None else f"over a tenth, too narrow for a ball of radius {ball:.4g}"
    return [
        _narrows(lost, by, cure)
        for lost, by, cure in (
            (asked, "more than --keep-open allows", reason),
            (others, share, f"--keep-open with a length, or a smaller {smaller}, keeps more open"),
        )
        if lost
    ]


def _narrows(lost: list[tuple[list[float], float, float]], share: str, cure: str) -> str:
    closed = sum(left <= ACCURACY * radius for _, radius, left in lost)
    at, radius, left = min(lost, key=lambda one: (max(one[2] / one[1], ACCURACY), -one[1]))
    return (
        f"{len(lost)} passage{'s narrow' if len(lost) > 1 else ' narrows'} by {share}"
        f"{f', {closed} to nothing' if closed else ''}, such as that near ({', '.join(f'{x:.4g}' for x in at)}) from a "
        f"radius of {radius:.4g} to {left:.4g}; {cure}."
    )
