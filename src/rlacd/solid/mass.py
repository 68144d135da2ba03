"""Mass properties of a solid of density one: volume, centre of mass and inertia."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray, dots
from rlacd.solid.frame import Frame

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

    def as_plain(self) -> dict[str, Any]:
        """Plain values that ``json`` can write."""
        centre, inertia = self.centre_abs.tolist(), self.inertia_abs.tolist()
        return {"volume_abs": self.volume_abs, "centre_abs": centre, "inertia_abs": inertia}

    @classmethod
    def of_plain(cls, plain: Mapping[str, Any]) -> Mass:
        """The mass that `as_plain` describes."""
        return cls(float(plain["volume_abs"]), np.array(plain["centre_abs"]), np.array(plain["inertia_abs"]))


def mass_of(vertices: FloatArray, faces: IntArray, frame: Frame) -> Mass:
    """Integrate over a closed, outward mesh ``[V, 3]``, ``[F, 3]`` in the frame."""
    volume, centre, inertia = _native.mesh_mass(
        np.ascontiguousarray(vertices, dtype=np.float64), np.ascontiguousarray(faces, dtype=np.int32)
    )
    with np.errstate(all="ignore"):  # at the ends of float64's range, volumes overflow or underflow
        unit = np.minimum(np.float64(1.0) / frame.scale, _GREATEST)
        return Mass(
            float(_times(volume, unit**3)),
            frame.to_input(centre[None])[0],
            _times(inertia, unit**5),
        )


def joint_mass(masses: Sequence[Mass]) -> Mass:
    """Add up bodies of density one that do not overlap."""
    volume = sum(mass.volume_abs for mass in masses)
    weights = [mass.volume_abs / volume if volume > 0 else 1 / len(masses) for mass in masses]
    centre = np.sum([weight * mass.centre_abs for weight, mass in zip(weights, masses, strict=True)], axis=0)
    inertia = np.zeros((3, 3))
    for mass in masses:
        away = mass.centre_abs - centre
        inertia += mass.inertia_abs + mass.volume_abs * (dots(away, away) * np.eye(3) - np.outer(away, away))
    return Mass(float(volume), centre, inertia)


def _times(value: Any, factor: np.float64) -> FloatArray:
    """Multiply, within the range of floats."""
    return np.asarray(np.nan_to_num(value * factor, nan=0.0, posinf=_GREATEST, neginf=-_GREATEST))
