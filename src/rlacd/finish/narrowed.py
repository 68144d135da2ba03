"""Passages of the solid that its hulls narrow or close: where, how wide they were, and what is left."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.kept_open import least_kept
from rlacd.find_parts import Reached
from rlacd.solid.arrays import BoolArray, FloatArray, dots
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.passages import passage_balls
from rlacd.solid.primitive import Balls

LEAST_RADIUS = 0.008
"""Narrower passages (the longest side is 2) are not looked for: folds of scans and gaps between sheets are such."""

LEAST_LOSS = 0.1
"""Share of its radius that a passage has to lose to be listed."""

MOSTLY = 2 / 3
"""Share of its radius below which there is a warning."""

LEAST_EXTENT = 0.1
"""Of a passage along an axis; smaller ones are nicks. At a threshold of 0.05, 16 of 27 real meshes lose a passage of
any extent, 11 one of this."""

POINTS = 600
"""From which balls start, and as many triangles."""

MOST_BALLS = 500
"""Of more, those that lose most are looked at."""

MOST_LISTED = 50

ACCURACY = 0.02
"""Share of its radius to within which it is found what is left of a ball."""

_AROUND = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
_INSIDE = np.array(list(itertools.product(np.linspace(-0.75, 0.75, 7), repeat=3)))
_ON_THE_WAY = np.linspace(0, 1, 9)[1:-1, None]
_NEIGHBOURS = 8


class Passage(NamedTuple):
    """Where a ball of a radius fits in the input, and between the hulls one of the radius `left`; in the frame."""

    at: FloatArray
    radius: float
    left: float

    def as_plain(self, frame: Frame) -> dict[str, Any]:
        """For the report, in the input's unit."""
        at = frame.to_input(self.at[None])[0].tolist()
        return {"at_abs": at, "radius_abs": self.radius / frame.scale, "left_abs": self.left / frame.scale}


def narrowed(reached: Reached, hulls: Sequence[Hull], over: float, threads: int) -> list[Passage]:
    """Find the passages that hulls narrow by more than a tenth, one entry each, the most narrowed first.

    `over` is how far the hulls reach out: they cannot narrow a passage by more.
    """
    most = min(over / LEAST_LOSS, 2.0)
    if reached.root is None or most <= LEAST_RADIUS:
        return []
    surface, union = reached.root.filling.surface, hull_union(hulls, threads)

    def lose(balls: Balls) -> BoolArray:
        return union.distance(balls.centres, threads) < (1 - LEAST_LOSS) * balls.radii

    balls = passage_balls(reached.solid.mesh, surface, (LEAST_RADIUS, most), POINTS, threads, lose)
    shares = union.distance(balls.centres, threads) / balls.radii
    order = np.argsort(shares, kind="stable")[:MOST_BALLS]
    balls = Balls(balls.centres[order], balls.radii[order])
    passage = _passages(balls, surface, threads)
    _, firsts = np.unique(passage, return_index=True)
    found = []
    for i in np.sort(firsts)[:MOST_LISTED]:
        own, at, radius = passage == passage[i], balls.centres[i], float(balls.radii[i])
        ends = balls.centres[own] + balls.radii[own, None], balls.centres[own] - balls.radii[own, None]
        if (ends[0].max(axis=0) - ends[1].min(axis=0)).max() >= LEAST_EXTENT:
            found.append(Passage(at, radius, _left(union, at, radius)))
    found = [one for one in found if one.left < (1 - LEAST_LOSS) * one.radius]
    return sorted(found, key=lambda one: one.left / one.radius)


def _passages(balls: Balls, surface: _native.Surface, threads: int) -> NDArray[np.int64]:
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
    return _native.components(len(balls), first[is_free], second[is_free])[1]


def _left(union: _native.HullUnion, centre: FloatArray, radius: float) -> float:
    """Radius of the largest ball that fits inside a ball and outside the hulls, to within `ACCURACY`."""
    at, left, step, around = centre, 0.0, radius, _INSIDE
    while step > ACCURACY * radius:
        there = at + step * around
        aside = there - centre
        fits = np.minimum(union.distance(there, 1), radius - np.sqrt(dots(aside, aside)))
        best = int(fits.argmax())
        if is_better := fits[best] > left:
            at, left = there[best], float(fits[best])
        if around is _INSIDE:
            step, around = radius / 4, _AROUND
        elif not is_better:
            step /= 2
    return left


def too_narrow(found: Sequence[Passage], reached: Reached) -> list[str]:
    """Warn of passages that keep less than asked for, and of others that lose over a third of their radius."""
    options, scale = reached.options, reached.solid.frame.scale
    asked = [one for one in found if one.radius >= least_kept(options, scale)]
    others = [one for one in found if one.radius < least_kept(options, scale) and one.left < MOSTLY * one.radius]
    share, ball = options.keep_open or 0.0, (options.keep_open_abs or 0.0) * scale
    broken = [one for one in asked if one.left < share * one.radius + ball - ACCURACY * one.radius]
    return [
        *_said(broken, "more than keep_open allows", "limits on the hulls leave no other way", reached),
        *_said(others, "over a third of the radius", "--keep-open or a smaller threshold may keep such open", reached),
    ]


def _said(lost: Sequence[Passage], what: str, cure: str, reached: Reached) -> list[str]:
    if not lost:
        return []
    frame, closed = reached.solid.frame, sum(one.left <= ACCURACY * one.radius for one in lost)
    worst = max(lost, key=lambda one: one.radius - one.left)
    counted = [
        f"{count} passage{'' if count == 1 else 's'} {one if count == 1 else many}"
        for count, one, many in ((closed, "closes", "close"), (len(lost) - closed, f"loses {what}", f"lose {what}"))
        if count
    ]
    there, between = worst.radius / frame.scale, worst.left / frame.scale
    return [
        f"{' and '.join(counted)}: near {frame.place(worst.at)}, a ball of radius {there:.4g} fits in the input, of "
        f"{between:.4g} between the hulls (see `passages`); {cure}."
    ]
