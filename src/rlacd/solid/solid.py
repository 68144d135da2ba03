"""A repaired input: the closed solid to be cut, and the surface that everything is measured against."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from rlacd._native import Surface
from rlacd.report import BodyRepair, Hole
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import Frame
from rlacd.solid.input_mesh import no_points

Shape: TypeAlias = Manifold | tuple[FloatArray, NDArray[np.int32]]
"""A closed solid: a manifold, or vertices float64 ``[V, 3]`` and faces int32 ``[F, 3]``."""


@dataclass(frozen=True)
class Solid:
    """A closed, oriented solid in the normalised frame.

    Attributes
    ----------
    shape
        The union of all repaired bodies, without inner cavities: a manifold, or its vertices float64 ``[V, 3]`` and
        faces int32 ``[F, 3]`` in the order that manifold3d would give them.
    surface
        Vertices float64 ``[V, 3]`` and faces int32 ``[F, 3]`` of the input, duplicates dropped, nothing else changed.
    frame
        From the input's unit to the frame and back.
    bodies
        What was done to each body.
    warnings
        One sentence for each thing the user should know.
    holes
        The holes of bodies that have an inside, the most doubtful first.
    body_of
        ``[F]``, the body of each face of the surface; None if the solid did not go through the steps.
    is_as_given
        Whether the shape is the surface, in another order.
    is_apart
        Whether the shape is a slab for each face, which overlap: sheets cross too often to be united.
    index
        The surface, ready for queries, if repair made any.
    pieces
        Closed solids whose union, without its cavities, the shape is; none if that is not known, or there is only one.
        They may be removed when they are no longer needed: they take as much memory as the shape.
    left_out
        ``[N, 3]``, corners of faces that have two corners or all three in one place, if they are those of no other
        face.
    cavity_walls
        Faces around the cavities that were filled, as the input winds them, and around what stands in them; None if
        there were none. With the shape's own faces, they bound what the input bounds.
    """

    shape: Shape
    surface: tuple[FloatArray, NDArray[np.int32]]
    frame: Frame
    bodies: tuple[BodyRepair, ...]
    warnings: tuple[str, ...]
    holes: tuple[Hole, ...] = ()
    body_of: NDArray[np.int64] | None = None
    is_as_given: bool = False
    is_apart: bool = False
    index: Surface | None = None
    pieces: list[Shape] = field(default_factory=list)
    left_out: FloatArray = field(default_factory=no_points)
    cavity_walls: Shape | None = None

    @property
    def vertices(self) -> FloatArray:
        """Of the shape ``[V, 3]``."""
        return self.mesh[0]

    @property
    def faces(self) -> NDArray[np.int32]:
        """Of the shape ``[F, 3]``, outward."""
        return self.mesh[1]

    @property
    def weighed(self) -> list[tuple[FloatArray, NDArray[np.int32]]]:
        """Meshes ``[V, 3]``, ``[F, 3]`` that together bound what the input bounds: the solid less its cavities."""
        return [self.mesh] if self.cavity_walls is None else [self.mesh, mesh_of(self.cavity_walls)]

    @property
    def is_sheets(self) -> bool:
        """Whether it is made of sheets only, which were given thickness."""
        return len(self.bodies) > 0 and all(body.step == "slab" for body in self.bodies)

    @cached_property
    def manifold(self) -> Manifold:
        """The shape, ready for booleans; made when first needed, which takes longer than all of repair."""
        if isinstance(self.shape, Manifold):
            return self.shape
        return Manifold(Mesh64(self.vertices, self.faces.astype(np.uint64)))

    @cached_property
    def mesh(self) -> tuple[FloatArray, NDArray[np.int32]]:
        """Vertices and faces of the shape."""
        return mesh_of(self.shape)


def mesh_of(shape: Shape) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the vertices ``[V, 3]`` and faces ``[F, 3]`` of a shape."""
    return surface_of(shape) if isinstance(shape, Manifold) else shape


def surface_of(manifold: Manifold) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the vertices ``[V, 3]`` and faces ``[F, 3]`` of a manifold."""
    mesh = manifold.to_mesh64()
    vertices = np.ascontiguousarray(mesh.vert_properties[:, :3], dtype=np.float64)
    return vertices, np.ascontiguousarray(mesh.tri_verts, dtype=np.int32)
