"""Quality of hulls from any tool: one implementation, measured on the input mesh.

Lengths are in the frame where the input's bounding box is centred and its longest side is 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from manifold3d import Manifold, OpType

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.errors import OptionError
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Solid

TOLERANCE = 1e-3
"""Width of the certified intervals; distances and concavity are reported as their upper ends."""

CRACK = 1e-3
"""Cracks between hulls narrower than this are closed. Some tools leave gaps of 1e-5 at their cuts, whose walls count as
surface if taken literally, although they lie up to 0.3 inside the object."""

COVERED = 1e-3
"""A point of the input counts as covered if it lies within this distance of a hull."""

SAMPLES = 50_000
"""Sample points for the uncovered share; its standard error is below 0.0023."""

NOTHING = 1e-9
"""A hull that contains less than this volume of the solid is empty; the frame's box has volume 8."""

CONVEX = 1e-6
"""A vertex less than this above a facet, relative to the hull's extent, is attributed to rounding."""


@dataclass(frozen=True)
class Metrics:
    """Metrics of the hulls of one mesh.

    Attributes
    ----------
    parts, faces, vertices : int
        Number of hulls, and of their triangles and vertices as the tool returned them.
    over : float
        Largest distance from the surface of the hulls' union to the input's surface. Faces where two hulls touch or
        overlap are inside the union and do not count.
    under : float
        Largest distance from the input's surface to the union as a solid.
    hausdorff : float
        The larger of both, D_h.
    concavity : float
        Largest CoACD concavity of a part, decided by bounds and not by samples; a part is the intersection of the
        repaired input with a hull, or with the hull grown by `TOLERANCE`, whichever is less concave.
    exceeding : int or None
        Parts that exceed the requested concavity by more than 0.001; None if none was requested.
    volume : float
        Sum of the hulls' volumes over the repaired input's: 1 is perfect, overlaps count twice.
    overlap : float
        Volume that lies in several hulls, counted once for each but one, over that of their union; 0 if they are
        disjoint.
    added : float
        Volume of the union that lies outside the repaired input, over the input's.
    uncovered : float
        Fraction of the input's surface outside the union.
    invalid : int
        Hulls that fail to be closed, outward oriented, convex and of positive volume.
    empty : int
        Hulls that contain nothing of the input.
    """

    parts: int
    faces: int
    vertices: int
    over: float
    under: float
    hausdorff: float
    concavity: float
    exceeding: int | None
    volume: float
    overlap: float
    added: float
    uncovered: float
    invalid: int
    empty: int

    def as_plain(self) -> dict[str, Any]:
        """Everything as plain values."""
        return asdict(self)


def measure(
    solid: Solid,
    hulls: Sequence[tuple[FloatArray, IntArray]],
    promised: float | None = None,
    threads: int = 1,
) -> Metrics:
    """Measure hulls against their mesh.

    Parameters
    ----------
    solid : Solid
        The mesh, repaired; distances are to its original surface.
    hulls : sequence of (vertices [V, 3], faces [F, 3])
        In the mesh's frame and unit; they may be invalid.
    promised : float, optional
        The concavity that each part should keep.
    threads : int

    Raises
    ------
    OptionError
        There are no hulls with a volume, or the mesh has no surface.
    """
    vertices, faces = solid.surface
    # Hulls are recomputed from the points, or regions lost to a tool's wrong triangles would count as uncovered.
    there = [Hull.of(solid.frame.to_frame(points)) for points, _ in hulls]
    usable = [hull for hull in there if hull is not None]
    if not usable or not len(faces):
        raise OptionError("there is nothing to measure: no hull has a volume, or the mesh has no faces.")
    union = hull_union(usable, threads)
    surface = _native.Surface(vertices, faces)
    over = union.over(surface, TOLERANCE, CRACK, threads)[1]
    under = union.under(vertices, faces, TOLERANCE, threads)[1]
    points, _ = _native.sample_surface(vertices, faces, SAMPLES, 0)
    concavity, exceeding, empty = _concavity(solid, usable, promised)
    bodies = [to_manifold(hull.vertices, hull.faces.astype(np.int64)) for hull in usable]
    filled = Manifold.batch_boolean(bodies, OpType.Add)
    total, inside = sum(body.volume() for body in bodies), solid.manifold.volume()
    return Metrics(
        parts=len(hulls),
        faces=sum(len(f) for _, f in hulls),
        vertices=sum(len(v) for v, _ in hulls),
        over=over,
        under=under,
        hausdorff=max(over, under),
        concavity=concavity,
        exceeding=exceeding,
        volume=total / inside,
        overlap=max(0.0, total / filled.volume() - 1),
        added=(filled - solid.manifold).volume() / inside,
        uncovered=float((union.distance(points, threads) > COVERED).mean()),
        invalid=sum(not is_valid(v, f) for v, f in hulls),
        empty=empty,
    )


def _concavity(solid: Solid, hulls: Sequence[Hull], promised: float | None) -> tuple[float, int | None, int]:
    """The largest concavity of a hull, the number of hulls above the promised one, and the number of empty hulls."""
    worst, exceeding, empty, whole = 0.0, 0, 0, Component(solid.shape)
    for hull in hulls:
        part = Part(hull, (), whole)
        if part.filled < NOTHING:
            empty += 1
            continue
        # Only the maximum is needed: parts below the current worst need no exact value.
        worst = max(worst, Concavity().measure(part, TOLERANCE, worst).value[1])
        exceeding += promised is not None and not Concavity(promised + TOLERANCE).is_met(part)
    return worst, None if promised is None else exceeding, empty


def is_valid(vertices: FloatArray, faces: IntArray) -> bool:
    """Tell whether a mesh is closed, outward oriented, convex and of positive volume, without using our kernels."""
    if len(faces) < 4 or not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        return False
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)  # some tools repeat shared vertices
    faces = same.reshape(-1)[faces].astype(np.int32)
    halfedges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if len(np.unique(halfedges, axis=0)) != len(halfedges):
        return False
    if not np.array_equal(np.unique(halfedges, axis=0), np.unique(halfedges[:, ::-1], axis=0)):
        return False
    extent = np.ptp(vertices, axis=0).max()
    if not extent > 0:
        return False
    corners = (vertices[faces] - vertices.mean(axis=0)) / extent
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if not np.einsum("ij,ij->", corners[:, 0], normals) > 0:
        return False
    lengths = np.linalg.norm(normals, axis=1)
    sound = lengths > 1e-9  # the plane of a needle is not defined in floating point
    normals = normals[sound] / lengths[sound, None]
    points_there = (vertices - vertices.mean(axis=0)) / extent
    offsets = np.einsum("ij,ij->i", normals, corners[sound, 0])
    strips = (slice(i, i + 1024) for i in range(0, len(normals), 1024))
    return all((points_there @ normals[s].T - offsets[s]).max() <= CONVEX for s in strips)
