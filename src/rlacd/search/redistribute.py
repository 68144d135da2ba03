"""The redistribute operator: a part is divided until the parts around have taken all of it, or some piece cannot go.

Hulls may overlap, so a taker need not end where the part began: it takes a piece if the solid clipped to their joint
hull meets the criterion (`rlacd.merge.merge.Uniter`). A piece that no part can take is halved, and the halves are
offered again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rlacd import work
from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.merge.merge import Uniter
from rlacd.search.recut import Exchange
from rlacd.search.transfer import exchange_of
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part, Plane
from rlacd.solid.hull import Hull
from rlacd.solid.products import heights, length
from rlacd.work import Work

TAKERS = 6
"""Number of parts a piece is offered to, starting with those whose hulls would grow the least."""

HALVINGS = 3
"""Maximum depth of halving for a piece that no part can take."""

MIDDLE = 0.1
"""A piece is halved within this share of its length from the middle, at random, so each trial divides differently."""


def redistribute(
    part: Part,
    around: Sequence[Part],
    criterion: Criterion,
    random: np.random.Generator,
    solid: Component,
    clock: Clock | None = None,
) -> Exchange | None:
    """Divide a part among the parts around it.

    Parameters
    ----------
    part : Part
        The part to eliminate.
    around : sequence of Part
        Parts near it; each that takes a piece still meets the criterion.
    criterion : Criterion
    random : numpy.random.Generator
        Draws where pieces are halved.
    solid : Component
        The solid that was decomposed.
    clock : Clock, optional
        Give up when its time or its work is used up.

    Returns
    -------
    Exchange or None
        An exchange that saves one part; None if some piece cannot be taken.
    """
    clock = clock or Clock()
    uniter = Uniter(criterion, solid, clock.work)
    if not _may_be_taken(part, around, uniter):
        return None
    now = list(around)

    def take(piece: Component, halvings: int) -> bool:
        for i, hull in _by_growth(now, piece, criterion.screen.reach, clock.work):
            union = uniter.unite(now[i], piece, hull)
            if union is not None:
                now[i] = union
                return True
        if halvings == 0 or not clock.step(0, None, len(now)) or not clock.work.pay(work.cutting(piece.size)):
            return False
        halves = _halves(piece, random)
        return bool(halves) and all(take(half, halvings - 1) for half in halves)

    if not all(take(member, HALVINGS) for member in sorted(part.members, key=lambda member: -member.volume)):
        return None
    return exchange_of(part, around, now, criterion)


def _may_be_taken(part: Part, around: Sequence[Part], uniter: Uniter) -> bool:
    """Whether some other part could take each of the part's extreme vertices by itself: a quick necessary test."""
    corners = part.hull.vertices
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    outermost = sorted(set(np.argmax(heights(corners, directions), axis=0).tolist()))
    return all(
        any(
            uniter.account.pay(work.joining(len(around[i].hull.vertices)) + work.probing(len(around[i].hull.vertices)))
            and not uniter.forbids(_with_point(around[i].hull, corners[k]))
            for i in np.argsort([_gap(other.box, corners[k]) for other in around], kind="stable").tolist()
        )
        for k in outermost
    )


def _with_point(hull: Hull, point: FloatArray) -> Hull:
    return Hull.of(np.vstack([hull.vertices, point])) or hull


def _by_growth(parts: Sequence[Part], piece: Part, reach: float, account: Work) -> list[tuple[int, Hull]]:
    """The parts within reach whose hulls would grow the least, with their joint hulls."""
    near = [i for i, part in enumerate(parts) if _gap(part.box, piece.box) <= reach]
    corners = len(piece.hull.vertices)
    if not account.pay(sum(work.joining(len(parts[i].hull.vertices) + corners) for i in near)):
        return []
    joint = [Hull.around(parts[i].hull, piece.hull) for i in near]
    growth = [hull.volume - parts[i].hull.volume for i, hull in zip(near, joint, strict=True)]
    return [(near[k], joint[k]) for k in np.argsort(growth, kind="stable")[:TAKERS]]


def _gap(box: FloatArray, other: FloatArray) -> float:
    """Distance of a box [2, 3] from another, or from a point [3]."""
    low, high = (other[0], other[1]) if other.ndim == 2 else (other, other)
    return length(np.maximum(np.maximum(low - box[1], box[0] - high), 0.0))


def _halves(piece: Component, random: np.random.Generator) -> list[Component]:
    """Cut across the longest coordinate axis or principal axis, chosen at random; the smaller half first."""
    axes = np.eye(3) if random.random() < 0.5 else piece.principal_axes
    along = heights(piece.hull.vertices, axes)
    lower, upper = along.min(axis=0), along.max(axis=0)
    longest = int(np.argmax(upper - lower))
    share = random.uniform(0.5 - MIDDLE, 0.5 + MIDDLE)
    x, y, z = (float(c) for c in axes[longest])
    below, above = piece.cut(Plane((x, y, z), float(lower[longest] + share * (upper - lower)[longest])))
    if below is None or above is None:
        return []
    return sorted([below, above], key=lambda half: half.volume)
