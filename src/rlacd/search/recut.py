"""The recut operator: a few parts are reunited, cut differently, and merged with the parts around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rlacd.criteria.criterion import Criterion
from rlacd.cut import CutTree
from rlacd.merge.merge import merge_parts
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
    policy: Policy,
    criterion: Criterion,
    run: Run,
    whole: Component | None = None,
) -> Exchange | None:
    """Reunite some parts, cut them again, and merge the pieces with each other and with the parts around.

    Parameters
    ----------
    parts : sequence of Part
        A connected cluster.
    around : sequence of Part
        Parts that touch the cluster.
    policy : Policy
        Chooses the planes.
    criterion : Criterion
        Every new part meets it.
    run : Run
        Give up when it is over.
    whole : Component, optional
        The solid; if given, pieces may be merged across other parts between them.

    Returns
    -------
    Exchange or None
        None if the result has neither fewer parts nor equally many with smaller hulls.
    """
    members = [member for part in parts for member in part.members]
    if not run.work.pay(work.reuniting(sum(member.size for member in members), len(members))):
        return None
    solid = reunite(members)
    if solid is None:
        return None
    pieces, left = CutTree(solid, policy, run).cut_until(criterion, len(parts) + EXTRA_PIECES)
    if left or sum(piece.volume for piece in pieces) < (1 - LOST_VOLUME) * solid.volume:
        return None
    if _volumes(pieces) == _volumes(parts):  # cut as before: merging these has already been tried
        return None
    merged = merge_parts(pieces, criterion, run, beside=around, solid=whole)
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
