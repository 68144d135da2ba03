"""The kernels and measures of repair against plain references."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree

from rlacd import _native
from rlacd.repair.distance import points_covering, shared_faces
from rlacd.repair.voxels import Reach, _grown
from rlacd.solid.topology import Edges

BALL = trimesh.creation.icosphere(3)
VERTICES, FACES = np.array(BALL.vertices), np.array(BALL.faces, dtype=np.int64)


def triangulations(i: int, k: int) -> list[list[tuple[int, int, int]]]:
    """All triangulations of the polygon i, i + 1, ..., k."""
    if k - i < 2:
        return [[]]
    return [
        [*a, (i, j, k), *b] for j in range(i + 1, k) for a, b in product(triangulations(i, j), triangulations(j, k))
    ]


def bending(triangles: list[tuple[int, int, int]], points: np.ndarray, beside: np.ndarray) -> float:
    """The cost that caps minimise, summed over edges."""
    n = len(points)
    normals = {(i, (i + 1) % n): -beside[i] for i in range(n)}
    span = max(np.linalg.norm(p - q) for p in points for q in points)
    cost = 0.0
    for i, j, k in triangles:
        cross = np.cross(points[j] - points[i], points[k] - points[i])
        cost += 0.1 / span * np.linalg.norm(cross)
        for edge in ((i, j), (j, k), (k, i)):
            unit = cross / np.linalg.norm(cross)
            other = normals.pop(edge, None)
            if other is None:
                normals[edge[::-1]] = unit
            else:
                angle = np.arccos(np.clip(unit @ other, -1, 1))
                cost += angle * np.linalg.norm(points[edge[0]] - points[edge[1]])
    return cost


@pytest.mark.parametrize("seed", range(8))
def test_caps_bend_little(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 4 + seed % 4
    angle = 2 * np.pi * np.arange(n) / n
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) + rng.normal(0, 0.3, (n, 3))
    beside = rng.normal(size=(n, 3))
    beside /= np.linalg.norm(beside, axis=1, keepdims=True)
    found = [tuple(t) for t in _native.least_bent(points, beside).tolist()]
    costs = [bending(some, points, beside) for some in triangulations(0, n - 1)]
    assert len(found) == n - 2
    # What lies behind a chord is chosen without what lies beyond it: only for quads is that always the least.
    allowed = 1.1 if n > 4 else 1 + 1e-9
    assert min(costs) * (1 - 1e-9) <= bending(found, points, beside) <= allowed * min(costs)


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


@given(st.lists(st.floats(0, 6.2), min_size=1, max_size=7, unique_by=lambda x: round(x, 2)), st.integers(0, 2**7 - 1))
def test_wedges_go_around_an_edge(angles: list[float], wound: int) -> None:
    spokes = np.stack([np.cos(angles), np.sin(angles), np.full(len(angles), 0.3)], axis=1)
    vertices = np.concatenate([[[0, 0, 0], [0, 0, 1]], spokes])
    faces = np.array([(0, 1, i + 2) if wound >> i & 1 else (1, 0, i + 2) for i in range(len(angles))])
    edges = Edges.of(faces, len(vertices))
    wedges, sides = _native.wedges(vertices, faces, edges.of_halfedge, len(edges.valence))
    around = edges.of_halfedge[wedges[:, 0]] == edges.of_halfedge[0]
    following = dict((wedges[around] // 3).tolist())
    order = np.argsort(angles).tolist()
    if len(order) > 2:
        assert following == dict(zip(order, order[1:] + order[:1], strict=True))
    for (f, g), (a, b) in zip((wedges[around] // 3).tolist(), sides[around].tolist(), strict=True):
        # A face that runs with the edge shows its front to what follows it.
        assert (a, b) == (2 * f + (not wound >> f & 1), 2 * g + (wound >> g & 1))


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


def test_shared_faces_are_found_whatever_their_order_and_winding() -> None:
    rng = np.random.default_rng(3)
    order = rng.permutation(len(VERTICES))
    turned = np.argsort(order)[FACES[::-1, ::-1]]
    moved = VERTICES[order].copy()
    moved[0] += 1e-15
    moved[moved == 0] *= -1  # -0.0 is the same place as 0.0
    mine, others = shared_faces(VERTICES, FACES, moved, turned[:1000])
    expected = ~(turned == 0).any(axis=1)
    np.testing.assert_array_equal(others, expected[:1000])
    np.testing.assert_array_equal(mine[::-1], expected & (np.arange(len(FACES)) < 1000))


@given(st.integers(0, 10**6), st.integers(0, 400), st.floats(0.0, 0.5))
@settings(max_examples=40, deadline=None)
def test_points_in_a_ball(seed: int, count: int, radius: float) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(size=(count, 3)).round(random.integers(1, 4))  # some in one place
    centres = random.uniform(-0.2, 1.2, (20, 3))
    radii = np.full(20, radius) * random.uniform(size=20)
    counts, found = _native.PointTree(points).within(centres, radii)
    expected = cKDTree(points).query_ball_point(centres, radii, return_sorted=True)
    assert counts.tolist() == [len(own) for own in expected]
    assert found.tolist() == [int(i) for own in expected for i in own]


def test_a_search_for_points_ends_at_its_limit() -> None:
    points = np.zeros((100, 3))
    _, found = _native.PointTree(points).within(points, np.ones(100), 250)
    assert len(found) == 300
    with pytest.raises(ValueError, match="not finite"):
        _native.PointTree(np.full((1, 3), np.inf))
    with pytest.raises(ValueError, match="one radius"):
        _native.PointTree(points).within(points, np.ones(3))


@given(st.integers(0, 10**6), st.floats(0.05, 0.95))
@settings(max_examples=40, deadline=None)
def test_connected_cells(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    cells = random.uniform(size=random.integers(1, 12, 3)) < share
    label = _native.label_cells(cells).reshape(cells.shape)
    expected, count = ndimage.label(cells)
    assert len(np.unique(label[cells])) == count
    assert len(set(zip(label[cells].tolist(), expected[cells].tolist(), strict=True))) == count
    assert (label[~cells] == 0).all()


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


@pytest.mark.parametrize("spacing", [0.05, 0.5])
def test_marked_cells_are_those_that_hold_points_of_the_faces(spacing: float) -> None:
    pitch, margin = 0.04, 3
    origin, marks, shape = _native.mark_cells(VERTICES, FACES, spacing, pitch, margin)
    points, _ = points_covering(VERTICES, FACES, spacing)
    assert np.array_equal(origin, points.min(axis=0) - margin * pitch)
    wanted = np.zeros(shape, dtype=bool)
    wanted[tuple(np.rint((points - origin) / pitch).astype(int).T)] = True
    assert np.array_equal(np.frombuffer(marks, dtype=bool).reshape(shape), wanted)
    assert shape == tuple(np.argwhere(wanted).max(axis=0) + 1 + margin)


def _edges_through(corners: np.ndarray, other: np.ndarray) -> bool:
    """Whether an edge of one triangle passes through another."""
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        columns = np.stack([start - end, other[1] - other[0], other[2] - other[0]], axis=1)
        t, u, v = np.linalg.solve(columns, start - other[0])
        if 0 <= t <= 1 and u >= 0 and v >= 0 and u + v <= 1:
            return True
    return False


def test_crossing_faces_of_different_bodies_are_counted() -> None:
    rng = np.random.default_rng(0)
    corners = rng.uniform(size=(60, 3, 3))
    faces, body = np.arange(180, dtype=np.int32).reshape(-1, 3), rng.integers(4, size=60)
    crossed = np.zeros((60, 60), dtype=bool)
    for i, j in product(range(60), repeat=2):
        crossed[i, j] = body[i] != body[j] and _edges_through(corners[i], corners[j])
    crossed |= crossed.T
    each = crossed.sum(axis=1)
    found = _native.crossings(corners.reshape(-1, 3), faces, body, 10_000)
    assert found == (each.sum() // 2, (each * (each - 1) // 2).sum() // 3)
    assert _native.crossings(corners.reshape(-1, 3), faces, body, 10)[0] < each.sum() // 2
