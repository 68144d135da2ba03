"""Mass properties of a solid of density one: volume, centre of mass and inertia."""

from __future__ import annotations

from typing import Any

import numpy as np

from rlacd import _native
from rlacd.report import Mass
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.frame import Frame

_GREATEST = np.finfo(np.float64).max


def mass_of(vertices: FloatArray, faces: IntArray, frame: Frame) -> Mass:
    """Integrate over a closed, outward mesh ``[V, 3]``, ``[F, 3]`` in the frame."""
    volume, centre, inertia = _native.mesh_mass(
        np.ascontiguousarray(vertices, dtype=np.float64), np.ascontiguousarray(faces, dtype=np.int32)
    )
    with np.errstate(all="ignore"):  # at the ends of float64's range, volumes overflow or underflow
        unit = np.minimum(np.float64(1.0) / frame.scale, _GREATEST)
        return Mass(
            float(_times(volume, unit**3)),
            frame.to_input(np.array([centre]))[0],
            _times(inertia, unit**5),
        )


def _times(value: Any, factor: np.float64) -> FloatArray:
    """Multiply, within the range of floats."""
    return np.asarray(np.nan_to_num(value * factor, nan=0.0, posinf=_GREATEST, neginf=-_GREATEST))
