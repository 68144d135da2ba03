"""Other meshes that no hull may enter, except where the solid itself crosses them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.concavity import Distance
from rlacd.fit import Unit
from rlacd.report import Avoids, Entered
from rlacd.solid.arrays import FloatArray, dots
from rlacd.solid.component import Part
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.hull import TOLERANCE, Hull
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.solid import Solid

FINEST_SHARE = 0.01
"""Parts whose hulls enter a mesh to avoid are cut down to this share of the threshold."""

SMALL = 0.02
"""Triangles that cross the solid are halved until their sides are at most this long, then left out."""

_HALVINGS = 40


@dataclass(frozen=True)
class Kept:
    """The part of an obstacle that hulls stay out of.

    Attributes
    ----------
    name : str
    against : Against or None
        Its triangles in the frame; None if none is left.
    margin : float
        How far hulls stay off it, in the frame.
    is_crossed : bool
        Whether the solid crosses it; those triangles are left out.
    is_told : bool
        Whether the report says what became of it.
    """

    name: str
    against: _native.Against | None
    margin: float
    is_crossed: bool
    is_told: bool

    @classmethod
    def of(cls, obstacle: Obstacle, frame: Frame, surface: _native.Surface | None, threads: int) -> Kept:
        """Leave out what the solid with this surface, if it has one, crosses or holds."""
        triangles = frame.to_frame(obstacle.triangles.reshape(-1, 3)).reshape(-1, 3, 3)
        triangles, is_crossed = (triangles, False) if surface is None else _outside(triangles, surface)
        against = _native.Against(*_mesh(triangles), threads) if len(triangles) else None
        return cls(obstacle.name, against, obstacle.margin * frame.scale, is_crossed, obstacle.is_told)

    def is_entered(self, hull: Hull) -> bool:
        """Whether a hull comes nearer than the margin."""
        return self.against is not None and self.against.comes_deeper(hull.body, ROUNDING - self.margin)

    def depth(self, hull: Hull) -> float:
        """How deep it reaches into a hull, to `TOLERANCE`; 0 if it does not."""
        if self.against is None or not self.against.comes_deeper(hull.body, TOLERANCE):
            return 0.0
        low, high = TOLERANCE, 2.0
        while high - low > TOLERANCE:
            middle = (low + high) / 2
            is_deeper = self.against.comes_deeper(hull.body, middle)
            low, high = (middle, high) if is_deeper else (low, middle)
        return high


@dataclass(frozen=True)
class Avoided:
    """All that hulls stay out of.

    Attributes
    ----------
    kept : tuple of Kept
    finest : Distance
        A part that is as tight as this is cut no further to avoid them.
    """

    kept: tuple[Kept, ...]
    finest: Distance

    @classmethod
    def of(cls, obstacles: Sequence[Obstacle], solid: Solid, threshold: float, threads: int) -> Avoided:
        """Prepare obstacles for the hulls of a solid."""
        surface = _native.Surface(*solid.mesh, threads) if len(solid.mesh[1]) else None
        kept = tuple(Kept.of(obstacle, solid.frame, surface, threads) for obstacle in obstacles)
        return cls(kept, Distance(FINEST_SHARE * threshold))

    def is_in_the_way(self, hull: Hull, exact: Part) -> bool:
        """Whether a hull enters any of them, and its part, with the exact hull, is not too fine to be cut for that."""
        return any(kept.is_entered(hull) for kept in self.kept) and not self.finest.is_met(exact)

    def scaled(self, factor: float) -> Avoided:
        """The same where coarser parts, by a factor, may enter them."""
        return replace(self, finest=self.finest.scaled(factor))

    def found(self, parts: Sequence[Part], scale: float) -> Avoids | None:
        """The report's entry: what finished hulls enter, how many and how deep, and what the input crosses."""
        told = [kept for kept in self.kept if kept.is_told]
        if not told:
            return None
        depths = np.array([[kept.depth(part.hull) for part in parts] for kept in told])
        each = [(kept.name, own) for kept, own in zip(told, depths, strict=True) if own.any()]
        entered = (Entered(name, int(np.count_nonzero(own)), float(own.max()) / scale) for name, own in each)
        return Avoids(tuple(kept.name for kept in told if kept.is_crossed), tuple(entered))

    @staticmethod
    def warnings_of(found: Avoids, unit: Unit, *, is_stopped: bool) -> list[str]:
        """A sentence for each obstacle that is entered all the same, with lengths in a unit."""
        share = f"{FINEST_SHARE:.0%} of the threshold"
        no_finer = f"parts within {share}, and those that limits leave no way, are cut no further"
        reason = "the work was stopped before" if is_stopped else no_finer
        return [
            *(f"The input itself crosses {name}, so hulls are not kept out of it there." for name in found.crossed),
            *(
                f"{one.hulls} hull{'s enter' if one.hulls > 1 else ' enters'} {one.name}, up to "
                f"{unit.words(one.depth_abs)} deep: {reason}."
                for one in found.entered
            ),
        ]


def _outside(triangles: FloatArray, surface: _native.Surface) -> tuple[FloatArray, bool]:
    """The triangles [T, 3, 3], long ones halved, that neither cross a closed surface nor lie inside it."""
    kept, is_crossed = [], False
    for _ in range(_HALVINGS):
        crossing = surface.crossing(*_mesh(triangles), TOLERANCE)
        is_off = np.ones(len(triangles), dtype=bool)
        is_off[crossing] = False
        kept.append(triangles[is_off])
        triangles = triangles[~is_off]
        sides = np.roll(triangles, -1, axis=1) - triangles
        lengths = dots(sides, sides)
        is_small = lengths.max(axis=1, initial=0.0) <= SMALL**2
        is_crossed |= bool(is_small.any())
        triangles = _halved(triangles[~is_small], lengths[~is_small])
        if not len(triangles):
            break
    off = np.concatenate(kept)
    inside = (
        surface.winding(np.ascontiguousarray(off.mean(axis=1)), is_closed=True) > 0.5 if len(off) else off[:0, 0, 0] > 0
    )
    return off[~inside], is_crossed or bool(inside.any())


def _halved(triangles: FloatArray, lengths: FloatArray) -> FloatArray:
    """Both halves of triangles [T, 3, 3], across their longest sides."""
    each, start = np.arange(len(triangles)), lengths.argmax(axis=1) if len(triangles) else np.empty(0, dtype=np.intp)
    a, b, c = (triangles[each, (start + k) % 3] for k in range(3))
    middle = (a + b) / 2
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _mesh(triangles: FloatArray) -> tuple[FloatArray, NDArray[np.int32]]:
    corners = np.ascontiguousarray(triangles.reshape(-1, 3))
    return corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
