"""The operator of the search, which exchanges parts for fewer.

A part is divided until the parts around have taken all of it, or some piece cannot go. Hulls may overlap, so a taker
need not end where the part began: it takes a piece if their joint hull meets the criterion. A piece that no part can
take is halved, and the halves are offered again. What is left of a part may stay a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.merge.unite import feasible_unions, joint_part
from rlacd.run import Run, work
from rlacd.solid.component import Component, Part, reunite


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


TAKERS = 6
"""Number of parts a piece is offered to, starting with those whose hulls would grow the least."""

PIECE_HALVINGS = 3
"""Maximum depth of halving for a piece that no part can take; where what is left may stay, pieces are halved once:
offering smaller ones would take three quarters of the search's time, and seldom saves a part."""

PATCHES = 4
"""Parts of more components than this are reunited into one if that meets the criterion."""

MIDDLE = 0.1
"""A piece is halved within this share of its length from the middle, at random, so each trial divides differently."""


def divide(
    part: Part,
    around: Sequence[Part],
    criterion: Criterion,
    random: np.random.Generator,
    run: Run,
    *,
    keeps_rest: bool = False,
    again: bool = False,
) -> Exchange | None:
    """Divide a part among the parts around it.

    Parameters
    ----------
    part : Part
    around : sequence of Part
        Parts near it; each that takes a piece still meets the criterion.
    criterion : Criterion
    random : numpy.random.Generator
        Draws where pieces are halved.
    run : Run
        Give up when it is over.
    keeps_rest : bool
        What no part can take stays a part, if that meets the criterion; otherwise all of it has to go.
    again : bool
        Whether it was tried before: then pieces are halved along random axes, not between the parts that can take most.

    Returns
    -------
    Exchange or None
        An exchange that saves one part, or with `keeps_rest` none; None if nothing can be taken, or not enough.
    """
    division = _Division([*around], criterion, random, run, again)
    pieces = [_Piece(member) for member in sorted(part.members, key=lambda member: -member.volume)]
    if not keeps_rest and not all(division.takers(piece) or division.may_go(piece) for piece in pieces):
        return None  # a quick test that ends most trials
    left: list[Component] = []
    for piece in pieces:
        left += division.left_of(piece, 1 if keeps_rest else PIECE_HALVINGS, stop=not keeps_rest)
        if left and not keeps_rest:
            return None
    changes = [*zip(division.now, around, strict=True)]
    if run.is_over or all(now is before for now, before in changes):
        return None
    rest = joint_part(criterion, run.work, *left) if left else None
    if left and rest is None:
        return None
    after = [now if now is before else _mended(now, criterion) for now, before in changes]
    return Exchange.between([part, *around], [*after, *([rest] if rest else [])])


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


@dataclass
class _Division:
    """Parts that are offered pieces of another, which are halved if none can take them."""

    now: list[Part]
    criterion: Criterion
    random: np.random.Generator
    run: Run
    again: bool

    def takers(self, piece: _Piece) -> list[int]:
        """The parts that may take a piece, those first whose hulls would grow the least."""
        feasible = feasible_unions(piece.component, self.now, self.criterion, self.run.work)
        return [i for i, _ in sorted(feasible, key=lambda found: found[1] - self.now[found[0]].hull.volume)[:TAKERS]]

    def may_go(self, piece: _Piece, halvings: int = PIECE_HALVINGS) -> bool:
        """Whether each of its smallest pieces may be taken: if one may not, hardly anything larger may."""
        smaller = self._halves(piece) if halvings > 0 else []
        return all(self.may_go(half, halvings - 1) for half in smaller) if smaller else bool(self.takers(piece))

    def left_of(self, piece: _Piece, halvings: int, stop: bool) -> list[Component]:
        """Give parts what they can take of a piece; returns the rest, or with `stop` the first of the rest."""
        for i in self.takers(piece):
            union = joint_part(self.criterion, self.run.work, self.now[i], piece.component)
            if union is not None:
                self.now[i] = union
                return []
        halves = self._halves(piece) if halvings > 0 else []
        if not halves:
            return [piece.component]
        left: list[Component] = []
        for half in halves:
            left += self.left_of(half, halvings - 1, stop)
            if left and stop:
                break
        return left

    def _halves(self, piece: _Piece) -> list[_Piece]:
        if piece.halves is None:
            may_cut = self.run.step(0, len(self.now)) and self.run.work.pay(work.cutting(piece.component.size))
            piece.halves = [_Piece(half) for half in self._halved(piece.component)] if may_cut else []
        return piece.halves

    def _halved(self, component: Component) -> list[Component]:
        """Cut near the middle; the smaller half comes first."""
        share = self.random.uniform(0.5 - MIDDLE, 0.5 + MIDDLE)
        if not self.again:
            return component.halved_between(share, [part.hull for part in self.now])
        return component.halved(share, self.random.random() >= 0.5)
