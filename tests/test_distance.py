"""Certified distances: one-sided Hausdorff, and unions of hulls against a surface."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from rlacd import _native
from rlacd.solid.distance import HullDistances, hull_distances, hull_union
from rlacd.solid.hull import Hull
from tests.shapes import Closed, Floats, box, depth_in, from_manifold, point_to_triangles

TOLERANCE = 1e-3
BRICK = ((0, 0, 0), (2, 1, 1))


def hulls_of(*solids: Any) -> list[Hull]:
    found = [Hull.of(from_manifold(solid).vertices) for solid in solids]
    return [hull for hull in found if hull is not None]


def measured(hulls: list[Hull], surface: Any) -> HullDistances:
    mesh = from_manifold(surface)
    found = hull_distances(hulls, mesh.vertices, mesh.faces, TOLERANCE)
    for lower, upper in (found.over, found.under):
        assert 0 <= lower <= upper <= lower + TOLERANCE + 1e-12
    return found


def close(interval: tuple[float, float], value: float) -> bool:
    return interval[0] - 1e-5 <= value <= interval[1] + 1e-5


KNOWN: dict[str, tuple[list[Any], float, float]] = {
    "the same box": ([BRICK], 0, 0),
    "touching": ([((0, 0, 0), (0.7, 1, 1)), ((0.7, 0, 0), (2, 1, 1))], 0, 0),
    "overlapping, coplanar outside": ([((0, 0, 0), (1.2, 1, 1)), ((0.7, 0, 0), (2, 1, 1))], 0, 0),
    "four along a line": ([((x, y, 0), (x + 1, y + 0.5, 1)) for x in (0, 1) for y in (0, 0.5)], 0, 0),
    "doubled": ([BRICK, BRICK], 0, 0),
    "box in a box": ([BRICK, ((0.5, 0.2, 0.2), (0.9, 0.8, 0.8))], 0, 0),
    "box in a box, sharing sides": ([BRICK, ((0, 0, 0), (0.9, 0.8, 0.8))], 0, 0),
    "a missing part": ([((0, 0, 0), (0.7, 1, 1))], 0.5, 1.3),
    "fattened": ([((-0.1, -0.1, -0.1), (2.1, 1.1, 1.1))], 0.1 * 3**0.5, 0),
    "one of two coplanar ones too high": ([((0, 0, 0), (1, 1, 1)), ((0.5, 0, 0), (2, 1, 1.25))], 0.25, 0),
    "a crack wide enough to count": ([((0, 0, 0), (0.9, 1, 1)), ((1.1, 0, 0), (2, 1, 1))], 0.5, 0.1),
    "touching in a part of a side": ([((0, 0, 0), (1, 1, 1)), ((1, 0.25, 0.25), (2, 0.75, 0.75))], 0.25, 0.125**0.5),
}


@pytest.mark.parametrize("levels", [1, 5])
@pytest.mark.parametrize("name", KNOWN)
def test_known_answers(name: str, levels: int) -> None:
    hulls, over, under = KNOWN[name]
    for turn in ((0, 0, 0), (10, 20, 30)):
        solids = [box(*hull).rotate(turn) for hull in hulls]
        found = measured(hulls_of(*solids), box(*BRICK).refine(levels).rotate(turn))
        assert close(found.over, over)
        assert close(found.under, under)


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-7, 5e-7])
@pytest.mark.parametrize("tilt", [0.0, 1e-7])
def test_hairline_cracks_are_closed(gap: float, tilt: float) -> None:
    hulls = hulls_of(box((0, 0, 0), (0.7 - gap, 1, 1)), box((0.7, 0, 0), (2, 1, 1)).rotate((0, np.rad2deg(tilt), 0)))
    assert measured(hulls, box(*BRICK)).over[1] < 2 * TOLERANCE


@pytest.mark.parametrize("angle", [1e-8, 1e-6, 1e-4, 1e-2])
def test_nearly_coplanar_overlapping_facets_do_not_hide_each_other(angle: float) -> None:
    # Two lids that cross at a tiny angle, both above the surface: some part of either must stay.
    low, tilted = box((0, 0, 0), (2, 1, 1.2)), box((0, 0, 0), (2, 1, 1.2)).rotate((0, np.rad2deg(angle), 0))
    assert measured(hulls_of(low, tilted), box(*BRICK)).over[0] >= 0.2 - 1e-5


unit = st.floats(-1, 1, width=32)
clouds = st.lists(st.tuples(unit, unit, unit), min_size=4, max_size=8)


@pytest.mark.slow
@settings(deadline=None, max_examples=80)
@given(st.lists(clouds, min_size=1, max_size=5), st.integers(0, 3))
@pytest.mark.promise("report-true")
def test_unions_against_dense_sampling(points: list[list[tuple[float, float, float]]], levels: int) -> None:
    hulls = [hull for cloud in points if (hull := Hull.of(np.array(cloud))) is not None and hull.volume > 1e-4]
    assume(hulls)
    surface = from_manifold(manifold3d.Manifold.sphere(0.7, 4 * (levels + 1)))
    found = hull_distances(hulls, surface.vertices, surface.faces, TOLERANCE)
    distances = hull_union(hulls).distance(sampled(surface))
    assert distances.max() <= found.under[1] + 1e-7
    assert found.under[0] <= distances.max() + 0.05
    # The exposed surface lies on facets, inside no hull; every sample of a facet that is inside none is covered by it.
    exposed, faces = hull_union(hulls).exposed()
    points = sampled(Closed(exposed, faces), 5000)
    assert all(depth_in(hull, points).max() < 1e-5 for hull in hulls)
    over = _native.Surface(surface.vertices, surface.faces).distance(points).max()
    assert over <= found.over[1] + 1e-7
    assert found.over[0] <= over + 0.1
    shown = np.vstack([of_facets(hull, [other for other in hulls if other is not hull]) for hull in hulls])
    if len(shown):
        assert _native.Surface(exposed, faces).distance(shown).max() < 1e-5


def sampled(mesh: Closed, count: int = 20_000) -> Floats:
    return np.vstack([_native.sample_surface(mesh.vertices, mesh.faces, count, 3)[0], mesh.vertices])


def of_facets(hull: Hull, others: list[Hull]) -> Floats:
    points = sampled(Closed(hull.vertices, hull.faces), 5000)
    for other in others:
        points = points[depth_in(other, points) < -1e-5]
        if len(points) == 0:
            break
    return points


@pytest.mark.slow
@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.sampled_from([np.float32, np.float64]))
def test_seams_between_hulls_are_no_surface_of_the_union(seed: int, cuts: int, precision: type) -> None:
    """Pieces of a cut ball, rounded as a file rounds them: what is outer is what leads out of all pieces.

    The reference asks Qhull's planes: a point of a facet is outer where a step of 1e-5 along its normal leads into no
    piece, and hidden where it does.
    """
    rng = np.random.default_rng(seed)
    pieces = [manifold3d.Manifold.sphere(1.0, 24)]
    for _ in range(cuts):
        normal = rng.normal(size=3)
        largest = pieces.pop(int(np.argmax([piece.volume() for piece in pieces])))
        pieces += largest.split_by_plane(normal / np.linalg.norm(normal), rng.uniform(-0.2, 0.2))
    solids = [from_manifold(piece) for piece in pieces if piece.volume() > 1e-9]
    hulls = [hull for solid in solids if (hull := Hull.of(solid.vertices.astype(precision).astype(np.float64)))]
    planes = [ConvexHull(hull.vertices).equations for hull in hulls]
    points, normals = (np.vstack(both) for both in zip(*map(of_hull, hulls), strict=True))
    stepped = points + 1e-5 * normals
    height = np.min([(stepped @ e[:, :3].T + e[:, 3]).max(axis=1) for e in planes], axis=0)
    vertices, faces = hull_union(hulls).exposed()
    away = _native.Surface(vertices, faces).distance(points)
    assert away[height > 1e-6].max() < 5e-6
    deep = height < -5e-6  # not at the rim of a seam, where both are near
    assert deep.sum() > 100
    assert (away[deep] > 1e-6).all()
    ball = from_manifold(manifold3d.Manifold.sphere(1.0, 24))
    assert hull_distances(hulls, ball.vertices, ball.faces, TOLERANCE).over[1] < 2 * TOLERANCE
    assert _native.Surface(ball.vertices, ball.faces).distance(points[deep]).max() > 0.2  # what the seams would say


def of_hull(hull: Hull) -> tuple[Floats, Floats]:
    """Points of the facets, by area, and the facets' normals."""
    points, faces = _native.sample_surface(hull.vertices, hull.faces, 3000, 1)
    corners = hull.vertices[hull.faces[faces]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(4))
def test_places_of_the_greatest_distances(seed: int) -> None:
    """Measured there by point-to-triangle distances alone, it is as far as the lower bound says."""
    rng = np.random.default_rng(seed)
    surface = from_manifold(box(*BRICK))
    hulls = [Hull.of(rng.normal(size=(12, 3)) * 0.4 + at) for at in rng.normal(size=(5, 3))]
    found = hull_distances([hull for hull in hulls if hull], surface.vertices, surface.faces, threads=1)
    out, missed = np.array([found.over_at]), np.array([found.under_at])
    assert point_to_triangles(out, surface.vertices, surface.faces) == pytest.approx(found.over[0], abs=1e-9)
    each = [point_to_triangles(missed, hull.vertices, hull.faces)[0] for hull in hulls if hull]
    assert min(each) == pytest.approx(found.under[0], abs=1e-9)
    for hull in hulls:
        depth = depth_in(hull, np.concatenate([out, missed]))
        assert (depth < 1e-6).all(), "a place inside a hull"
    assert point_to_triangles(missed, surface.vertices, surface.faces) == pytest.approx(0, abs=1e-9)
    threaded = hull_distances([hull for hull in hulls if hull], surface.vertices, surface.faces, threads=4)
    assert threaded == found


def distances_to_a_ball(threads: int) -> Floats:
    ball = trimesh.creation.icosphere(3)
    points = np.random.default_rng(2).uniform(-1.5, 1.5, (3000, 3))
    surface = _native.Surface(np.array(ball.vertices), np.array(ball.faces, dtype=np.int32))
    return surface.distance(points, threads)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system does not fork")
def test_a_fork_has_threads_of_its_own() -> None:
    """Those of its parent are not there: it must not wait for them."""
    found = distances_to_a_ball(4)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        for other in pool.map_async(distances_to_a_ball, [4, 1, 2, 4], chunksize=1).get(60):
            assert np.array_equal(found, other)


def test_no_hulls_add_nothing_and_miss_everything() -> None:
    brick = from_manifold(box(*BRICK))
    assert hull_distances([], brick.vertices, brick.faces) == HullDistances((0.0, 0.0), (np.inf, np.inf))


# --- closest points, winding numbers and samples of surfaces of any quality -------------------------------------------


@pytest.mark.parametrize("width", [1.0, 1e-9])
def test_around_a_closed_surface_windings_are_whole_numbers(width: float) -> None:
    """Two rings through each other, at best as thick as rounding; rays meet their edges, corners, and faces edge on."""
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=16, minor_sections=8)
    other = ring.copy().apply_translation([0.3, 0, 0])
    both = trimesh.util.concatenate([ring, other])
    scale = np.array([1, 1, width])
    vertices = np.ascontiguousarray(both.vertices * scale)
    surface = _native.Surface(vertices, np.ascontiguousarray(both.faces, dtype=np.int32))
    ray = np.array([2, 3, 4]) / np.sqrt(29)
    at = np.concatenate([vertices, vertices[both.faces].mean(axis=1), vertices[both.edges_unique].mean(axis=1)])
    points = np.concatenate([at[:, None] - ray * np.array([0.1, 1.0])[:, None], at[:, None] + ray * 0.1], axis=1)
    points = points.reshape(-1, 3)
    points = points[surface.distance(points) > 1e-3]
    exact = surface.winding(points, accuracy=np.inf)
    assert width < 1 or set(np.round(exact)) == {0, 1, 2}
    np.testing.assert_array_equal(surface.winding(points, is_closed=True), np.round(exact))


def test_winding_of_an_open_surface_is_the_solid_angle_it_covers() -> None:
    half = trimesh.creation.icosphere(subdivisions=4)
    half = half.submesh([np.flatnonzero(half.triangles_center[:, 2] < 0)], append=True)
    surface = _native.Surface(np.ascontiguousarray(half.vertices), np.ascontiguousarray(half.faces, dtype=np.int32))
    assert surface.winding(np.zeros((1, 3)), accuracy=np.inf)[0] == pytest.approx(0.5, abs=0.02)


def test_fast_winding_is_near_the_exact_sum(corpus: Path) -> None:
    for name in (corpus / "quick.txt").read_text().split()[:4]:
        mesh = trimesh.load(corpus / name, process=False)
        vertices = np.ascontiguousarray(2 * (mesh.vertices - mesh.bounds.mean(axis=0)) / mesh.extents.max())
        faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
        points, _ = _native.sample_surface(vertices, faces, 1000, 0)
        points += np.random.default_rng(0).normal(scale=0.02, size=points.shape)
        surface = _native.Surface(vertices, faces)
        exact = surface.winding(points, accuracy=np.inf)
        assert np.abs(surface.winding(points) - exact).max() < 0.1
        assert np.abs(surface.winding(points, accuracy=4) - exact).max() < 0.03


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**63), st.integers(0, 300))
def test_samples_lie_on_the_faces_they_name(seed: int, count: int) -> None:
    """Of triangle soups with shared corners, slivers and triangles of no area."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (rng.integers(1, 13), 3)).round(rng.integers(0, 9))
    faces = rng.integers(0, len(vertices), (rng.integers(1, 31), 3)).astype(np.int32)
    if count > 0 and _native.mesh_area(vertices, faces) == 0:
        with pytest.raises(ValueError, match="no area"):
            _native.sample_surface(vertices, faces, count, seed)
        return
    points, on = _native.sample_surface(vertices, faces, count, seed)
    assert points.shape == (count, 3)
    again, _ = _native.sample_surface(vertices, faces, count, seed)
    assert points.tobytes() == again.tobytes()
    for face in np.unique(on):
        assert point_to_triangles(points[on == face], vertices, faces[[face]]).max() < 1e-7


def test_samples_are_spread_by_area() -> None:
    mesh = from_manifold(box((0, 0, 0), (1, 2, 3)).refine(3))
    areas = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).area_faces
    count = 5000
    for seed in range(5):
        points, face = _native.sample_surface(mesh.vertices, mesh.faces, count, seed)
        expected = count * areas / areas.sum()
        assert np.abs(np.bincount(face, minlength=len(areas)) - expected).max() < 3
        np.testing.assert_allclose(points.mean(axis=0), [0.5, 1, 1.5], atol=0.02)  # the surface's centroid
