"""Pairs of parts with nearby bounding boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import BoolArray, IntArray
from rlacd.solid.component import Part


class Boxes:
    """The boxes of parts under ascending ids.

    Parameters
    ----------
    parts : mapping of int to Part
    """

    def __init__(self, parts: Mapping[int, Part]) -> None:
        self.ids = np.fromiter(parts, dtype=np.int32, count=len(parts))
        self._boxes = np.array([part.box for part in parts.values()]).reshape(-1, 6)

    def add(self, new: int, part: Part, gone: Sequence[int]) -> None:
        """Replace parts by a new one, whose id is larger than all before."""
        kept = ~self._are(gone)
        self.ids = np.append(self.ids[kept], np.int32(new))
        self._boxes = np.concatenate([self._boxes[kept], part.box.reshape(1, 6)])

    def without(self, ids: Sequence[int]) -> Boxes:
        """Get all boxes except those with the given ids."""
        other = Boxes.__new__(Boxes)
        kept = ~self._are(ids)
        other.ids, other._boxes = self.ids[kept], self._boxes[kept]
        return other

    def pairs(self, new: Sequence[int], reach: float, across: bool = False) -> IntArray:
        """Pairs of ids [P, 2], ascending, of a new part and any other part with boxes within reach of each other.

        With `across`, also pairs that are both within reach of a third part.
        """
        return self.ids[_native.near_pairs(self._boxes, self._are(new), reach, across)]

    def _are(self, ids: Sequence[int]) -> BoolArray:
        """Whether each box has one of these ids, all of which are there."""
        mask = np.zeros(len(self.ids), dtype=bool)
        mask[np.searchsorted(self.ids, ids)] = True
        return mask
