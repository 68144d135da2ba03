"""The transfer operator: a part gives pieces to larger parts around it until it is gone.

Two parts that cannot be united may still share a third between them. A plane cuts off a piece on the taker's side, as
large as the criterion allows; then each part around is offered all of the rest. Equally many parts of less even sizes
are progress too: small parts disappear in the end, as bins do that are emptied into fuller ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from rlacd import work
from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.merge.merge import Uniter
from rlacd.search.recut import Exchange
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part, Plane
from rlacd.solid.hull import Hull
from rlacd.solid.products import dots, heights, length
from rlacd.solid.reunite import reunite

TRIES = 16
"""Number of (taker, direction) pairs to draw: together they take about as long as a recut."""

SMALLER = 0.5
"""Only parts whose hulls are larger than this share of the giver's can take from it."""

FIRST = 1 / 8
"""First depth to try in a direction, as a share of the part's extent; if it fails, the direction is abandoned."""

HALVINGS = 3
"""Bisection steps for the deepest plane that the criterion allows."""

LEAST = 0.03
"""Pieces up to this share of the part's volume are not worth a cut."""

WHOLE = 5
"""Number of neighbours, those with the least added volume, that are offered all of the rest."""

PATCHES = 4
"""Parts of more components than this are reunited into one if that meets the criterion."""


def transfer(
    part: Part,
    around: Sequence[Part],
    criterion: Criterion,
    random: np.random.Generator,
    solid: Component,
    clock: Clock | None = None,
) -> Exchange | None:
    """Let a part give pieces to the parts around it.

    Parameters
    ----------
    part : Part
        The giver.
    around : sequence of Part
        Parts near it; each that takes a piece still meets the criterion, and so does the rest.
    criterion : Criterion
    random : numpy.random.Generator
        Draws takers and directions.
    solid : Component
        The solid that was decomposed.
    clock : Clock, optional
        Stop when its time or its work is used up; pieces given so far stay given.

    Returns
    -------
    Exchange or None
        Equally many parts of less even sizes, or one fewer; None if no piece can be given.
    """
    clock = clock or Clock()
    uniter = Uniter(criterion, solid, clock.work)
    now = list(around)
    takers = [i for i, other in enumerate(around) if other.hull.volume > SMALLER * part.hull.volume]
    rest = part
    for tried in range(TRIES if takers else 0):
        if not clock.step(tried, TRIES, len(now) + 1):
            break
        i = takers[random.integers(len(takers))]
        bite = _largest_bite(rest, now[i], _direction(rest, now[i], random), uniter)
        if bite is None:
            continue
        now[i], left = bite
        if left is None or _take_whole(left, now, uniter):
            return exchange_of(part, around, now, criterion)
        rest = left
    return None if rest is part else exchange_of(part, around, [*now, rest], criterion)


def exchange_of(part: Part, around: Sequence[Part], after: Sequence[Part], criterion: Criterion) -> Exchange:
    """The exchange of parts before and after giving; changed parts of many components are reunited."""
    known = {id(other) for other in around}
    return Exchange.between([part, *around], [p if id(p) in known else _mended(p, criterion) for p in after])


def _direction(part: Part, taker: Part, random: np.random.Generator) -> FloatArray:
    """Draw a coordinate axis, a principal axis, or the line between the two parts, pointing away from the taker."""
    away = part.hull.vertices.mean(axis=0) - taker.hull.vertices.mean(axis=0)
    largest = max(part.members, key=lambda member: member.volume)
    axes = np.vstack([np.eye(3), largest.principal_axes, away])
    axis: FloatArray = axes[random.integers(len(axes))]
    axis = axis / max(length(axis), 1e-12)
    return -axis if dots(axis, away) < 0 else axis


def _largest_bite(part: Part, taker: Part, direction: FloatArray, uniter: Uniter) -> tuple[Part, Part | None] | None:
    """Give the taker as much as it can have: the grown taker and the rest; None if that is at most `LEAST`."""
    corners = np.concatenate([member.hull.vertices for member in part.members])
    along = heights(corners, direction)
    lower, upper = float(along.min()), float(along.max())
    offset = lower + FIRST * (upper - lower)
    best = None
    for _ in range(1 + HALVINGS):
        bite = None
        if not _is_too_much(corners[along <= offset], taker, uniter):
            bite = _bite(part, taker, direction, offset, uniter)
        if bite is not None:
            lower, best = offset, bite
        elif best is None:
            return None
        else:
            upper = offset
        offset = (lower + upper) / 2
    if best is None or best[2] <= LEAST * sum(member.volume for member in part.members):
        return None
    return best[:2]


def _bite(
    part: Part, taker: Part, direction: FloatArray, offset: float, uniter: Uniter
) -> tuple[Part, Part | None, float] | None:
    """The taker with what lies below a plane, the rest, and the volume given; None if one fails the criterion."""
    if not uniter.account.pay(sum(work.cutting(member.size) for member in part.members)):
        return None
    below, above = _divided(part.members, direction, offset)
    if not below:
        return taker, part, 0.0
    grown = uniter.unite(taker, _glued(below))
    left = _whole(above, uniter) if grown is not None and above else None
    if grown is None or (above and left is None):
        return None
    return grown, left, sum(piece.volume for piece in below)


def _is_too_much(corners: FloatArray, taker: Part, uniter: Uniter) -> bool:
    """Whether the taker cannot even have the given corners [N, 3] of the piece: decided without cutting."""
    count = len(corners) + len(taker.hull.vertices)
    if not uniter.account.pay(work.joining(count) + work.probing(count)):
        return True
    hull = Hull.of(np.concatenate([taker.hull.vertices, corners]))
    return hull is not None and uniter.forbids(hull)


def _whole(pieces: Sequence[Component], uniter: Uniter) -> Part | None:
    """The pieces as one part; None if that fails the criterion."""
    if len(pieces) > 1:
        return uniter.unite(_glued(pieces[:-1]), pieces[-1])
    if not uniter.account.pay(work.judging(pieces[0].size, len(pieces[0].hull.faces))):
        return None
    return pieces[0] if uniter.criterion.is_met(pieces[0]) else None


def _take_whole(rest: Part, takers: list[Part], uniter: Uniter) -> bool:
    """Give all of the rest to one of the takers; False if none can have it."""
    feasible = sorted(uniter.feasible(rest, takers), key=lambda found: found[1] - takers[found[0]].hull.volume)
    for i, _ in feasible[:WHOLE]:
        union = uniter.unite_feasible(takers[i], rest)
        if union is not None:
            takers[i] = union
            return True
    return False


def _divided(
    components: Sequence[Component], direction: FloatArray, offset: float
) -> tuple[list[Component], list[Component]]:
    """The pieces of the components below and above a plane."""
    x, y, z = (float(c) for c in direction)
    below: list[Component] = []
    above: list[Component] = []
    for component in components:
        along = heights(component.hull.vertices, direction)
        if along.max() <= offset:
            below.append(component)
        elif along.min() >= offset:
            above.append(component)
        else:
            for side, found in zip((below, above), component.cut(Plane((x, y, z), offset)), strict=True):
                if found is not None:
                    side.append(found)
    return below, above


def _glued(pieces: Sequence[Part]) -> Part:
    return reduce(Part.glued, pieces)


def _mended(part: Part, criterion: Criterion) -> Part:
    """Get a part of many components as a single component, if that meets the criterion."""
    if len(part.members) <= PATCHES:
        return part
    whole = reunite(part.members)
    return whole if whole is not None and criterion.is_met(whole) else part
