"""A mesh as read: the output of loading, the input of repair."""

from __future__ import annotations

from dataclasses import dataclass

from rlacd.solid.arrays import FloatArray
from rlacd.solid.topology import IntArray


@dataclass(frozen=True)
class InputMesh:
    """The triangles as given.

    Attributes
    ----------
    vertices
        float64 ``[V, 3]``, finite, in the input's unit. Vertices that no face uses are kept.
    faces
        int64 ``[F, 3]``, in range; empty for a point cloud.
    name
        File name, or the kind of object given.
    warnings
        What was left out.
    """

    vertices: FloatArray
    faces: IntArray
    name: str
    warnings: tuple[str, ...]
