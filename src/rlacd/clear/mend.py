"""Bodies whose hulls touch where they themselves do not are decomposed again, each clear of the other.

First they get the exact hulls of their parts, which simpler ones hold: at the same tolerance, many then are clear.

The places at which hulls touch are the counterexamples of one round; new ones, found with the new hulls, those of the
next. Of two bodies, first the one whose hulls reach into the other stays out of the other's hulls; if both do, first
one stays out of the other's surface and leaves half the gap, then the other out of its hulls.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from rlacd.clear.bodies import Body, Surface
from rlacd.clear.motion import Motion
from rlacd.clear.touching import TOUCH, Offence, Touching, check, enters, gap, size_of
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import concatenated
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.poses import inverse, moved

MOST_ROUNDS = 8
"""After which pairs that still touch are told."""

IN_VAIN = 2
"""Rounds after which a pair that touches at no fewer places is left: by then both have made way."""

MOST_OFFENCES = 24
"""Of one pair, looked at in one round: the deepest, and those that differ most from it."""

OFF_HULLS = 10 * TOUCH
"""How far hulls stay off those of other bodies, a share of the size of all: single precision moves them less."""

MOST_GROWTH, SPARE = 3, 16
"""A body may have so many times its hulls, or so many more. Links that turn inside each other with a hundredth of the
tolerance between them take seven times as many, which costs more in every step than it is worth."""

Redo = Callable[[int, Sequence[Obstacle], int], Sequence[Surface] | None]
"""Decomposes the body of this number again, clear of obstacles in its frame; None if that takes more hulls."""

Exact = Callable[[int, Callable[[], bool]], Sequence[Surface] | None]
"""The body of this number as the exact hulls of its parts, as open as it is if others move in it, which is costly to
ask; None if its hulls are that already."""


@dataclass(frozen=True)
class Cleared:
    """What became of bodies."""

    bodies: list[Body]
    touching: dict[tuple[int, int], Touching]  # as `check` finds it for the new hulls
    mended: tuple[tuple[int, int], ...] = ()  # pairs whose hulls touched though they did not, and no longer do
    given_up: frozenset[int] = frozenset()  # bodies that would have taken too many hulls


class _Wish(NamedTuple):
    """One body stays out of another, of its surface or of its hulls."""

    body: int
    other: int
    of_mesh: bool


@dataclass
class _Wishes:
    """What bodies are to stay out of, and where, seen from them."""

    places: dict[_Wish, dict[bytes, FloatArray]] = field(default_factory=dict)  # poses of the other, by their digits
    gaps: dict[_Wish, float] = field(default_factory=dict)  # the least between the two there
    tried: set[tuple[_Wish, int, bytes]] = field(default_factory=set)  # the same again would not help
    renewed: Counter[int] = field(default_factory=Counter)  # how often a body was decomposed again
    given_up: set[int] = field(default_factory=set)
    too_tight: float = 0.0  # the widest gap for which a body took too many hulls

    def add(self, wish: _Wish, poses: Sequence[FloatArray]) -> bool:
        """Add places; returns whether any is new."""
        version = 0 if wish.of_mesh else self.renewed[wish.other]
        keys = [(wish, version, pose.round(9).tobytes()) for pose in poses]
        is_new = not self.tried.issuperset(keys)
        if is_new:
            self.tried.update(keys)
            known = self.places.setdefault(wish, {})
            known.update(zip((key[2] for key in keys), poses, strict=True))
        return is_new


def kept_clear(bodies: Sequence[Body], motion: Motion, redo: Redo, exact: Exact = lambda *_: None) -> Cleared:
    """Decompose bodies again until no hulls touch where the bodies do not, or that does not help.

    Raises
    ------
    MissingExtraError
        The extra ``clear`` is not installed.
    """
    bodies = list(bodies)
    touching = check(bodies, motion)
    first, wishes = {pair for pair, found in touching.items() if found.offences}, _Wishes()
    finer = {
        i: hulls
        for i in sorted({*chain(*(pair for pair, found in touching.items() if found.offences))})
        if bodies[i].hulls and (hulls := exact(i, partial(_is_entered, i, bodies, touching))) is not None
    }
    bodies = [body.with_hulls(finer[i]) if i in finer else body for i, body in enumerate(bodies)]
    touching = _renewed(bodies, motion, touching, {*finer})
    most = [max(MOST_GROWTH * len(body.hulls), len(body.hulls) + SPARE) for body in bodies]
    vain = Counter[tuple[int, int]]()
    for _ in range(MOST_ROUNDS):
        wrong = {pair: found for pair, found in touching.items() if found.offences and vain[pair] < IN_VAIN}
        again = _wish(bodies, wrong, wishes)
        if not again:
            break
        for body in sorted(again):
            obstacles = [_obstacle(bodies, wish, wishes, motion) for wish in wishes.places if wish.body == body]
            tight = min((wishes.gaps[wish] for wish in wishes.gaps if wish.body == body), default=np.inf)
            hulls = None if tight <= wishes.too_tight else redo(body, obstacles, most[body])
            if hulls is None:
                wishes.given_up.add(body)
                wishes.too_tight = max(wishes.too_tight, tight if np.isfinite(tight) else 0.0)
                continue
            bodies[body] = bodies[body].with_hulls(hulls)
            wishes.renewed[body] += 1
        touching = _renewed(bodies, motion, touching, again - wishes.given_up)
        for pair, found in wrong.items():
            if not again.isdisjoint(pair):
                is_vain = pair in touching and len(touching[pair].offences) >= len(found.offences)
                vain[pair] = vain[pair] + 1 if is_vain else 0
    mended = sorted(pair for pair in first if pair not in touching or not touching[pair].offences)
    return Cleared(bodies, dict(sorted(touching.items())), tuple(mended), frozenset(wishes.given_up))


def _is_entered(own: int, bodies: Sequence[Body], touching: dict[tuple[int, int], Touching]) -> bool:
    """Whether another body moves where only closing an opening of a body has put hulls."""
    wrong = [(pair, one.pose) for pair, found in touching.items() if own in pair for one in _spread(found.offences)]
    return any(
        bodies[own].holds(bodies[j if own == i else i], pose if own == i else inverse(pose)) for (i, j), pose in wrong
    )


def _renewed(
    bodies: Sequence[Body], motion: Motion, touching: dict[tuple[int, int], Touching], changed: set[int]
) -> dict[tuple[int, int], Touching]:
    """What bodies do, of which some have other hulls."""
    near = {(min(i, j), max(i, j)) for i in changed for j in range(len(bodies)) if j != i}
    same = {pair: found for pair, found in touching.items() if changed.isdisjoint(pair)}
    return same | (check(bodies, motion, near) if changed else {})


def _wish(bodies: Sequence[Body], wrong: dict[tuple[int, int], Touching], wishes: _Wishes) -> set[int]:
    """Add what bodies are to stay out of, and return those to decompose again: not both of a pair at once."""
    again, fixed = set[int](), set[int]()
    left = {pair: found for pair, found in wrong.items() if wishes.given_up.isdisjoint(pair)}
    for (i, j), found in sorted(left.items(), key=lambda one: (-one[1].depth, one[0])):
        seen = [place.pose for place in _spread(found.offences)]
        poses = {i: seen, j: [inverse(pose) for pose in seen]}
        ours, theirs = (any(enters(bodies[a], bodies[b], pose) for pose in poses[a]) for a, b in ((i, j), (j, i)))
        ways = [_Wish(i, j, False), _Wish(j, i, False)]
        if theirs:
            ways.reverse()
        if ours and theirs:
            ways.insert(0, _Wish(i, j, True))
        for wish in ways:
            is_free = bodies[wish.body].hulls and wish.body not in fixed and wish.other not in again
            if is_free and wishes.add(wish, poses[wish.body]):
                again.add(wish.body)
                fixed.add(wish.other)
                if wish.of_mesh:
                    least = min(gap(bodies[i], bodies[j], pose) for pose in seen)
                    wishes.gaps[wish] = min(least, wishes.gaps.get(wish, least))
                break
    return again


def _spread(offences: Sequence[Offence]) -> list[Offence]:
    """The deepest, and then always the one that differs most from those chosen."""
    if not offences:
        return []
    poses = np.stack([one.pose[:3].ravel() for one in offences])
    poses[:, 3::4] /= max(float(np.abs(poses[:, 3::4]).max()), 1e-300)
    chosen, away = [0], np.full(len(offences), np.inf)
    while len(chosen) < min(MOST_OFFENCES, len(offences)):
        away = np.minimum(away, np.abs(poses - poses[chosen[-1]]).sum(axis=1))
        chosen.append(int(away.argmax()))
    return [offences[i] for i in chosen]


def _obstacle(bodies: Sequence[Body], wish: _Wish, wishes: _Wishes, motion: Motion) -> Obstacle:
    """The other body at all places, seen from the one that stays out of it, as far as it comes near that."""
    own, other = bodies[wish.body], bodies[wish.other]
    shapes = other.solids if wish.of_mesh else other.shapes
    vertices, faces = concatenated([(shape.vertices, shape.faces) for shape in shapes])
    margin = wishes.gaps[wish] / 2 if wish.of_mesh else OFF_HULLS * size_of(bodies, motion)
    lower, upper = own.box[0] - margin, own.box[1] + margin
    near = []
    for pose in wishes.places[wish].values():
        triangles = moved(pose, vertices)[faces]
        meets = (triangles.min(axis=1) <= upper).all(axis=1) & (triangles.max(axis=1) >= lower).all(axis=1)
        near.append(triangles[meets])
    corners = np.ascontiguousarray(np.concatenate(near).reshape(-1, 3))
    numbers = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Obstacle(other.name, corners, numbers, margin, is_told=False)
