"""A repaired input: the closed solid to be cut, and the surface that everything is measured against."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np
from numpy.typing import NDArray

from rlacd.solid.frame import FloatArray, Frame


@dataclass(frozen=True)
class BodyRepair:
    """What was done to one body, a set of faces connected by edges.

    Attributes
    ----------
    body
        Number of the body, by its first face in the input.
    step
        The last step it needed, one of `rlacd.repair.repair.STEPS`.
    faces_in, faces_out
        Triangles before and after; a body joined to others counts its share before the union.
    deviation
        Greatest distance, in frame units, from the repaired surface to the input's, or from a point of the input that
        the repaired solid misses to that solid.
    """

    body: int
    step: str
    faces_in: int
    faces_out: int
    deviation: float


@dataclass(frozen=True)
class Solid:
    """A closed, oriented solid in the normalised frame.

    Attributes
    ----------
    manifold
        The union of all repaired bodies, without inner cavities.
    surface
        Vertices float64 ``[V, 3]`` and faces int32 ``[F, 3]`` of the input, duplicates dropped, nothing else changed.
    frame
        From the input's unit to the frame and back.
    bodies
        What was done to each body.
    warnings
        One sentence for each thing the user should know.
    """

    manifold: manifold3d.Manifold
    surface: tuple[FloatArray, NDArray[np.int32]]
    frame: Frame
    bodies: tuple[BodyRepair, ...]
    warnings: tuple[str, ...]
