"""What hulls add to a surface and miss of it, seen by dense samples and none of the kernels.

    python -m fuzz.eye MESH... --samples 100000 --quality fast

decomposes meshes and prints what the report says beside what the samples show. Every number here is the distance of one
point, measured exactly: a lower bound of what the report bounds from above. Lengths are in the frame where the
longest side of the input is 2.

Which points are *outer*? Hulls on both sides of a cut touch, and their facets in the cut are inside the union.
Coordinates are rounded, so these two facets lie a hair apart: a boolean union, or a test at tolerance 0, takes them for
surface, although nothing can reach them. A point of a hull is outer when it is not in any other hull grown by `SEAM`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import rlacd
from fuzz.geometry import Floats, Ints, Polytope, distance_to_triangles, distance_to_union, sampled

SEAM = 1e-5
"""Hulls closer than this touch: cuts leave gaps of 1e-6, single-precision files 1e-7."""

PROMISING = 64
"""Number of points whose distance is computed exactly; a point cloud selects them."""

NO_AREA = 2e-11
"""Twice the area below which a face counts as having none: a needle so thin that rounding decides about it."""

FEW_PAIRS = 20_000
"""Up to this many pairs of points and triangles, all distances are computed exactly."""

LEAST_A_HULL = 60
"""Minimum number of samples per hull, so that small hulls are examined too."""


@dataclass(frozen=True)
class Farthest:
    """The point of a set that is farthest from something, and its distance.

    Attributes
    ----------
    distance
        0 if there is no point.
    point
        [3], NaN if there is none.
    """

    distance: float
    point: Floats


NOWHERE = Farthest(0.0, np.full(3, np.nan))


def farthest_from_triangles(points: Floats, corners: Floats, random: np.random.Generator) -> Farthest:
    """Find the point of [N, 3] that is farthest from triangles [F, 3, 3].

    Its distance is exact, but among many points it is chosen by approximate distances to a cloud on the triangles.
    """
    if len(points) == 0 or len(corners) == 0:
        return NOWHERE
    if len(points) * len(corners) <= FEW_PAIRS:
        distances = distance_to_triangles(points, corners)
        at = int(np.argmax(distances))
        return Farthest(float(distances[at]), points[at])
    flat = corners.reshape(-1, 3)
    cloud = sampled(flat, np.arange(len(flat)).reshape(-1, 3), max(20_000, len(corners)), random)
    near = np.asarray(cKDTree(cloud).query(points)[0])  # an upper bound of the distance
    chosen = np.argsort(-near, kind="stable")[:PROMISING]
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    best = NOWHERE
    for i in chosen:
        if near[i] <= best.distance:
            break
        within = np.linalg.norm(centre - points[i], axis=1) - radius <= near[i]
        distance = float(distance_to_triangles(points[i : i + 1], corners[within])[0])
        if distance > best.distance:
            best = Farthest(distance, points[i])
    return best


def outer_points(hulls: Sequence[Polytope], count: int, random: np.random.Generator) -> Floats:
    """Sample about `count` points of the hulls' facets by area, add their vertices, and keep the outer ones."""
    area = np.array([hull.area for hull in hulls])
    share = np.maximum(LEAST_A_HULL, np.ceil(count * area / max(1e-300, area.sum()))).astype(int)
    boxes = [(hull.vertices.min(axis=0) - SEAM, hull.vertices.max(axis=0) + SEAM) for hull in hulls]
    kept = []
    for i, hull in enumerate(hulls):
        points = np.concatenate([sampled(hull.vertices, hull.faces, int(share[i]), random), hull.vertices])
        for j, other in enumerate(hulls):
            near = ((points >= boxes[j][0]) & (points <= boxes[j][1])).all(axis=1)
            if j != i and near.any():
                near[near] = other.height(points[near]) <= SEAM
                points = points[~near]
        kept.append(points)
    return np.concatenate(kept) if kept else np.zeros((0, 3))


def seen_over(hulls: Sequence[Polytope], corners: Floats, count: int, random: np.random.Generator) -> Farthest:
    """Lower bound of the distance by which the union of the hulls leaves the input's triangles [F, 3, 3]."""
    return farthest_from_triangles(outer_points(hulls, count, random), corners, random)


def seen_under(
    hulls: Sequence[Polytope], vertices: Floats, faces: Ints, count: int, random: np.random.Generator
) -> Farthest:
    """Lower bound of the distance by which the input leaves the hulls."""
    points = np.concatenate([sampled(vertices, faces, count, random), vertices[np.unique(faces)]])
    boxes = [(hull.vertices.min(axis=0), hull.vertices.max(axis=0)) for hull in hulls]
    for hull, (lower, upper) in zip(hulls, boxes, strict=True):
        near = ((points >= lower) & (points <= upper)).all(axis=1)
        if near.any():
            near[near] = hull.height(points[near]) <= 0
            points = points[~near]
    if len(points) == 0:
        return NOWHERE
    distance = distance_to_union(points, list(hulls))
    worst = int(distance.argmax())
    return Farthest(float(distance[worst]), points[worst])


def in_frame(
    vertices: Floats, faces: Ints, hulls: Sequence[tuple[Floats, Ints]]
) -> tuple[Floats, Ints, list[Polytope]]:
    """Transform input and hulls so that the input's box is centred with longest side 2; drops faces without area."""
    used = vertices[np.unique(faces)]
    lower, upper = used.min(axis=0), used.max(axis=0)
    centre, size = lower / 2 + upper / 2, float((upper - lower).max()) / 2
    where = np.zeros_like(vertices)
    where[np.unique(faces)] = (used - centre) / size
    corners = where[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return where, faces[area > NO_AREA], [Polytope((points - centre) / size, own) for points, own in hulls]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--quality", default="fast")
    options = parser.parse_args()
    print("| mesh | over: said | seen | under: said | seen |\n|---|--:|--:|--:|--:|")
    for path in options.meshes:
        result = rlacd.decompose(path, quality=options.quality)
        source = np.asarray(result.source.vertices, dtype=np.float64), np.asarray(result.source.faces, dtype=np.int64)
        hulls = [(np.array(hull.vertices), np.array(hull.faces, dtype=np.int64)) for hull in result]
        where, faces, placed = in_frame(*source, hulls)
        random = np.random.default_rng(0)
        over = seen_over(placed, where[faces], options.samples, random).distance
        under = seen_under(placed, where, faces, options.samples, random).distance
        said = result.report.hausdorff
        print(f"| {path.stem} | {said.over:.4f} | {over:.4f} | {said.under:.4f} | {under:.4f} |", flush=True)


if __name__ == "__main__":
    main()
