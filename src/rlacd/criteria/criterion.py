"""What the loop, the merging and the finish ask of a criterion."""

from __future__ import annotations

from typing import Protocol

from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.hull import Hull


class Part(Protocol):
    """A closed solid with its hull; everything in the normalised frame."""

    vertices: FloatArray
    faces: IntArray

    @property
    def volume(self) -> float:
        """Volume of the solid."""

    @property
    def hull(self) -> Hull:
        """A convex hull that contains it."""


class Criterion(Protocol):
    """When a component is close enough to its hull to be a part."""

    @property
    def reach(self) -> float:
        """No union of two components farther apart than this can meet the criterion."""

    def excludes(self, volume: float, hull_volume: float) -> bool:
        """Tell from the volumes alone that a part cannot meet the criterion (cheap, necessary)."""

    def is_met(self, part: Part) -> bool:
        """Decide strictly whether the part meets the criterion."""

    def least_error(self, volume: float, hull_volume: float) -> float:
        """Bound from below, by the volumes alone, what the criterion measures."""

    def error(self, part: Part) -> float:
        """Bound from above, tightly, what the criterion compares with its threshold."""

    def scaled(self, factor: float) -> Criterion:
        """Get the same criterion with a threshold larger by `factor`."""
