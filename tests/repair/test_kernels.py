"""The kernels and measures of repair against plain references."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree

from rlacd import _native
from rlacd.repair.voxels import Reach, _grown

BALL = trimesh.creation.icosphere(3)
VERTICES, FACES = np.array(BALL.vertices), np.array(BALL.faces, dtype=np.int64)


def test_caps_avoid_taken_chords_if_they_can() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    beside = np.tile([0.0, 0.0, -1.0], (4, 1))
    for chord in ((0, 2), (1, 3)):
        taken = np.zeros((4, 4), dtype=bool)
        taken[chord], taken[chord[::-1]] = True, True
        triangles = _native.least_bent(points, beside, taken)
        assert not any(set(chord) <= set(t) for t in triangles.tolist())
    assert len(_native.least_bent(points, beside, np.ones((4, 4), dtype=bool))) == 2
    assert len(_native.least_bent(np.full((5, 3), 1e160) * 1e-20, np.zeros((5, 3)))) == 3
    with pytest.raises(ValueError, match="marks"):
        _native.least_bent(points, beside, np.zeros((3, 3), dtype=bool))


def test_nearest_points_do_not_depend_on_their_neighbours() -> None:
    """Points on the surface, where rounding decides whether they lie in the boxes of the triangles they are on."""
    rng = np.random.default_rng(0)
    vertices = VERTICES @ trimesh.transformations.rotation_matrix(0.3, (1, 2, 3))[:3, :3] * [1, 1, 1e-9]
    surface = _native.Surface(np.ascontiguousarray(vertices), FACES.astype(np.int32))
    on = np.einsum("fsc,fcx->fsx", rng.dirichlet([1, 1, 1], (len(FACES), 4)), vertices[FACES]).reshape(-1, 3)
    points = np.concatenate([vertices, on, on[rng.permutation(len(on))[:200]] + rng.normal(0, 0.1, (200, 3))])
    alone = np.concatenate([surface.distance(p[None]) for p in points])
    np.testing.assert_array_equal(surface.distance(points), alone)
    closest, face = surface.closest(points)
    np.testing.assert_array_equal(face, np.concatenate([surface.closest(p[None])[1] for p in points]))
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), alone, atol=1e-15)


@pytest.mark.parametrize("radius", [0.7, 1.0, 1.5, 3.0, 3.5, 5.2])
def test_cells_grow_to_all_cells_within_a_radius(radius: float) -> None:
    cells = np.random.default_rng(1).random((14, 11, 17)) < 0.01
    np.testing.assert_array_equal(_grown(cells, radius), ndimage.distance_transform_edt(~cells) <= radius + 1e-12)


@given(st.integers(0, 10**6), st.integers(0, 400), st.floats(0.0, 0.5))
@settings(max_examples=40, deadline=None)
def test_points_in_a_ball(seed: int, count: int, radius: float) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(size=(count, 3)).round(random.integers(1, 4))  # some in one place
    centres = random.uniform(-0.2, 1.2, (20, 3))
    radii = np.full(20, radius) * random.uniform(size=20)
    counts, found = _native.points_within(points, centres, radii)
    expected = cKDTree(points).query_ball_point(centres, radii, return_sorted=True)
    assert counts.tolist() == [len(own) for own in expected]
    assert found.tolist() == [int(i) for own in expected for i in own]


def test_a_search_for_points_ends_at_its_limit() -> None:
    points = np.zeros((100, 3))
    _, found = _native.points_within(points, points, np.ones(100), 250)
    assert len(found) == 300
    with pytest.raises(ValueError, match="not finite"):
        _native.points_within(np.full((1, 3), np.inf), points, np.ones(100))
    with pytest.raises(ValueError, match="one radius"):
        _native.points_within(points, points, np.ones(3))


@given(st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_the_nearest_room(seed: int) -> None:
    random = np.random.default_rng(seed)
    room = np.where(random.uniform(size=(9, 10, 11)) < 0.02, random.integers(1, 4, (9, 10, 11)), 0)
    none = np.zeros(room.shape, dtype=bool)
    reach = Reach(np.zeros(3), 1.0, 1.5, none, none, room)
    points = np.argwhere(~none).astype(float)
    found = reach.rooms_near(points)
    away = ndimage.distance_transform_edt(room == 0) if room.any() else np.full(room.shape, np.inf)
    assert ((found > 0) == (away.ravel() <= 3.5)).all()
    for label in np.unique(found[found > 0]):  # the room is as near as any
        own = ndimage.distance_transform_edt(room != label).ravel()
        assert (own[found == label] == away.ravel()[found == label]).all()
