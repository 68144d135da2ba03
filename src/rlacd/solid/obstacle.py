"""What hulls stay out of: another mesh in the input's own frame and unit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rlacd.solid.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A surface of any quality.

    Attributes
    ----------
    name : str
    vertices : float64 [V, 3]
    faces : int32 [F, 3]
    margin : float
        How far hulls stay off it, in the input's unit.
    is_told : bool
        Whether the report says what became of it.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    margin: float = 0.0
    is_told: bool = True

    def scaled(self, factor: float) -> Obstacle:
        """Multiply all lengths."""
        return replace(self, vertices=self.vertices * factor, margin=self.margin * abs(factor))

    @property
    def triangles(self) -> FloatArray:
        """Corners of the triangles [F, 3, 3]."""
        return np.ascontiguousarray(self.vertices[self.faces], dtype=np.float64)
