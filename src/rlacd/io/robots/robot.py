"""A robot file that has been read: its bodies, what of them is decomposed, and what becomes of it.

A *body* is what moves as one: a link of a URDF, a body of an MJCF model, a rigid body of a USD stage. Its meshes with
the same contact properties are one *collider*, which is decomposed as one solid, and whose first mesh the hulls
replace.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import trimesh

from rlacd.clear import LinkPair, Motion, Primitive
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshFileError
from rlacd.fit import Unit
from rlacd.options.output import Axis
from rlacd.options.robots import RobotOptions
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.hull import Hull
from rlacd.solid.poses import inverse, moved, product
from rlacd.solid.topology import compacted

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class MeshFile:
    """The triangles of a mesh file, or of the prim of a stage, in its coordinates; of a COLLADA file in metres."""

    path: Path
    vertices: FloatArray
    faces: Int64Array


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A mesh where an element of the description puts it."""

    file: MeshFile
    scale: FloatArray  # [3], on its coordinates, after `reference`; negative factors mirror
    to_body: FloatArray  # [4, 4], the pose of the element in the frame of its body
    reference: FloatArray  # [4, 4], of its coordinates before all else (``refpos``, ``refquat`` of MJCF)

    @property
    def key(self) -> Hashable:
        """Equal where the same arrays of triangles are used in the same way."""
        return id(self.file.vertices), id(self.file.faces), self.scale.tobytes(), self.reference.tobytes()

    @property
    def points(self) -> FloatArray:
        """Its vertices ``[V, 3]`` in the frame of the element."""
        return moved(self.reference, self.file.vertices) * self.scale

    @property
    def faces(self) -> Int64Array:
        """Its faces ``[F, 3]``, turned around if the scale mirrors."""
        return self.file.faces if self.scale.prod() > 0 else self.file.faces[:, ::-1]


@dataclass(frozen=True, eq=False)
class Collider:
    """Meshes of a body that collide as one solid, which is decomposed in the frame of the first one's element.

    Its name, for files and other elements, is that of its mesh, or of its body if it has several.
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
            raise MeshFileError(f"{first.file.path} has the scale {scale}, which cannot be inverted: correct it.")
        exact = Hull.of(points)
        if exact is not None:
            return trimesh.Trimesh(exact.vertices, exact.faces, process=False)
        return trimesh.Trimesh(points, hull.faces if first.scale.prod() > 0 else hull.faces[:, ::-1], process=False)


Results = Mapping[Collider, Decomposition]
"""The hulls of each collider, in its frame."""


@dataclass(frozen=True, eq=False)
class Body:
    """What moves as one and collides, by its name in the file."""

    name: str
    pose: FloatArray  # [4, 4], with all joints at zero
    colliders: Sequence[Collider]  # their meshes are those that are replaced
    is_world: bool = False  # whether it belongs to no body, and never moves
    primitives: Sequence[Primitive] = ()  # what else of it collides, in its frame; they stay

    def mesh(self) -> trimesh.Trimesh:
        """All meshes that are replaced, in the body's frame."""
        meshes = [mesh for collider in self.colliders for mesh in collider.meshes]
        return _joined(meshes, [mesh.to_body for mesh in meshes])

    def shapes(self) -> trimesh.Trimesh:
        """All that collides, in the body's frame: its meshes, and polyhedra around its primitives."""
        return trimesh.util.concatenate([self.mesh(), *(each.outside for each in self.primitives)])

    def hulls(self, results: Results) -> list[trimesh.Trimesh]:
        """The hulls in their place, in the body's frame."""
        return [turned(c.meshes[0].to_body, hull) for c in self.colliders for hull in results[c].hulls]


class Written(NamedTuple):
    """A robot that was written: the folder of its hulls, the names of each collider's, and what to say of it."""

    folder: Path
    names: Mapping[Collider, Sequence[str]]
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class Robot(ABC):
    """A robot file that has been read."""

    source: Path
    bodies: list[Body]  # those that collide, in the order of the file; of a stage, first those with meshes
    warnings: list[str]  # what of it is left unchanged, and why
    metres: float  # its unit of length
    up: Axis
    told_in: Unit | None = field(default=None, kw_only=True)  # the unit in which lengths are told; None for its own
    home: Path | None = field(default=None, kw_only=True)  # the folder that its result is moved to once it is written

    @abstractmethod
    def motion(self, samples: int, seed: int) -> Motion:
        """Where its bodies can be; at rest, and at so many joint positions if it has joints."""

    @abstractmethod
    def write(
        self, place: Path, results: Results, pairs: Sequence[LinkPair] | None, asked: RobotOptions, *, whole: bool
    ) -> Written:
        """Write it with hulls in the place of its meshes; of a stage all of it, or a layer over the original.

        `pairs` are what each two bodies do; None if that is not known.
        """

    @property
    def is_alone(self) -> bool:
        """Whether at most one of its bodies collides."""
        return len(self.bodies) < 2

    @property
    def replaced(self) -> list[Body]:
        """Its bodies with meshes, which hulls replace."""
        return [body for body in self.bodies if body.colliders]

    def shapes(self, poses: Sequence[FloatArray] | None = None) -> list[trimesh.Trimesh]:
        """What collides of its bodies where poses put them, by default at rest."""
        where = [body.pose for body in self.bodies] if poses is None else poses
        return [turned(pose, body.shapes()) for body, pose in zip(self.bodies, where, strict=True)]

    @cached_property
    def size(self) -> float:
        """The longest side of the box around all that collides, with all joints at zero; 0 if nothing does.

        The world's counts only if there is nothing else: a robot may stand on a terrain of any size.
        """
        each = zip(self.bodies, self.shapes(), strict=True)
        moving = [mesh for body, mesh in each if not body.is_world] or self.shapes()
        used = [compacted(np.asarray(mesh.vertices), np.asarray(mesh.faces))[0] for mesh in moving]
        return float(np.ptp(np.concatenate(used), axis=0).max()) if used else 0.0

    @property
    def unit(self) -> Unit:
        """The unit in which lengths are told."""
        return Unit.of(self.metres) if self.told_in is None else self.told_in


def colliders(body: str, uses: Sequence[tuple[Hashable | None, PlacedMesh, Found]]) -> dict[Collider, list[Found]]:
    """Join the meshes of a body that are of the same kind; those of the kind None, and clouds of points, stay apart.

    Returns what was found for the meshes of each collider, in their order.
    """
    kinds: dict[Hashable, list[tuple[PlacedMesh, Found]]] = {}
    for index, (kind, placed, use) in enumerate(uses):
        kinds.setdefault((kind,) if kind is not None and len(placed.file.faces) else index, []).append((placed, use))
    made = {}
    for group in kinds.values():
        meshes = tuple(placed for placed, _ in group)
        name = meshes[0].file.path.stem if len(meshes) == 1 else body
        made[Collider(name, meshes)] = [use for _, use in group]
    return made


def turned(pose: FloatArray, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh where a pose puts it; those of a USD stage may mirror."""
    return trimesh.Trimesh(*_placed(pose, np.asarray(mesh.vertices), np.asarray(mesh.faces)), process=False)


def _placed(pose: FloatArray, points: FloatArray, faces: Int64Array) -> tuple[FloatArray, Int64Array]:
    return moved(pose, points), faces if np.linalg.det(pose[:3, :3]) > 0 else faces[:, ::-1]


def _joined(meshes: Sequence[PlacedMesh], poses: Sequence[FloatArray]) -> trimesh.Trimesh:
    parts = [_placed(pose, mesh.points, mesh.faces) for mesh, pose in zip(meshes, poses, strict=True)]
    parts = parts or [(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))]
    begins = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [faces + begin for (_, faces), begin in zip(parts, begins, strict=False)]
    return trimesh.Trimesh(np.concatenate([points for points, _ in parts]), np.concatenate(faces), process=False)
