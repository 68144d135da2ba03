"""Active parts by number, with the sums that merge costs need."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from rlacd import _native
from rlacd.criteria.criterion import Criterion
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Part


class NumberedParts:
    """Active parts by number; numbers ascend and are never reused.

    Parameters
    ----------
    parts : sequence of Part
        They get the numbers 0, 1, ...
    criterion : Criterion
        Tells the volume credited to each part.

    Attributes
    ----------
    parts : dict of int to Part
    bodies : list of ConvexBody
        Hulls by number, also of removed parts.
    boxes : Boxes
    whole : Component
        The solid that the parts' hulls are held against.
    """

    def __init__(self, parts: Sequence[Part], criterion: Criterion) -> None:
        self.parts: dict[int, Part] = {}
        self.bodies: list[_native.ConvexBody] = []
        self.boxes = _native.Boxes([])
        self._criterion = criterion
        self._first: list[int] = []  # of each part: the number of the first one united in it
        self.whole = parts[0].whole
        self._summands = np.empty((3, 2 * len(parts)))  # uniting pairs makes fewer than twice as many
        for part in parts:
            self.add(part)

    def add(self, part: Part) -> int:
        """Add a part, and get its number."""
        number, hull = len(self.bodies), part.hull
        if number == self._summands.shape[1]:
            self._summands = np.concatenate([self._summands, np.empty((3, number + 1))], axis=1)
        self._summands[:, number] = len(hull.vertices), part.volume, self._criterion.credit(part)
        self.parts[number] = part
        self._first.append(number)
        self.bodies.append(hull.body)
        self.boxes.add(number, hull.body)
        return number

    def remove(self, numbers: Collection[int]) -> None:
        """Remove parts."""
        for number in numbers:
            del self.parts[number]
        self.boxes = self.boxes.without([*numbers])

    def unite(self, first: int, second: int, union: Part) -> int:
        """Replace two parts by their union, and get its number."""
        self.remove([first, second])
        number = self.add(union)
        self._first[number] = min(self._first[first], self._first[second])
        return number

    def in_order(self) -> list[Part]:
        """The parts, ordered by the first that was united in each."""
        return [self.parts[number] for number in sorted(self.parts, key=self._first.__getitem__)]

    def sums(self, pairs: IntArray) -> FloatArray:
        """Sums over both parts of each pair [P, 2]: hull vertices, volumes, and credited volumes [3, P]."""
        return np.asarray(self._summands[:, pairs[:, 0]] + self._summands[:, pairs[:, 1]])
