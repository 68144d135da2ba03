"""Pass random shapes straight to the kernels; compare with brute force, and with other numbers of threads.

    python -m fuzz.kernels --seconds 600
    python -m fuzz.kernels --again 4711

The shapes are not repaired first: flat, repeated, crossing, needles and all. This takes milliseconds where a
decomposition takes seconds, so it suits sanitized builds best.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fuzz.geometry import Floats, Polytope, distance_to_triangles, distance_to_union, sampled, why_not_convex
from fuzz.judges import finite_faces
from fuzz.recipes import make_shape
from rlacd import _native
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull

Soup = tuple[Floats, Any]

ROUNDING = 1e-7
"""Error allowed for kernels on coordinates up to 1; they promise 1e-8."""

TOLERANCE = 2e-3


def soup(seed: int) -> Soup:
    """The faces of a seed's shape in the frame, as int32."""
    shape = make_shape(seed)
    faces = finite_faces(shape)
    used, corner = np.unique(faces, return_inverse=True)
    vertices = Frame.of(shape.vertices[used]).to_frame(shape.vertices[used])
    return vertices, np.ascontiguousarray(corner.reshape(-1, 3), dtype=np.int32)


def same(call: Callable[[int], Any]) -> Any:
    """Return the result of a call on one thread, after checking that four threads give the same bits."""
    one, four = call(1), call(4)
    for a, b in zip(*((x if isinstance(x, tuple) else (x,)) for x in (one, four)), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes(), "other bits on other threads"
    return one


def hull_of(mesh: Soup, random: np.random.Generator) -> Hull | None:
    """Check that the convex hull contains every point, and its simplification the hull."""
    points = mesh[0]
    indices, faces, rank = _native.convex_hull(points)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) if len(points) > 1 else np.zeros(3)
    assert rank == 3 or len(spread) < 3 or spread[rank] < 1e-6 * spread[0] + 1e-300, f"rank {rank}, spread {spread}"
    if rank < 3:
        return None
    vertices = points[indices]
    assert not (why := why_not_convex(vertices, faces.astype(np.int64))), why
    outer = Polytope(vertices, faces.astype(np.int64))
    assert outer.height(points).max() <= ROUNDING, "a point is not in the hull"
    hull = Hull(vertices, faces, _native.mesh_volume(vertices, faces))
    limit = int(random.integers(4, 40))
    try:
        fewer, few_faces = _native.simplify_hull(hull.body, limit, 2**31 - 1, 1e-6, np.empty((0, 4)))
    except ValueError as error:
        if "flat" not in str(error):
            raise
        return hull
    assert len(fewer) <= max(4, limit), f"{len(fewer)} corners, not {limit}"
    assert not (why := why_not_convex(fewer, few_faces.astype(np.int64))), f"simplified: {why}"
    assert Polytope(fewer, few_faces.astype(np.int64)).height(vertices).max() <= ROUNDING, "the limited hull is smaller"
    return hull


def surface_queries(mesh: Soup, random: np.random.Generator) -> _native.Surface:
    """Check closest points and winding numbers."""
    surface = _native.Surface(*mesh)
    corners = mesh[0][mesh[1]]
    points = np.concatenate([random.uniform(-2, 2, (20, 3)), sampled(*mesh, 10, random)])
    distance = same(lambda threads: surface.distance(points, threads))
    expected = distance_to_triangles(points, corners)
    assert np.abs(distance - expected).max() <= ROUNDING, f"distances are off by {np.abs(distance - expected).max()}"
    closest, on = same(lambda threads: surface.closest(points, threads))
    assert np.abs(np.linalg.norm(points - closest, axis=1) - expected).max() <= ROUNDING, "a closest point is not"
    each = [distance_to_triangles(p[None], corners[[f]])[0] for p, f in zip(closest, on, strict=True)]
    assert max(each) <= ROUNDING, "a closest point is not on its face"
    assert np.isfinite(same(lambda threads: surface.winding(points, 2.0, threads))).all()
    return surface


def union_queries(hulls: list[Hull], mesh: Soup, surface: _native.Surface, random: np.random.Generator) -> None:
    """Check the union of hulls against a surface."""
    union = hull_union(hulls, 1)
    solids = [Polytope(hull.vertices, hull.faces.astype(np.int64)) for hull in hulls]
    points = np.concatenate([random.uniform(-2, 2, (20, 3)), sampled(*mesh, 20, random)])
    expected = distance_to_union(points, solids)
    distance = same(lambda threads: union.distance(points, threads))
    assert np.abs(distance - expected).max() <= ROUNDING, f"the union is off by {np.abs(distance - expected).max()}"
    lower, upper, _ = same(lambda threads: union.under(*mesh, TOLERANCE, threads))
    assert expected[20:].max() <= upper + ROUNDING, f"under: {expected[20:].max()} > {upper}"
    assert lower <= upper, f"under: {lower}, {upper}"
    lower, upper, _ = same(lambda threads: union.over(surface, TOLERANCE, 1e-6, threads))
    for own in solids:
        on = sampled(own.vertices, own.faces, 20, random)
        for others in solids:
            if others is not own and len(on):
                on = on[others.height(on) > 1e-5]
        if len(on):
            reached = float(distance_to_triangles(on, mesh[0][mesh[1]]).max())
            assert reached <= upper + 2e-5, f"over: {reached} > {upper}"
    pairs = np.array([[i, j] for i in range(len(hulls)) for j in range(i)], dtype=np.int32).reshape(-1, 2)
    same(lambda threads: _native.joint_hull_volumes([hull.body for hull in hulls], pairs, threads))


def part_queries(mesh: Soup, hull: Hull, random: np.random.Generator) -> None:
    """Run the queries on components: planes, sweeps, distances from their hulls. Kernels must accept any soup."""
    directions = random.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    directions[:3] = np.eye(3)
    offsets = np.ascontiguousarray(np.sort(random.choice([-0.5, 0.0, 0.25, 1.0], (6, 4))))
    same(lambda threads: _native.sweep(*mesh, np.ascontiguousarray(directions), offsets, threads))
    exponent = float(random.choice([1.0, 1.3, np.inf]))
    same(
        lambda threads: _native.find_least_excess(
            *mesh, np.ascontiguousarray(directions), offsets, exponent, 1e-9, 1e-11, (0.02, 2e-4), threads
        )
    )
    _native.candidate_planes(*mesh, hull.body, 12, 4)
    threshold = float(random.choice([0.01, 0.05, 0.3]))
    against = _native.Against(*mesh)
    met = not (against.comes_deeper(hull.body, threshold) or against.leads_farther(hull.body, threshold))
    lower, upper = np.max(against.measure(hull.body, TOLERANCE), axis=0)
    assert lower <= upper, f"distance: {lower}, {upper}"
    assert not (met and lower > threshold * (1 + 1e-9)), f"distance {lower} said to be within {threshold}"
    assert 0 <= against.filled(hull.body) <= hull.volume * (1 + ROUNDING), "no more is filled than there is"
    points = sampled(hull.vertices, hull.faces.astype(np.int64), 30, random)
    away = distance_to_triangles(points, mesh[0][mesh[1]])[against.surface.winding(points, 4.0, 1) < 0.5]
    assert away.max(initial=0.0) <= upper + ROUNDING, f"distance: {away.max()} > {upper}"


def ball_queries(hull: Hull, surface: _native.Surface, random: np.random.Generator) -> None:
    """Check balls around the shape: none comes closer to it than the tolerance."""
    radius, tolerance = float(random.choice([0.2, 0.5, 1.0])), float(random.choice([0.02, 0.1]))
    reachable, ground = bool(random.random() < 0.5), np.array([[0, 0, 1, -0.5]])[: int(random.integers(2))]
    centres, radii = same(
        lambda threads: _native.navigable_balls(
            surface, hull.body, radius, tolerance, reachable, None, ground, radius / 2, threads
        )
    )
    if len(centres) == 0:
        return
    assert (surface.distance(centres) >= radii + 0.9 * tolerance).all(), "a ball is too near"
    balls = _native.BallSet(centres, radii)
    touched, depth = balls.intrusions(hull.body, None, 1e-9)
    solid = Polytope(hull.vertices, hull.faces.astype(np.int64))
    clear = solid.height(centres) > 0
    expected = radii - np.where(clear, solid.distance(centres), 0)
    sure = np.flatnonzero(expected > 1e-6)
    assert np.isin(sure, touched).all(), "an intrusion was missed"
    own = clear[touched]
    assert np.abs(depth[own] - expected[touched][own]).max(initial=0) <= ROUNDING, "the depth of an intrusion is off"


def try_seed(seed: int) -> None:
    """Run all queries on one seed's shape; raises AssertionError."""
    random = np.random.default_rng([seed, 4])
    mesh, other = soup(seed), soup(seed + 10**6)
    if len(mesh[1]) == 0 or len(other[1]) == 0:
        return
    hulls = [hull for hull in (hull_of(part, random) for part in (mesh, other)) if hull is not None]
    surface = surface_queries(mesh, random)
    if not hulls:
        return
    union_queries(hulls, mesh, surface, random)
    if len(hulls) == 2:  # the first is the hull of the mesh
        part_queries(mesh, hulls[0], random)
        ball_queries(hulls[0], surface, random)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--count", type=int, default=10**9, help="how many")
    parser.add_argument("--seconds", type=float, default=600.0, help="stop after this many")
    parser.add_argument("--again", type=int, help="repeat one seed, with the place that fails")
    args = parser.parse_args()
    if args.again is not None:
        try_seed(args.again)
        return
    until = time.monotonic() + args.seconds
    tried, wrong = 0, []
    for seed in range(args.first, args.first + args.count):
        if time.monotonic() > until:
            break
        if seed % 50 == 0:
            print(f"seed {seed}", flush=True)
        try:
            try_seed(seed)
        except Exception as error:
            wrong.append(seed)
            print(f"wrong {seed}: {type(error).__name__}: {error}"[:300], flush=True)
        tried += 1
    print(f"{tried} shapes, {len(wrong)} wrong: {wrong}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
