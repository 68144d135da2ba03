"""Closest points, winding numbers and samples of surfaces of any quality."""

from __future__ import annotations

from pathlib import Path

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rlacd import _native
from tests.shapes import Closed, box, from_manifold, point_to_triangles

coordinates = st.floats(-1, 1, width=32)


@st.composite
def soups(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Triangle soups with shared corners, slivers and triangles of no area."""
    vertices = draw(hnp.arrays(np.float64, (draw(st.integers(1, 12)), 3), elements=coordinates))
    corner = st.integers(0, len(vertices) - 1)
    faces = draw(hnp.arrays(np.int32, (draw(st.integers(1, 30)), 3), elements=corner))
    return vertices, faces


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(soups(), hnp.arrays(np.float64, (8, 3), elements=st.floats(-2, 2)))
def test_distance_is_that_of_brute_force(soup: tuple[np.ndarray, np.ndarray], points: np.ndarray) -> None:
    surface = _native.Surface(*soup)
    np.testing.assert_allclose(surface.distance(points), point_to_triangles(points, *soup), atol=1e-7)
    closest, face = surface.closest(points)
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), surface.distance(points), atol=1e-12)
    for point, on in zip(closest, face, strict=True):
        assert point_to_triangles(point[None], soup[0], soup[1][[on]])[0] < 1e-7


@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.0])
def test_needles_are_as_near_as_their_edges(width: float) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.3, width, 0]])
    surface = _native.Surface(vertices, np.array([[0, 1, 2]], dtype=np.int32))
    points = np.random.default_rng(0).uniform(-1, 2, (200, 3))
    on_segment = np.stack([np.clip(points[:, 0], 0, 1), 0 * points[:, 0], 0 * points[:, 0]], axis=1)
    np.testing.assert_allclose(surface.distance(points), np.linalg.norm(points - on_segment, axis=1), atol=width + 1e-8)


def test_winding_tells_inside_from_outside() -> None:
    mesh = from_manifold(box((-1, -1, -1), (1, 1, 1)) - box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))
    reach = np.abs(points).max(axis=1)
    inside = (reach < 1) & (reach > 0.5)
    surface = _native.Surface(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(surface.winding(points, accuracy=np.inf), inside, atol=1e-9)
    assert np.array_equal(surface.winding(points) > 0.5, inside)


@pytest.mark.parametrize("width", [1.0, 1e-9])
def test_around_a_closed_surface_windings_are_whole_numbers(width: float) -> None:
    """Two rings through each other, at best as thick as rounding; rays meet their edges, corners, and faces edge on."""
    ring, other = trimesh.creation.torus(1.0, 0.3), trimesh.creation.torus(1.0, 0.3).apply_translation([0.3, 0, 0])
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
    for name in (corpus / "quick.txt").read_text().split()[:8]:
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
@given(soups(), st.integers(0, 300), st.integers(0, 2**63))
def test_samples_lie_on_the_faces_they_name(soup: tuple[np.ndarray, np.ndarray], count: int, seed: int) -> None:
    vertices, faces = soup
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


def test_samples_of_one_triangle_are_uniform() -> None:
    triangle = Closed(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], dtype=np.int32))
    points, _ = _native.sample_surface(triangle.vertices, triangle.faces, 4000, 3)
    cells, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=[0, 0.25, 0.5, 0.75, 1])
    whole = [cells[i, j] for i in range(4) for j in range(4) if i + j < 3]
    np.testing.assert_allclose(whole, 4000 / 8, rtol=0.06)


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "out of range"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.zeros((0, 3)), "no faces"),
    ],
)
def test_bad_surfaces_are_refused(vertices: list[list[float]], faces: list[list[int]], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        _native.Surface(np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32).reshape(-1, 3))


def test_points_that_are_not_finite_are_refused() -> None:
    surface = _native.Surface(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    for query in (surface.distance, surface.closest, surface.winding):
        with pytest.raises(ValueError, match="not finite"):
            query(np.array([[0, 0, np.nan]]))
