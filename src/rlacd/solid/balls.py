"""Balls that represent the space a decomposition must leave free."""

from __future__ import annotations

from dataclasses import dataclass

from rlacd.solid.arrays import FloatArray
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

    def in_input(self, frame: Frame) -> Balls:
        """Map balls from the normalised frame to the input's frame and unit."""
        return Balls(frame.to_input(self.centres), self.radii / frame.scale)
