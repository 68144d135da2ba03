"""Sampling in proportion to changing weights: a binary sum tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


class SumTree:
    """Weights of `size` items; setting and drawing take logarithmic time.

    Invariant: node i holds the sum of nodes 2 i and 2 i + 1; the items are the leaves. Sums are always recomputed from
    the two children, never updated by differences, so they depend on the weights alone, not on their history.
    """

    def __init__(self, size: int) -> None:
        self._depth = max(int(np.ceil(np.log2(max(size, 1)))), 0)
        self._leaves = 1 << self._depth
        self._sums = np.zeros(2 * self._leaves)

    @property
    def total(self) -> float:
        """Sum of all weights."""
        return float(self._sums[1])

    def get(self, items: ArrayLike) -> NDArray[np.float64]:
        """Weights of some items."""
        weights: NDArray[np.float64] = self._sums[np.asarray(items, dtype=np.int64) + self._leaves]
        return weights

    def set(self, items: NDArray[np.int64], weights: NDArray[np.float64]) -> None:
        """Set weights >= 0; for an item named twice the last weight counts."""
        nodes = np.asarray(items, dtype=np.int64) + self._leaves
        self._sums[nodes] = weights
        for _ in range(self._depth):
            nodes = np.unique(nodes // 2)
            self._sums[nodes] = self._sums[2 * nodes] + self._sums[2 * nodes + 1]

    def draw(self, at: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the items at fractions `at`, in [0, 1), of the cumulative weights."""
        remaining = np.asarray(at) * self.total
        nodes = np.ones(len(remaining), dtype=np.int64)
        for _ in range(self._depth):
            left = self._sums[2 * nodes]
            # If rounding pushes a fraction past the last weight, it stays with the last item of positive weight.
            right = (remaining >= left) & (self._sums[2 * nodes + 1] > 0)
            remaining = np.where(right, remaining - left, remaining)
            nodes = 2 * nodes + right
        return nodes - self._leaves
