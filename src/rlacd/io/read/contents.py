"""What a file shows, in the terms of all readers: nodes with the triangles that each places; and its limits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from rlacd.errors import MeshDataError
from rlacd.options.output import Axis
from rlacd.solid.arrays import FloatArray
from rlacd.solid.input_mesh import Asset, SourceNode
from rlacd.solid.topology import IntArray

MOST_TRIANGLES = 20_000_000
"""Of a mesh, counting every instance of a geometry. They take about 4 GB."""

MOST_PLACES = 100_000
"""Nodes of a scene, and instances of its geometries; parsers take about a kilobyte for each."""

LONGEST_NAME = 1000
"""Instances of one part. Each gets a unique name by a counting suffix."""

DEEPEST_PART = 20
"""Depth of nested instances: the cost of an instance grows with the cube of its depth."""


def most_in_memory(given: int) -> int:
    """Bytes of arrays that a file of this size may need: an index byte becomes eight, some are used repeatedly."""
    return 2**29 + 16 * given


class Triangles(NamedTuple):
    """Triangles as a node places them; points if there are no faces."""

    vertices: FloatArray
    faces: IntArray


class Contents(NamedTuple):
    """All that is read of a file.

    Attributes
    ----------
    geometry
        Nodes with what they place.
    warnings
        A sentence for each kind of content that is not read.
    up, metres
        The axis that points up, and the unit of length in metres if the file or its format states it.
    asset
        The file, if it says more than where its triangles are: colours, materials, texture coordinates, nodes.
    """

    geometry: Sequence[tuple[SourceNode, Triangles]]
    warnings: Sequence[str] = ()
    up: Axis = "z"
    metres: float | None = None
    asset: Asset | None = None


def one_shape(name: str, vertices: FloatArray, faces: IntArray | None = None) -> list[tuple[SourceNode, Triangles]]:
    """The geometry of a file without a scene."""
    faces = np.empty((0, 3), dtype=np.int64) if faces is None else faces
    return [(SourceNode(name, name, np.eye(4)), Triangles(vertices, faces))]


def require_few(shapes: Iterable[tuple[Any, Any]], name: str) -> None:
    """Refuse too many faces and points; points count at three for a triangle: it may be that no face uses them."""
    count = sum(max(len(faces), len(points) // 3) for faces, points in shapes)
    if count > MOST_TRIANGLES:
        raise MeshDataError(f"{name} places {count} triangles, more than {MOST_TRIANGLES}: simplify it first")
