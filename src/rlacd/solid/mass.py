"""Mass properties of a solid of density one: volume, centre of mass and inertia."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from trimesh.triangles import mass_properties

from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import Frame
from rlacd.solid.solid import Solid

_GREATEST = np.finfo(np.float64).max


@dataclass(frozen=True)
class Mass:
    """A body's mass, in the input's unit of length.

    Attributes
    ----------
    volume_abs
        Its mass at density one.
    centre_abs
        ``[3]``, the centre of mass.
    inertia_abs
        ``[3, 3]`` at density one, about the centre, along the input's axes.
    """

    volume_abs: float
    centre_abs: FloatArray
    inertia_abs: FloatArray

    def scaled(self, density: float) -> Mass:
        """Return the same body at another density."""
        return Mass(self.volume_abs * density, self.centre_abs, self.inertia_abs * density)


def mass_of(solid: Solid) -> Mass:
    """Integrate over a repaired input, which is closed whatever the input was."""
    return mass_of_triangles(solid.vertices[solid.faces], solid.frame)


def mass_of_triangles(triangles: FloatArray, frame: Frame) -> Mass:
    """Integrate over closed, outward triangles ``[F, 3, 3]`` in the frame."""
    found = mass_properties(triangles)
    with np.errstate(over="ignore", under="ignore"):  # at the ends of float64's range, volumes overflow or underflow
        unit = np.minimum(np.float64(1.0) / frame.scale, _GREATEST)
        return Mass(
            float(_times(found["volume"], unit, 3)),
            frame.to_input(found["center_mass"][None])[0],
            _times(found["inertia"], unit, 5),
        )


def _times(value: Any, unit: np.float64, power: int) -> FloatArray:
    """Multiply step by step, clipped to the largest float: a power of the unit itself may be infinite."""
    result = np.asarray(value, dtype=np.float64)
    for _ in range(power):
        result = np.clip(result * unit, -_GREATEST, _GREATEST)
    return result
