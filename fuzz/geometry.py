"""Distances and hulls for the judges, computed without the kernels under test."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]

PAIRS = 400_000
"""Pairs of points and triangles per block."""


def distance_to_triangles(points: Floats, corners: Floats) -> Floats:
    """Distances [N] of points [N, 3] to the nearest of triangles [F, 3, 3], by brute force."""
    best = np.full(len(points), np.inf)
    step = max(1, PAIRS // max(1, len(points)))
    for start in range(0, len(corners), step):
        best = np.minimum(best, _distances(points, corners[start : start + step]).min(axis=1))
    return best


def _distances(points: Floats, corners: Floats) -> Floats:
    a, b, c = (corners[None, :, k] for k in range(3))
    p = points[:, None]
    best = np.minimum(_to_segments(p, a, b), np.minimum(_to_segments(p, b, c), _to_segments(p, c, a)))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    longest = np.maximum(np.square(b - a).sum(-1), np.square(c - a).sum(-1))
    usable = length[..., 0] > 1e-10 * longest  # thinner triangles are covered by their edges
    unit = normal / np.where(length > 0, length, 1)
    height = np.einsum("nfk,nfk->nf", p - a, np.broadcast_to(unit, (len(points), *unit.shape[1:])))
    inside = np.broadcast_to(usable, height.shape).copy()
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("nfk,nfk->nf", np.cross(unit, end - start) + 0 * p, p - start) >= 0
    return np.where(inside, np.minimum(best, np.abs(height)), best)


def _to_segments(p: Floats, start: Floats, end: Floats) -> Floats:
    along = end - start
    length2 = np.square(along).sum(-1)
    t = np.clip(np.einsum("nfk,nfk->nf", p - start, along + 0 * p) / np.where(length2 > 0, length2, 1), 0, 1)
    return np.asarray(np.linalg.norm(p - start - t[..., None] * along, axis=-1))


def sampled(vertices: Floats, faces: Ints, count: int, random: np.random.Generator) -> Floats:
    """Sample points on triangles by area, and add all vertices of up to `count` triangles."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = random.permutation(len(faces))[:count]
    points = [corners[chosen].reshape(-1, 3)]
    if area.sum() > 0:
        on = corners[random.choice(len(faces), count, p=area / area.sum())]
        weights = random.dirichlet([1, 1, 1], count)
        points.append(np.einsum("nk,nkd->nd", weights, on))
    return np.concatenate(points)


class Polytope:
    """A convex hull from Qhull, or from its own triangles if Qhull fails."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        self.vertices, self.faces = vertices, faces
        self.corners = vertices[faces]
        normal = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        usable = length > 1e-13 * max(1e-300, length.max(initial=0))
        self.normals = normal[usable] / length[usable, None]
        self.offsets = (vertices @ self.normals.T).max(axis=0)
        self.area = float(length.sum() / 2)

    def height(self, points: Floats) -> Floats:
        """Height [N] of points above the highest facet plane; negative inside."""
        return np.asarray((points @ self.normals.T - self.offsets).max(axis=1))

    def distance(self, points: Floats) -> Floats:
        """Distances [N] of points to the solid."""
        height = self.height(points)
        outside = np.flatnonzero(height > 0)
        found = np.zeros(len(points))
        if len(outside):
            found[outside] = distance_to_triangles(points[outside], self.corners)
        return found


def distance_to_union(points: Floats, hulls: list[Polytope]) -> Floats:
    """Distances [N] of points to the nearest hull."""
    best = np.full(len(points), np.inf)
    for hull in hulls:
        lower = hull.height(points)  # a lower bound of the distance
        near = np.flatnonzero(lower < best)
        if len(near):
            best[near] = np.minimum(best[near], hull.distance(points[near]))
    return best


def winding_number(points: Floats, corners: Floats) -> Floats:
    """How often triangles [F, 3, 3] wind around points [N, 3]: the sum of their solid angles (Van Oosterom)."""
    total = np.zeros(len(points))
    for triangle in corners:
        a, b, c = (corner - points for corner in triangle)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        across = np.einsum("ij,ij->i", a, np.cross(b, c))
        along = la * lb * lc + (a * b).sum(axis=1) * lc + (a * c).sum(axis=1) * lb + (b * c).sum(axis=1) * la
        total += np.arctan2(across, along)
    return total / (2 * np.pi)


def why_not_convex(vertices: Floats, faces: Ints, exactly: bool = False) -> str | None:
    """Explain what is wrong with a hull; None if it is closed, outward oriented and convex.

    Small hulls are judged in rational arithmetic; the volume of large ones is compared with that of Qhull's hull,
    unless they have to be judged exactly, too.
    """
    edges = [(int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3)]
    directed = set(edges)
    if len(directed) != len(edges):
        return "an edge is used twice in one direction"
    if not all((b, a) in directed for a, b in edges):
        return "an edge has no twin"
    if len(vertices) - len(edges) // 2 + len(faces) != 2:
        return "it is no sphere"
    if not np.isfinite(vertices).all():
        return "a vertex is not finite"
    if exactly or len(vertices) * len(faces) <= 2500:
        return _why_not_convex_exactly(vertices, faces)
    size = np.ptp(vertices, axis=0)
    if not (size > 0).all():
        return "it is flat"
    points = (vertices - vertices.min(axis=0)) / size  # does not affect convexity, and suits Qhull
    own = float(
        np.einsum("ij,ij->i", np.cross(*(points[faces[:, k]] for k in range(2))), points[faces[:, 2]]).sum() / 6
    )
    try:
        reference = float(ConvexHull(points).volume)
    except Exception as error:  # Qhull fails on nearly flat input
        return None if "QH" in str(error) else str(error)
    return (
        None if abs(own - reference) <= 1e-7 * reference + 1e-12 else f"its volume is {own / reference} of its hull's"
    )


def _why_not_convex_exactly(vertices: Floats, faces: Ints) -> str | None:
    points = _as_integers(vertices)
    a, b, c = (points[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    normals = np.stack([u[:, i - 2] * v[:, i - 1] - u[:, i - 1] * v[:, i - 2] for i in range(3)], axis=1)
    heights = normals @ points.T - (normals * a).sum(axis=1)[:, None]
    if (normals == 0).all(axis=1).any():
        return "a face has no area"
    if (heights > 0).any():
        return "a vertex lies above a face"
    return "it is flat" if (heights == 0).all(axis=1).any() else None


def _as_integers(points: Floats) -> npt.NDArray[np.object_]:
    """Points as Python integers, multiplied by the least power of two that makes them so."""
    ratios = [x.as_integer_ratio() for x in points.ravel().tolist()]
    scale = max((below for _, below in ratios), default=1)
    return np.array([above * (scale // below) for above, below in ratios], dtype=object).reshape(points.shape)
