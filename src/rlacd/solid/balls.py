"""Balls that stand for space which a decomposition must leave free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.frame import Frame


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls, in the order they were placed.

    Attributes
    ----------
    centres : float64 [B, 3]
    radii : float64 [B]
    """

    centres: FloatArray
    radii: FloatArray

    def __len__(self) -> int:
        return len(self.radii)

    def some(self, which: BoolArray | NDArray[np.intp]) -> Balls:
        """Those of a mask, or with these numbers."""
        return Balls(self.centres[which], self.radii[which])

    def in_input(self, frame: Frame) -> Balls:
        """Map balls from the normalised frame to the input's frame and unit."""
        return Balls(frame.to_input(self.centres), self.radii / frame.scale)


NO_BALLS = Balls(np.empty((0, 3)), np.empty(0))
