"""A robot's bodies: what each format's plan finds, what is decomposed, and what is written.

A *body* is what moves as one: a link of a URDF, a body of an MJCF model, a rigid body of a USD stage. Its meshes with
the same contact properties are one *collider*, which is decomposed as one solid, and whose first mesh the hulls
replace.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh

from rlacd.decomposition import Decomposition
from rlacd.errors import MeshFileError
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.hull import Hull
from rlacd.solid.poses import inverse, moved, product
from rlacd.solid.topology import used_points


@dataclass(frozen=True, eq=False)
class Surface:
    """The triangles of a mesh file, read once.

    Attributes
    ----------
    path
        The file, or the prim of a stage.
    vertices, faces
        ``[V, 3]`` and ``[F, 3]``, in the file's coordinates; of a COLLADA file in metres.
    """

    path: Path
    vertices: FloatArray
    faces: Int64Array


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A mesh where an element of the description puts it.

    Attributes
    ----------
    surface
        Its triangles.
    scale
        The factors ``[3]`` on its coordinates, after `reference`; negative ones mirror.
    to_body
        Pose ``[4, 4]`` of the element in the frame of its body.
    reference
        Rigid transform ``[4, 4]`` of the file's coordinates before all else (``refpos``, ``refquat`` of MJCF).
    """

    surface: Surface
    scale: FloatArray
    to_body: FloatArray
    reference: FloatArray

    @property
    def key(self) -> Hashable:
        """Equal where the same arrays of triangles are used in the same way."""
        arrays = id(self.surface.vertices), id(self.surface.faces)
        return *arrays, self.scale.tobytes(), self.reference.tobytes()

    @property
    def points(self) -> FloatArray:
        """Its vertices ``[V, 3]`` in the frame of the element."""
        return moved(self.reference, self.surface.vertices) * self.scale

    @property
    def faces(self) -> Int64Array:
        """Its faces ``[F, 3]``, turned around if the scale mirrors."""
        faces = self.surface.faces
        return faces if self.scale.prod() > 0 else faces[:, ::-1]


@dataclass(frozen=True, eq=False)
class Collider:
    """Meshes of a body that collide as one solid, which is decomposed in the frame of the first one's element.

    Attributes
    ----------
    name
        For files and other elements: that of its mesh, or of its body if it has several.
    meshes
        At least one.
    """

    name: str
    meshes: tuple[PlacedMesh, ...]

    @cached_property
    def _poses(self) -> list[FloatArray]:
        """Poses of the meshes' elements in the frame of the first."""
        first = inverse(self.meshes[0].to_body)
        return [np.eye(4), *(product(first, mesh.to_body) for mesh in self.meshes[1:])]

    @property
    def key(self) -> Hashable:
        """Equal for colliders that are the same solid."""
        return tuple((mesh.key, pose.tobytes()) for mesh, pose in zip(self.meshes, self._poses, strict=True))

    def mesh(self) -> trimesh.Trimesh:
        """All its meshes, in the frame of the first one's element."""
        return _joined(self.meshes, self._poses)

    def in_file(self, hull: trimesh.Trimesh) -> trimesh.Trimesh:
        """A hull in the coordinates of the first mesh's file, which the description places as it does that mesh.

        Raises
        ------
        MeshFileError
            The scale cannot be inverted.
        """
        first = self.meshes[0]
        with np.errstate(over="ignore", invalid="ignore"):
            points = moved(inverse(first.reference), np.ascontiguousarray(hull.vertices / first.scale))
        if not np.isfinite(points).all():
            scale = tuple(first.scale.tolist())
            raise MeshFileError(f"{first.surface.path} has the scale {scale}, which cannot be inverted: correct it.")
        exact = Hull.of(points)
        if exact is not None:
            return trimesh.Trimesh(exact.vertices, exact.faces, process=False)
        return trimesh.Trimesh(points, hull.faces if first.scale.prod() > 0 else hull.faces[:, ::-1], process=False)


@dataclass(frozen=True, eq=False)
class Body:
    """What moves as one.

    Attributes
    ----------
    name
        As in the file.
    pose
        ``[4, 4]``, where it stands with all joints at zero.
    colliders
        Its solids; their meshes are those that are replaced.
    is_world
        Whether it belongs to no body, and never moves.
    """

    name: str
    pose: FloatArray
    colliders: Sequence[Collider]
    is_world: bool = False

    def mesh(self) -> trimesh.Trimesh:
        """All meshes that are replaced, in the body's frame."""
        meshes = [mesh for collider in self.colliders for mesh in collider.meshes]
        return _joined(meshes, [mesh.to_body for mesh in meshes])

    def hulls(self, results: Mapping[Collider, Decomposition]) -> list[trimesh.Trimesh]:
        """The hulls in their place, in the body's frame; `results` are in those of the colliders."""
        each = [(collider.meshes[0].to_body, hull) for collider in self.colliders for hull in results[collider].hulls]
        return [trimesh.Trimesh(*turned(pose, hull.vertices, hull.faces), process=False) for pose, hull in each]


def placed(bodies: Sequence[Body], poses: Sequence[FloatArray]) -> list[trimesh.Trimesh]:
    """The meshes of bodies where poses put them."""
    meshes = [(pose, body.mesh()) for body, pose in zip(bodies, poses, strict=True)]
    return [trimesh.Trimesh(*turned(pose, mesh.vertices, mesh.faces), process=False) for pose, mesh in meshes]


def size_of(bodies: Sequence[Body]) -> float:
    """The longest side of the box around all meshes that are replaced, with all joints at zero; 0 without any.

    The world's count only if there is nothing else: a robot may stand on a terrain of any size.
    """
    moving = [body for body in bodies if not body.is_world] or bodies
    meshes = placed(moving, [body.pose for body in moving])
    used = [used_points(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes]
    return float(np.ptp(np.concatenate(used), axis=0).max()) if used else 0.0


def _joined(meshes: Sequence[PlacedMesh], poses: Sequence[FloatArray]) -> trimesh.Trimesh:
    parts = [turned(pose, mesh.points, mesh.faces) for mesh, pose in zip(meshes, poses, strict=True)]
    begins = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [faces + begin for (_, faces), begin in zip(parts, begins, strict=False)]
    return trimesh.Trimesh(np.concatenate([points for points, _ in parts]), np.concatenate(faces), process=False)


def turned(pose: FloatArray, points: FloatArray, faces: Int64Array) -> tuple[FloatArray, Int64Array]:
    """Points and faces where a pose puts them; those of a USD stage may mirror."""
    return moved(pose, points), faces if np.linalg.det(pose[:3, :3]) > 0 else faces[:, ::-1]
