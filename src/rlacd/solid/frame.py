"""The normalised frame in which every length is measured: bounding box centred, longest side 2.

Here is also how thick sheets are made, which have no volume of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rlacd import _native
from rlacd.fit import ANY, Unit
from rlacd.solid.arrays import FloatArray, heights

SMALLEST = 1e-300
"""Half the longest side of the smallest box that is scaled to fill the frame; a smaller one becomes a speck in it."""

NOTHING = 2.0**-280
"""Frame coordinates below this become 0: products of three, which exact predicates rely on, would underflow."""

ROUNDING = 1e-9
"""What rounding may add to a length in the frame, or along a grid of cells, and some."""

HALF_THICKNESS = 1e-3
"""Half the thickness of the slab a sheet becomes, in frame units; other lengths are multiples of it."""

GROWTH_TO_SPARE = HALF_THICKNESS / 2
"""Hulls may grow by this more than they must to take in a surface: fewer, larger triangles are looked at."""

# Coordinates below this, in the frame, are written as 0: what is left of a difference means nothing.
_NAUGHT = HALF_THICKNESS / 10


@dataclass(frozen=True)
class Frame:
    """The similarity ``x_frame = (x - center) * scale`` between the input and the normalised frame.

    Attributes
    ----------
    center
        ``[3]``, the centre of the input's bounding box, in the input's unit.
    scale
        Frame units per input unit: 2 divided by the longest side of the box, 1 when the box is a single point.
    told_in
        The unit in which lengths are told.
    """

    center: FloatArray
    scale: float
    told_in: Unit = ANY

    @classmethod
    def of(cls, points: ArrayLike, told_in: Unit = ANY) -> Frame:
        """Return the frame of finite points ``[N, 3]``; without points, the identity."""
        points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        if len(points) == 0:
            return cls(np.zeros(3), 1.0, told_in)
        lower, upper = points.min(axis=0), points.max(axis=0)
        # Halve before adding: the sum of two coordinates near 1e308 would overflow.
        center = lower / 2 + upper / 2
        half = float((upper / 2 - lower / 2).max())
        return cls(center, 1.0 / max(half, SMALLEST) if half > 0 else 1.0, told_in)

    @property
    def unit(self) -> Unit:
        """The unit in which lengths are told, for lengths in the frame."""
        return self.told_in.scaled(self.scale)

    @property
    def resolution(self) -> float:
        """Spacing of adjacent coordinates of the input, in the frame; large where the input lies far from 0."""
        return float(np.finfo(np.float64).eps) * (float(np.abs(self.center).max()) * float(self.scale) + 1.0)

    def to_frame(self, points: ArrayLike) -> FloatArray:
        """Map points ``[N, 3]`` from the input's unit into the frame."""
        there = np.ascontiguousarray((np.asarray(points, dtype=np.float64) - self.center) * self.scale)
        there[np.abs(there) < NOTHING] = 0.0
        return there

    def to_input(self, points: ArrayLike) -> FloatArray:
        """Map points ``[N, 3]`` from the frame back to the input's unit."""
        return np.ascontiguousarray(np.asarray(points, dtype=np.float64) / self.scale + self.center)

    def place(self, point: ArrayLike, body: int | None = None) -> str:
        """A point ``[3]`` of the frame as text, in the input's unit, and the body there if there are several."""
        place = self.to_input(point)
        place[np.abs(place) < _NAUGHT / self.scale] = 0.0
        where = "(" + ", ".join(f"{x:.4g}" for x in place) + ")"
        return where if body is None else f"{where}, body {body}"


def thickened(points: FloatArray) -> FloatArray:
    """Return points ``[N, 3]``, with copies to both sides along the axes in which they have no extent."""
    axes = _native.principal_axes_of_points(points)
    extent = np.ptp(heights(points - points.mean(axis=0), axes), axis=0)
    for axis in axes[extent < HALF_THICKNESS]:
        points = np.concatenate([points - HALF_THICKNESS * axis, points + HALF_THICKNESS * axis])
    return np.ascontiguousarray(points)
