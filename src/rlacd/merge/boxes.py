"""Pairs of parts with nearby bounding boxes, found by sorting the boxes along one axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rlacd._native import poll_stop
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray
from rlacd.solid.component import Part

Places: TypeAlias = "NDArray[np.intp]"
"""Indices into the boxes [N]."""

AT_ONCE = 1 << 20
"""Pairs of boxes held in memory at a time."""


class Boxes:
    """The boxes of parts under ascending ids.

    Parameters
    ----------
    parts : mapping of int to Part
    """

    def __init__(self, parts: Mapping[int, Part]) -> None:
        self.ids = np.fromiter(parts, dtype=np.int64, count=len(parts))
        self._boxes = np.array([part.box for part in parts.values()]).reshape(-1, 2, 3)

    def add(self, new: int, part: Part, gone: Sequence[int]) -> None:
        """Replace parts by a new one, whose id is larger than all before."""
        kept = ~np.isin(self.ids, gone)
        self.ids = np.append(self.ids[kept], new)
        self._boxes = np.concatenate([self._boxes[kept], part.box[None]])

    def without(self, ids: Sequence[int]) -> Boxes:
        """Get all boxes except those with the given ids."""
        other = Boxes.__new__(Boxes)
        kept = ~np.isin(self.ids, ids)
        other.ids, other._boxes = self.ids[kept], self._boxes[kept]
        return other

    def pairs(self, new: Sequence[int], reach: float, across: bool = False) -> IntArray:
        """Pairs of ids [P, 2], ascending, of a new part and any other part with boxes within reach of each other.

        With `across`, also pairs that are both within reach of a third part.
        """
        if not len(self.ids):
            return np.zeros((0, 2), dtype=np.int32)
        is_new = np.isin(self.ids, new)
        rows = np.flatnonzero(is_new)
        if across:
            rows, other = self._across(rows, reach)
        else:
            rows, other = self._near(rows, np.arange(len(self.ids)), reach)
        once = (rows != other) & ((rows < other) | ~is_new[other])  # two new parts find each other twice
        pairs = np.sort(np.stack([rows[once], other[once]], axis=1), axis=1)
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        return np.ascontiguousarray(self.ids[pairs], dtype=np.int32)

    def _across(self, rows: Places, reach: float) -> tuple[Places, Places]:
        """Pairs of a row and a box that are both within reach of some common box."""
        count = len(self.ids)
        if not np.isfinite(reach):
            return np.repeat(rows, count), np.tile(np.arange(count), len(rows))
        from_row, hop = self._near(rows, np.arange(count), reach)
        between = np.unique(hop)
        if not len(between):
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        hops = self._boxes[between]
        around = np.array([hops[:, 0].min(axis=0) - reach, hops[:, 1].max(axis=0) + reach])
        met = (self._boxes[:, 0] <= around[1]).all(axis=1) & (self._boxes[:, 1] >= around[0]).all(axis=1)
        from_hop, other = self._near(between, np.flatnonzero(met), reach)
        order = np.argsort(from_hop, kind="stable")
        from_hop, other = from_hop[order], other[order]
        begin = np.searchsorted(from_hop, hop)
        counts = np.searchsorted(from_hop, hop, side="right") - begin
        begins = np.flatnonzero(np.diff(from_row, prepend=-1))
        found = [
            self._beyond(other, begin[a:b], counts[a:b]) for a, b in zip(begins, [*begins[1:], len(hop)], strict=True)
        ]
        return np.repeat(from_row[begins], [len(some) for some in found]), np.concatenate(found)

    def _beyond(self, other: Places, begin: Places, counts: Places) -> Places:
        """The boxes within reach of any hop, whose own are `other[begin : begin + count]`; ascending."""
        poll_stop()
        is_beyond = np.zeros(len(self.ids), dtype=bool)
        bounds = np.searchsorted(np.cumsum(counts), np.arange(0, counts.sum() + AT_ONCE, AT_ONCE)[1:-1], side="right")
        for chunk in np.split(np.arange(len(begin)), np.unique(bounds)):
            some = counts[chunk]
            step = np.arange(some.sum()) - np.repeat(np.cumsum(some) - some, some)
            is_beyond[other[np.repeat(begin[chunk], some) + step]] = True
            if is_beyond.all():  # in a heap of boxes every hop leads everywhere
                break
        return np.flatnonzero(is_beyond)

    def _near(self, some: Places, others: Places, reach: float) -> tuple[Places, Places]:
        """Pairs of indices, one from `some` and one from `others`, whose boxes are within reach."""
        if len(some) == 1 or not np.isfinite(reach) or len(some) * len(others) <= AT_ONCE:
            row, column = np.nonzero(_within(self._boxes[some][:, None], self._boxes[others][None], reach))
            return some[row], others[column]
        low, high = self._boxes[others, 0], self._boxes[others, 1]
        extents = (high - low).max(axis=0)  # a box that contains a coordinate starts at most this far before it
        axis = int(np.argmin((extents + reach) / np.maximum(np.ptp(low, axis=0), 1e-300)))
        order = np.argsort(low[:, axis], kind="stable")
        begins = low[order, axis]
        slack = 1e-9 + 1e-9 * extents[axis]
        start = np.searchsorted(begins, self._boxes[some, 0, axis] - reach - extents[axis] - slack)
        counts = np.searchsorted(begins, self._boxes[some, 1, axis] + reach + slack, side="right") - start
        found: list[tuple[Places, Places]] = []
        bounds = np.searchsorted(np.cumsum(counts), np.arange(0, counts.sum() + AT_ONCE, AT_ONCE)[1:-1], side="right")
        for chunk in np.split(np.arange(len(some)), np.unique(bounds)):
            poll_stop()
            row = np.repeat(chunk, counts[chunk])
            ends = np.cumsum(counts[chunk])
            step = np.arange(len(row)) - np.repeat(ends - counts[chunk], counts[chunk])
            column = order[start[row] + step]
            near = _within(self._boxes[some[row]], self._boxes[others[column]], reach)
            found.append((some[row[near]], others[column[near]]))
        return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def _within(a: FloatArray, b: FloatArray, reach: float) -> BoolArray:
    """Whether boxes [..., 2, 3] are within reach of each other."""
    gap = np.maximum(np.maximum(a[..., 0, :] - b[..., 1, :], b[..., 0, :] - a[..., 1, :]), 0.0)
    near: BoolArray = np.sqrt(np.square(gap).sum(axis=-1)) <= reach
    return near
