"""The interface of criteria for cutting, merging, search and report."""

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
    """Whether a solid clipped to a hull may meet a criterion (see native/distance/filling.hpp)."""

    MAYBE = 0
    NO = 1
    NEVER = 2
    """The solid clipped to any hull that contains this one does not meet it either."""


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
        """Total volume of the hulls of the pieces it was glued from."""

    @property
    def within(self) -> Part | None:
        """The part it was cut from, whose hull contains this one's."""

    def with_hull(self, hull: Hull) -> Part:
        """Get the same solid with another hull."""


@dataclass(frozen=True)
class CriterionSummary:
    """A criterion's contribution to the report.

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
        """Distance beyond which the union of two components cannot meet the criterion."""

    @property
    def is_hereditary(self) -> bool:
        """Whether no union that contains a part that fails the criterion can meet it."""

    def excludes(self, volume: float, hull_volume: float) -> bool:
        """Whether the volumes alone show that a part cannot meet the criterion (cheap)."""

    def feasibility(self, filling: _native.Filling, hull: Hull) -> Feasibility:
        """Decide cheaply whether a solid clipped to a hull may meet the criterion."""

    def feasibilities(
        self, filling: _native.Filling, hulls: Sequence[Hull], pairs: IntArray, threads: int
    ) -> tuple[FloatArray, IntArray]:
        """Volumes [P] of the joint hulls of pairs [P, 2] of hulls (undefined for `NEVER`), and the `feasibility` [P] of
        each."""

    def forbids(self, filling: _native.Filling, hull: Hull) -> bool:
        """Whether the solid clipped to a hull, or to any hull that contains it, certainly fails the criterion.

        Cheaper than `feasibility`; False if unknown.
        """

    def is_met(self, part: Part) -> bool:
        """Decide strictly whether the part meets the criterion."""

    def filled(self, part: Part) -> float:
        """Volume that a joint hull may fill for free on account of this part; the cheapest pairs are merged first."""

    def settled(self, parts: Sequence[Part]) -> Criterion:
        """Get the criterion to use after cutting, given the parts that cutting has reached.

        If no cut could make a part meet it, a criterion may relax, and must report that.
        """

    def least_error(self, volume: float, hull_volume: float) -> float:
        """Lower bound of the measured error, from the volumes alone."""

    def error(self, part: Part) -> float:
        """Tight upper bound of the error that the criterion compares with its threshold."""

    def scaled(self, factor: float) -> Criterion:
        """Get the same criterion with a threshold larger by `factor`."""

    @property
    def overhang(self) -> float:
        """How far the hull of a part that meets the criterion may reach beyond the part's surface."""

    @property
    def obstacles(self) -> Balls | None:
        """Balls that no hull may touch, if the criterion is defined by balls."""

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """Summarise how well finished parts meet the criterion; `errors` holds that of each part, None if unknown."""
