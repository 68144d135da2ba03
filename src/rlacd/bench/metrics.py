"""How good hulls are, whoever made them: one implementation, on the input mesh.

Lengths are in the frame where the input's bounding box is centred and its longest side is 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.errors import OptionError
from rlacd.repair.union import to_manifold
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.solid.solid import Solid

TOLERANCE = 1e-3
"""Width of the certified intervals whose upper ends are the distances and the concavity."""

CRACK = 1e-3
"""Cracks between hulls narrower than this are closed. Some tools leave gaps of 1e-5 where they cut, whose walls are
inside the object by any reading but the literal one, and 0.3 from its surface."""

COVERED = 1e-3
"""A point of the input this near to a hull counts as covered."""

SAMPLES = 50_000
"""Points that the uncovered share is told from; its standard error is below 0.0023."""

NOTHING = 1e-9
"""A hull that holds less of the solid than this volume is empty; the frame's box has 8."""

CONVEX = 1e-6
"""A corner this far above a facet, relative to the hull's extent, is rounding."""


@dataclass(frozen=True)
class Metrics:
    """What is measured of the hulls of one mesh.

    Attributes
    ----------
    parts, faces, vertices : int
        Hulls, and their triangles and corners as the tool returned them.
    over : float
        Farthest that the surface of the hulls' union reaches from the input's surface. Where two hulls touch or
        overlap is inside the union and does not count.
    under : float
        Farthest that the input's surface lies from the union as a solid.
    hausdorff : float
        The larger of both, D_h.
    concavity : float
        Largest CoACD concavity of a part, decided by bounds and not by samples; a part is what of the repaired input
        lies in a hull.
    exceeding : int or None
        Parts that exceed the concavity the tool was asked to keep by more than 0.001; None if it was not asked.
    volume : float
        Sum of the hulls' volumes over the repaired input's: 1 is perfect, overlaps count twice.
    uncovered : float
        Share of the input's surface outside the union.
    invalid : int
        Hulls that are not closed, outward oriented, convex and of positive volume.
    empty : int
        Hulls that hold nothing of the input.
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
    """Measure hulls against the mesh they stand for.

    Parameters
    ----------
    solid : Solid
        The mesh, repaired; distances are to its original surface.
    hulls : sequence of (vertices [V, 3], faces [F, 3])
        In the mesh's own frame and unit, of any quality.
    promised : float, optional
        The concavity that each part should keep.
    threads : int

    Raises
    ------
    OptionError
        There are no hulls with a volume, or the mesh has no surface.
    """
    vertices, faces = solid.surface
    # The hull is taken anew: what a tool's wrong triangles leave out would be measured as missing.
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
    return Metrics(
        parts=len(hulls),
        faces=sum(len(f) for _, f in hulls),
        vertices=sum(len(v) for v, _ in hulls),
        over=over,
        under=under,
        hausdorff=max(over, under),
        concavity=concavity,
        exceeding=exceeding,
        volume=sum(hull.volume for hull in usable) / solid.manifold.volume(),
        uncovered=float((union.distance(points, threads) > COVERED).mean()),
        invalid=sum(not is_valid(v, f) for v, f in hulls),
        empty=empty,
    )


def _concavity(solid: Solid, hulls: Sequence[Hull], promised: float | None) -> tuple[float, int | None, int]:
    """The largest concavity of a part, the parts that exceed what was promised, and the hulls that hold nothing."""
    worst, exceeding, empty = 0.0, 0, 0
    for hull in hulls:
        share = solid.manifold ^ to_manifold(hull.vertices, hull.faces.astype(np.int64))
        if share.is_empty() or share.volume() < NOTHING:
            empty += 1
            continue
        mesh = share.to_mesh64()
        vertices = np.ascontiguousarray(mesh.vert_properties[:, :3], dtype=np.float64)
        part = Part(vertices, np.ascontiguousarray(mesh.tri_verts, dtype=np.int32), share.volume(), hull)
        # What is no worse than the worst so far need not be known.
        worst = max(worst, Concavity().measure(part, TOLERANCE, worst).value[1])
        if promised is not None:
            exceeding += not Concavity(promised + TOLERANCE).is_met(part)
    return worst, None if promised is None else exceeding, empty


def is_valid(vertices: FloatArray, faces: IntArray) -> bool:
    """Tell whether a mesh is closed, outward oriented, convex and of positive volume; judged without our kernels."""
    if len(faces) < 4 or not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        return False
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)  # some tools give every triangle its own corners
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
    sound = lengths > 1e-9  # floating point cannot tell the plane of a needle
    normals = normals[sound] / lengths[sound, None]
    points_there = (vertices - vertices.mean(axis=0)) / extent
    offsets = np.einsum("ij,ij->i", normals, corners[sound, 0])
    strips = (slice(i, i + 1024) for i in range(0, len(normals), 1024))
    return all((points_there @ normals[s].T - offsets[s]).max() <= CONVEX for s in strips)
