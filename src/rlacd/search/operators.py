"""The operators of the search, which exchange parts for fewer.

- recut: a few parts are reunited, cut differently, and merged with the parts around.
- redistribute: a part is divided until the parts around have taken all of it, or some piece cannot go. Hulls may
  overlap, so a taker need not end where the part began: it takes a piece if the solid clipped to their joint hull meets
  the criterion (`rlacd.merge.merge.Uniter`). A piece that no part can take is halved, and the halves are offered again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.cut import CutTree
from rlacd.merge.merge import Uniter, merge_parts
from rlacd.policies import Policy
from rlacd.run import Run, work
from rlacd.solid.component import LOST_VOLUME, Component, Part, reunite

EXTRA_PIECES = 5
"""Pieces allowed beyond the number of parts: merging rarely makes up for more."""

LEAST_SHRINKAGE = 1e-4
"""Equally many parts are better only if their hulls are smaller by this share; otherwise the search would stall."""


@dataclass(frozen=True, eq=False)
class Exchange:
    """Parts of a decomposition and the parts that replace them."""

    out: tuple[Part, ...]
    into: tuple[Part, ...]

    @classmethod
    def between(cls, before: Sequence[Part], after: Sequence[Part]) -> Exchange:
        """The exchange that turns some parts into others; parts that are in both stay."""
        known, kept = {id(part) for part in before}, {id(part) for part in after}
        return cls(
            tuple(part for part in before if id(part) not in kept),
            tuple(part for part in after if id(part) not in known),
        )

    @property
    def gain(self) -> int:
        """Number of parts saved."""
        return len(self.out) - len(self.into)


def recut(
    parts: Sequence[Part],
    around: Sequence[Part],
    criterion: Criterion,
    policy: Policy,
    solid: Component,
    run: Run,
) -> Exchange | None:
    """Reunite some parts, cut them again, and merge the pieces with each other and with the parts around.

    Parameters
    ----------
    parts : sequence of Part
        A connected cluster.
    around : sequence of Part
        Parts that touch the cluster.
    criterion : Criterion
        Every new part meets it.
    policy : Policy
        Chooses the planes.
    solid : Component
        The solid that was decomposed.
    run : Run
        Give up when it is over.

    Returns
    -------
    Exchange or None
        None if the result has neither fewer parts nor equally many with smaller hulls.
    """
    members = [member for part in parts for member in part.members]
    if not run.work.pay(work.reuniting(sum(member.size for member in members), len(members))):
        return None
    whole = reunite(members)
    if whole is None:
        return None
    pieces, left = CutTree(whole, policy, run).cut_until(criterion, len(parts) + EXTRA_PIECES)
    if left or sum(piece.volume for piece in pieces) < (1 - LOST_VOLUME) * whole.volume:
        return None
    if _volumes(pieces) == _volumes(parts):  # cut as before: merging these has already been tried
        return None
    merged = merge_parts(pieces, criterion, run, beside=around, solid=solid)
    if run.is_over:
        return None
    exchange = Exchange.between([*parts, *around], merged)
    tighter = hull_volume(exchange.into) < (1 - LEAST_SHRINKAGE) * hull_volume(exchange.out)
    return exchange if exchange.gain > 0 or (exchange.gain == 0 and tighter) else None


def _volumes(parts: Sequence[Part]) -> list[int]:
    """Sorted shares of the total volume in millionths; two divisions of a solid with equal shares count as the same."""
    whole = sum(part.volume for part in parts)
    return sorted(round(1e6 * part.volume / whole) for part in parts)


def hull_volume(parts: Sequence[Part]) -> float:
    """Total volume of the parts' hulls."""
    return sum(part.hull.volume for part in parts)


TAKERS = 6
"""Number of parts a piece is offered to, starting with those whose hulls would grow the least."""

HALVINGS = 3
"""Maximum depth of halving for a piece that no part can take."""

PATCHES = 4
"""Parts of more components than this are reunited into one if that meets the criterion."""

MIDDLE = 0.1
"""A piece is halved within this share of its length from the middle, at random, so each trial divides differently."""


def redistribute(
    part: Part,
    around: Sequence[Part],
    criterion: Criterion,
    random: np.random.Generator,
    solid: Component,
    run: Run,
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
    run : Run
        Give up when it is over.

    Returns
    -------
    Exchange or None
        An exchange that saves one part; None if some piece cannot be taken.
    """
    uniter = Uniter(criterion, solid, run.work)
    now = list(around)

    def halves(piece: _Piece) -> list[_Piece]:
        if piece.halves is None:
            may_cut = run.step(0, None, len(now)) and run.work.pay(work.cutting(piece.component.size))
            where = random.uniform(0.5 - MIDDLE, 0.5 + MIDDLE)
            halved = piece.component.halved([part.hull for part in now], where) if may_cut else []
            piece.halves = [_Piece(half) for half in halved]
        return piece.halves

    def may_go(piece: _Piece, halvings: int) -> bool:
        """Whether each of its smallest pieces may be taken: if one may not, hardly anything larger may."""
        smaller = halves(piece) if halvings > 0 else []
        if smaller:
            return all(may_go(half, halvings - 1) for half in smaller)
        return bool(_takers(now, piece.component, uniter))

    def take(piece: _Piece, halvings: int) -> bool:
        for i in _takers(now, piece.component, uniter):
            union = uniter.unite_feasible(now[i], piece.component)
            if union is not None:
                now[i] = union
                return True
        return halvings > 0 and bool(halves(piece)) and all(take(half, halvings - 1) for half in halves(piece))

    pieces = [_Piece(member) for member in sorted(part.members, key=lambda member: -member.volume)]
    if not all(_takers(now, piece.component, uniter) or may_go(piece, HALVINGS) for piece in pieces):
        return None  # quick, and what most end with
    if not all(take(piece, HALVINGS) for piece in pieces):
        return None
    return exchange_of(part, around, now, criterion)


def exchange_of(part: Part, around: Sequence[Part], after: Sequence[Part], criterion: Criterion) -> Exchange:
    """The exchange of parts before and after giving; changed parts of many components are reunited."""
    known = {id(other) for other in around}
    return Exchange.between([part, *around], [p if id(p) in known else _mended(p, criterion) for p in after])


def _mended(part: Part, criterion: Criterion) -> Part:
    """Get a part of many components as a single component, if that meets the criterion."""
    if len(part.members) <= PATCHES:
        return part
    whole = reunite(part.members)
    return whole if whole is not None and criterion.is_met(whole) else part


@dataclass
class _Piece:
    """A piece of the part, and its halves once it has been cut."""

    component: Component
    halves: list[_Piece] | None = None


def _takers(parts: Sequence[Part], piece: Part, uniter: Uniter) -> list[int]:
    """The parts that may take a piece, those first whose hulls would grow the least."""
    by_growth = sorted(uniter.feasible(piece, parts), key=lambda found: found[1] - parts[found[0]].hull.volume)
    return [i for i, _ in by_growth[:TAKERS]]
