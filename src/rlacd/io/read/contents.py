"""What a file shows, in the terms of all readers: nodes with the triangles that each places; and its limits.

Hulls for an engine that a scene holds already, from an earlier run or made by hand, are no shapes to decompose: their
names, those that engines go by and `--keep-input` gives, tell them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rlacd.errors import MeshDataError, MeshFileError
from rlacd.options.output import Axis
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.input_mesh import Asset, InputMesh, SourceNode

MOST_TRIANGLES = 20_000_000
"""Of a mesh, counting every instance of a geometry. They take about 4 GB."""

MOST_PLACES = 100_000
"""Nodes of a scene, and instances of its geometries; parsers take about a kilobyte for each."""

LONGEST_NAME = 1000
"""Characters of a node's name that are kept."""

DEEPEST_PART = 100
"""Depth of nested nodes and instances: several times that of a skeleton down to its fingers."""

HIDDEN = "hidden nodes were left out, with those below them"


class Triangles(NamedTuple):
    """Triangles without looks; points if there are no faces. To make a `trimesh.Trimesh` takes longer than a hull."""

    vertices: FloatArray
    faces: npt.NDArray[Any]


class Fineness(NamedTuple):
    """How near to curved surfaces their triangles have to be; no file takes more than the usual distance."""

    share: float = 1e-3
    """Of the longest side of everything, or with `of_nodes` of the smallest node's."""
    metres: float | None = None
    """Instead of a share, a length."""
    of_nodes: bool = False
    """Whether nodes count by themselves."""


USUAL = Fineness()
"""A fifth of a threshold of 0.01."""


class Contents(NamedTuple):
    """All that is read of a file."""

    geometry: Sequence[tuple[SourceNode, Triangles]]
    """Nodes with what they place."""
    warnings: Sequence[str] = ()
    """A sentence for each kind of content that is not read."""
    up: Axis = "z"
    metres: float | None = None
    """The axis that points up, and the unit of length in metres if the file or its format states it."""
    asset: Asset | None = None
    """The file, if it says more than where its triangles are: colours, materials, texture coordinates, nodes."""
    deviation: float | None = None
    """How far its triangles may be from the surfaces that it describes, if these are curved."""


def one_shape(name: str, vertices: FloatArray, faces: Int64Array | None = None) -> list[tuple[SourceNode, Triangles]]:
    """The geometry of a file without a scene."""
    faces = np.empty((0, 3), dtype=np.int64) if faces is None else faces
    return [(SourceNode(name, name, np.eye(4)), Triangles(vertices, faces))]


def counts_of(left_out: Mapping[str, int]) -> list[str]:
    """A sentence for each kind of content that was left out, with how often it was."""
    return [f"{what}: {count}" for what, count in left_out.items() if count]


def damaged(path: Path, kind: str, why: str = "") -> MeshFileError:
    """The error for a file that its parser refuses, with what the parser says."""
    said = f" ({why.splitlines()[0][:200]})" if why else ""
    return MeshFileError(f"{path} cannot be read as {kind}: it is damaged or cut off{said}; export it again")


def check_places(path: Path, count: int, depth: int) -> None:
    """Refuse a file whose parts are placed too often, or inside each other too deeply, such as in themselves."""
    if depth > DEEPEST_PART:
        raise MeshFileError(f"{path} places parts inside parts more than {DEEPEST_PART} deep: export it again")
    if count > MOST_PLACES:
        raise MeshFileError(f"{path} has more than {MOST_PLACES} places for its parts: simplify it first")


def require_few(shapes: Iterable[tuple[Any, Any]], name: str) -> None:
    """Refuse too many faces and points; points count at three for a triangle: it may be that no face uses them."""
    count = sum(max(len(faces), len(points) // 3) for faces, points in shapes)
    if count > MOST_TRIANGLES:
        raise MeshDataError(f"{name} places {count} triangles, more than {MOST_TRIANGLES}: simplify it first")


_ENGINE = re.compile(r"(?:UCX|UBX|USP|UCP)_.+|.+-(?:convcolonly|colonly)(?:\.\d+)?", re.DOTALL)
"""Unreal's prefixes and Godot's endings; Blender numbers names that are not unique."""

_KEPT = re.compile(r"(.+)_hull_\d{3,}", re.DOTALL)


def without_engine_hulls(mesh: InputMesh) -> InputMesh:
    """Leave out the nodes that are hulls for an engine, with a warning.

    A mesh of hulls and nothing else stays as it is: then they are what was meant.
    """
    names = {node.name for node in mesh.nodes}
    kept = [_KEPT.fullmatch(node.name) for node in mesh.nodes]
    pairs = zip(mesh.nodes, kept, strict=True)
    hulls = np.array([_ENGINE.fullmatch(n.name) or (k and k[1] in names) for n, k in pairs], dtype=bool)
    if mesh.node_of is None or not hulls.any() or hulls.all():
        return mesh
    gone = hulls[mesh.node_of]
    unused = np.zeros(len(mesh.vertices), dtype=bool)
    unused[mesh.faces[gone]] = True
    unused[mesh.faces[~gone]] = False
    left_out = tuple(node for node, hull in zip(mesh.nodes, hulls, strict=True) if hull)
    said = f"hulls of an engine ({left_out[0].name:.60}{', ...' if len(left_out) > 1 else ''}) were left out"
    return replace(
        mesh,
        vertices=np.ascontiguousarray(mesh.vertices[~unused]),
        faces=np.ascontiguousarray((np.cumsum(~unused) - 1)[mesh.faces[~gone]]),
        warnings=(*mesh.warnings, f"{len(left_out)} of {len(mesh.nodes)} nodes, {said}"),
        nodes=tuple(node for node, hull in zip(mesh.nodes, hulls, strict=True) if not hull),
        node_of=(np.cumsum(~hulls) - 1)[mesh.node_of[~gone]],
        left_out=left_out,
    )
