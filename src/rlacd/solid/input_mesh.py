"""A mesh as it was read: what loading hands to repair."""

from __future__ import annotations

from dataclasses import dataclass

from rlacd.solid.arrays import FloatArray
from rlacd.solid.topology import IntArray


@dataclass(frozen=True)
class InputMesh:
    """Triangles as they were given.

    Attributes
    ----------
    vertices
        float64 ``[V, 3]``, finite, in the input's unit. Those no face uses are kept.
    faces
        int64 ``[F, 3]``, in range; empty for a point cloud.
    name
        File name, or what kind of object was given.
    warnings
        What was left out.
    """

    vertices: FloatArray
    faces: IntArray
    name: str
    warnings: tuple[str, ...]
