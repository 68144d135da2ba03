"""What merging and the search ask before they judge a union: cheap tests that reject only what certainly fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull


class Feasibility(IntEnum):
    """Whether a solid clipped to a hull may meet a criterion (see native/distance/filling.hpp)."""

    MAYBE = 0
    NO = 1
    NEVER = 2
    """The solid clipped to any hull that contains this one does not meet it either."""


@dataclass(frozen=True)
class Screen:
    """Necessary conditions for a union to meet a criterion.

    The defaults suit a criterion that judges nothing but the hull of a part. Such a criterion needs no solid clipped to
    a joint hull: what fills the hull makes no difference, and the glued union of the pair has been judged already.

    Attributes
    ----------
    reach : float
        Distance beyond which the union of two components cannot meet the criterion.
    """

    reach: float

    @property
    def looks_inside(self) -> bool:
        """Whether the criterion judges what fills a hull, not the hull alone."""
        return False

    def filled(self, part: Part) -> float:
        """Volume that a joint hull may fill for free on account of this part; the cheapest pairs are merged first."""
        return part.piece_hulls

    def least_error(self, volume: float, hull_volume: float) -> float:
        """Lower bound of the criterion's error, from the volumes of a part and its hull alone."""
        return 0.0

    def excludes(self, volume: float, hull_volume: float) -> bool:
        """Whether the volumes alone show that a part cannot meet the criterion."""
        return False

    def feasibility(self, filling: _native.Filling, hull: Hull) -> Feasibility:
        """Decide whether a solid clipped to a hull may meet the criterion."""
        return Feasibility.NEVER

    def feasibilities(
        self, filling: _native.Filling, hulls: Sequence[Hull], pairs: IntArray, threads: int
    ) -> tuple[FloatArray, IntArray]:
        """Volumes [P] of the joint hulls of pairs [P, 2] of hulls (undefined for `NEVER`), and the `feasibility` [P] of
        each, decided less thoroughly."""
        return np.zeros(len(pairs)), np.full(len(pairs), int(Feasibility.NEVER), dtype=np.int32)

    def forbids(self, filling: _native.Filling, hull: Hull) -> bool:
        """Whether the solid clipped to a hull, or to any hull that contains it, certainly fails the criterion.

        Cheaper than `feasibility`; False if unknown.
        """
        return False
