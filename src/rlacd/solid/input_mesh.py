"""A mesh as read: the output of loading, the input of repair."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.fit import Unit
from rlacd.options.output import Axis
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.topology import compacted


def no_points() -> FloatArray:
    """An array of no points."""
    return np.empty((0, 3))


@dataclass(frozen=True)
class SourceNode:
    """A node of the input's scene that places triangles.

    Attributes
    ----------
    name
        As in the file, otherwise that of its mesh, otherwise made up.
    key
        What identifies it in the asset: the index of a glTF node, or a node's name in a scene of trimesh.
    transform
        ``[4, 4]`` from the node's coordinates to those of the mesh.
    """

    name: str
    key: int | str
    transform: FloatArray


@dataclass(frozen=True)
class Asset:
    """The input with everything that is not triangles, for files that keep it.

    Attributes
    ----------
    content
        The bytes of a file, or a scene or mesh of trimesh.
    path
        Of the file, whose folder holds the files that it refers to; None if `content` is all of it.
    extension
        Of its format, without the dot; empty for a scene or mesh from memory.
    """

    content: Any
    path: Path | None = None
    extension: str = ""

    @property
    def is_gltf(self) -> bool:
        """Whether it is a glTF file, which is edited; anything else is converted."""
        return self.extension in ("glb", "gltf")


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
    up
        The axis that points up by the input's own convention.
    metres
        The unit of length in metres, if the input says it.
    nodes
        The nodes that place triangles; empty if the input has no scene.
    node_of
        ``[F]``, the index in `nodes` of each face; None without nodes.
    asset
        The input itself, if it is a scene that can be kept.
    factor
        What the input's coordinates were multiplied by.
    left_out
        Nodes of the asset whose triangles were left out: hulls for an engine, which new ones replace.
    specks
        ``[N, 3]``, where faces were that are a single point: they were left out.
    deviation
        How far the triangles may be from the curved surfaces that the input describes; None if it holds triangles.
    told_in
        The unit in which lengths are told; None for the input's own.
    """

    vertices: FloatArray
    faces: Int64Array
    name: str
    warnings: tuple[str, ...]
    up: Axis = "z"
    metres: float | None = None
    nodes: tuple[SourceNode, ...] = ()
    node_of: Int64Array | None = None
    asset: Asset | None = None
    factor: float = 1.0
    left_out: tuple[SourceNode, ...] = ()
    specks: FloatArray = field(default_factory=no_points)
    deviation: float | None = None
    told_in: Unit | None = None

    @property
    def unit(self) -> Unit:
        """The unit in which lengths are told."""
        return Unit.of(self.metres) if self.told_in is None else self.told_in

    def scaled(self, factor: float) -> InputMesh:
        """Multiply all coordinates."""
        deviation = None if self.deviation is None else self.deviation * factor
        vertices, specks = self.vertices * factor, self.specks * factor
        return replace(self, vertices=vertices, specks=specks, deviation=deviation, factor=self.factor * factor)

    def of_node(self, index: int) -> InputMesh:
        """Get only the triangles that one node places, and the vertices that they use."""
        assert self.node_of is not None
        vertices, faces = compacted(self.vertices, self.faces[self.node_of == index])
        return replace(self, vertices=vertices, faces=faces, warnings=(), nodes=(), node_of=None, specks=no_points())
