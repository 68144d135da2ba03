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
from rlacd.solid.arrays import dots, length
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
"""Maximum depth of halving for a piece that no part can take."""

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
    division = _Division(around, criterion, random, run, again)
    pieces = [_Piece(member) for member in sorted(part.members, key=lambda member: -member.volume)]
    if not keeps_rest and not all(map(division.may_go, pieces)):
        return None  # a quick test that ends most trials
    left: list[Component] = []
    for piece in pieces:
        left += division.left_of(piece, stop=not keeps_rest)
        if left and not keeps_rest:
            return None
    changes = [*zip(division.now, around, strict=True)]
    if run.is_over or all(now is before for now, before in changes):
        return None
    rest = [Part.joint(*left)] if left else []
    for whole in rest:
        if not run.work.pay(work.uniting(len(whole.hull.vertices))) or not criterion.is_met(whole):
            return None
    after = [now if now is before else _mended(now, criterion) for now, before in changes]
    return Exchange.between([part, *around], [*after, *rest])


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


class _Division:
    """Parts that are offered pieces of another, which are halved if none can take them."""

    def __init__(
        self, around: Sequence[Part], criterion: Criterion, random: np.random.Generator, run: Run, again: bool
    ) -> None:
        self.now = list(around)
        self._criterion = criterion
        self._random = random
        self._run = run
        self._again = again

    def takers(self, piece: _Piece) -> list[int]:
        """The parts that may take a piece, those first whose hulls would grow the least."""
        feasible = feasible_unions(piece.component, self.now, self._criterion, self._run.work)
        return [i for i, _ in sorted(feasible, key=lambda found: found[1] - self.now[found[0]].hull.volume)[:TAKERS]]

    def may_go(self, piece: _Piece, halvings: int = PIECE_HALVINGS) -> bool:
        """Whether the piece, or each of those it is halved into, may be taken by some part."""
        takers = self.takers(piece)
        if takers or halvings == 0:
            return bool(takers)
        halves = self._halves(piece, takers)
        return len(halves) > 0 and all(self.may_go(half, halvings - 1) for half in halves)

    def left_of(self, piece: _Piece, halvings: int = PIECE_HALVINGS, stop: bool = False) -> list[Component]:
        """Give parts what they can take of a piece; returns the rest, or with `stop` the first of the rest."""
        takers = self.takers(piece)
        for i in takers:
            union = joint_part(self.now[i], piece.component, self._criterion, self._run.work)
            if union is not None:
                self.now[i] = union
                return []
        halves = self._halves(piece, takers) if halvings > 0 else []
        if not halves:
            return [piece.component]
        left: list[Component] = []
        for half in halves:
            left += self.left_of(half, halvings - 1, stop)
            if left and stop:
                break
        return left

    def _halves(self, piece: _Piece, takers: Sequence[int]) -> list[_Piece]:
        if piece.halves is None:
            may_cut = self._run.step(0, None, len(self.now)) and self._run.work.pay(work.cutting(piece.component.size))
            piece.halves = [_Piece(half) for half in self._halved(piece.component, takers)] if may_cut else []
        return piece.halves

    def _halved(self, component: Component, takers: Sequence[int]) -> list[Component]:
        """Cut near the middle; the smaller half comes first.

        The first time from the one to the other of the best takers, else of the nearest parts: around a round hole that
        follows the hole, which no axis does.
        """
        share = self._random.uniform(0.5 - MIDDLE, 0.5 + MIDDLE)
        if not self._again and len(self.now) > 1:
            middles = np.array([part.hull.vertices.mean(axis=0) for part in self.now])
            gaps = middles - component.hull.vertices.mean(axis=0)
            nearest = [i for i in np.argsort(dots(gaps, gaps)).tolist() if i not in takers]
            first, second = [*takers, *nearest][:2]
            along = middles[second] - middles[first]
            if length(along) > 0:
                return component.halved(share, along[None] / length(along))
        return component.halved(share, np.eye(3) if self._random.random() < 0.5 else component.principal_axes)
