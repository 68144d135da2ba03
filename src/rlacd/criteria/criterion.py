"""What the loop, the merging and the finish ask of a criterion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.balls import Balls
from rlacd.solid.hull import Hull


class Feasibility(IntEnum):
    """Whether what a solid fills of a hull may meet a criterion (see native/distance/filling.hpp)."""

    MAYBE = 0
    NO = 1
    NEVER = 2
    """Nor does what it fills of any hull that holds this one."""


class Part(Protocol):
    """A solid with its hull; everything in the normalised frame."""

    @property
    def vertices(self) -> FloatArray:
        """Points of a surface that bounds the solid [V, 3]."""

    @property
    def faces(self) -> IntArray:
        """Triangles of that surface [F, 3]."""

    @property
    def volume(self) -> float:
        """Volume of the solid."""

    @property
    def hull(self) -> Hull:
        """A convex hull that contains it."""

    @property
    def piece_hulls(self) -> float:
        """Volumes of the hulls of the pieces it was glued from, added up."""

    @property
    def within(self) -> Part | None:
        """A part whose hull contains this one's: what it was cut from."""

    def with_hull(self, hull: Hull) -> Part:
        """Get the same solid with another hull around it."""


@dataclass(frozen=True)
class CriterionSummary:
    """What a report says of a criterion.

    Attributes
    ----------
    entries
        Keys and plain values for the report.
    warnings
        One sentence for everything that falls short.
    """

    entries: dict[str, Any]
    warnings: tuple[str, ...] = ()


class Criterion(Protocol):
    """When a component is close enough to its hull to be a part."""

    @property
    def reach(self) -> float:
        """No union of two components farther apart than this can meet the criterion."""

    @property
    def is_hereditary(self) -> bool:
        """Whether a part that does not meet the criterion cannot meet it together with others either."""

    def excludes(self, volume: float, hull_volume: float) -> bool:
        """Tell from the volumes alone that a part cannot meet the criterion (cheap, necessary)."""

    def feasibility(self, filling: _native.Filling, hull: Hull) -> Feasibility:
        """Tell cheaply whether what a solid fills of a hull may meet the criterion."""

    def feasibilities(
        self, filling: _native.Filling, hulls: Sequence[Hull], pairs: IntArray, threads: int
    ) -> tuple[FloatArray, IntArray]:
        """Volumes [P] of the joint hulls of pairs [P, 2] of hulls, but for `NEVER`, and the `feasibility` [P] of
        each."""

    def forbids(self, filling: _native.Filling, hull: Hull) -> bool:
        """Whether what a solid fills of a hull, and of any that holds it, does not meet it: cheaper than `feasibility`.

        It need not be known; False then.
        """

    def is_met(self, part: Part) -> bool:
        """Decide strictly whether the part meets the criterion."""

    def filled(self, part: Part) -> float:
        """Volume that a joint hull may fill at no cost for this part's sake; cheapest pairs are merged first."""

    def settled(self, parts: Sequence[Part]) -> Criterion:
        """Get the criterion as it is to be from now on, given the finest parts that cutting has reached.

        Where no cut could make a part meet it, a criterion may have to give way, and say so.
        """

    def least_error(self, volume: float, hull_volume: float) -> float:
        """Bound from below, by the volumes alone, what the criterion measures."""

    def error(self, part: Part) -> float:
        """Bound from above, tightly, what the criterion compares with its threshold."""

    def scaled(self, factor: float) -> Criterion:
        """Get the same criterion with a threshold larger by `factor`."""

    @property
    def overhang(self) -> float:
        """How far the hull of a part that meets the criterion may reach beyond the part's surface."""

    @property
    def obstacles(self) -> Balls | None:
        """Balls that no hull may touch, where the criterion is made of them."""

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """Tell how well finished parts meet the criterion, given the error of each; None where they are not known."""
