"""The kernels and measures of repair against numpy, scipy, trimesh and manifold3d."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType
from scipy import ndimage
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from rlacd import _native
from rlacd._native import face_areas, long_normals, signed_tetrahedra
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.repair.union import one_body, unite
from rlacd.repair.voxels import _grown
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.topology import Edges, bodies_of, first_of_doubled

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


def soup(seed: int, count: int, faces: int) -> tuple[np.ndarray, np.ndarray]:
    """Points, many of them equal, with zeros of both signs; faces, many of them equal or degenerate."""
    rng = np.random.default_rng(seed)
    vertices = rng.integers(-1, 2, (count, 3)) * rng.choice([1.0, -1.0], (count, 3))
    return vertices, rng.integers(0, count, (faces, 3))


soups = given(st.integers(0, 2**32), st.integers(3, 40), st.integers(0, 80))


@settings(max_examples=200, deadline=None)
@soups
def test_welding_keeps_first_places_and_one_of_equal_faces(seed: int, count: int, faces: int) -> None:
    vertices, triangles = soup(seed, count, faces)
    _, first, inverse = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    place = first[inverse.reshape(-1)]  # of each vertex, the first vertex there
    used = np.unique(place[triangles])
    number = np.searchsorted(used, place)
    alike: dict[frozenset[int], list[list[int]]] = {}  # faces with the same corners
    for face in number[triangles].tolist():
        if len(set(face)) == 3:
            alike.setdefault(frozenset(face), []).append(face)

    def windings(group: list[list[int]]) -> list[int]:
        return [round(np.linalg.det(np.eye(3)[np.argsort(face)])) for face in group]

    kept, slivers = {}, set()
    for corners, group in alike.items():
        net = sum(windings(group))
        kept[corners] = next(face for face, sign in zip(group, windings(group), strict=True) if sign * net >= 0)
        slivers |= {corners} if net == 0 else set()
    found, faces_found, is_sliver = _native.weld(vertices, triangles)
    assert np.array_equal(found, vertices[used])
    assert not np.signbit(found[found == 0]).any()
    assert sorted(faces_found.tolist()) == sorted(kept.values())
    assert [frozenset(face) in slivers for face in faces_found.tolist()] == is_sliver.tolist()


@settings(max_examples=50, deadline=None)
@soups
def test_edges_bodies_areas_and_volumes_of_soups(seed: int, count: int, faces: int) -> None:
    """Edges are the distinct pairs in ascending order; bodies share them and are numbered by their first faces."""
    _, triangles = soup(seed, count, faces)
    vertices, edges = np.random.default_rng(seed).normal(size=(count, 3)), Edges.of(triangles, count)
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    distinct, inverse, face_count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    assert np.array_equal(edges.vertices, distinct)
    assert np.array_equal(edges.of_halfedge, inverse.reshape(-1))
    assert np.array_equal(edges.face_count, face_count)
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    assert np.array_equal(np.flatnonzero(first_of_doubled(triangles, count)), np.sort(first))
    number, body = bodies_of(triangles, edges)
    assert (np.diff(np.unique(body, return_index=True)[1]) > 0).all()
    edge = edges.of_halfedge.reshape(-1, 3)
    shares = (edge[:, None, :, None] == edge[None, :, None, :]).any(axis=(2, 3))
    expected, same = connected_components(shares, directed=False)
    assert number == expected
    assert len(np.unique(np.stack([body, same]), axis=1).T) == number
    corners = vertices[triangles]
    np.testing.assert_allclose(face_areas(vertices, triangles), trimesh.triangles.area(corners), atol=1e-14)
    np.testing.assert_allclose(signed_tetrahedra(vertices, triangles), np.linalg.det(corners) / 6, atol=1e-14)
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    assert np.array_equal(long_normals(vertices, triangles), np.cross(along, across))
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0)
    np.testing.assert_allclose(_native.longest_edges(vertices, triangles), longest, rtol=1e-14)


@pytest.mark.parametrize("major", [1.0, 3.0])
def test_one_body_is_turned_outwards_and_taken_only_where_it_has_no_pinch(major: float) -> None:
    """A ring without a hole touches itself in one corner, where manifold3d makes two."""
    ring = trimesh.creation.torus(major, 1.0, 24, 24)
    vertices, faces, _ = _native.weld(np.round(ring.vertices, 9), np.asarray(ring.faces)[:, ::-1].copy())
    taken = one_body(vertices, faces)
    assert (taken is None) == (major == 1)
    assert taken is None or _native.mesh_volume(*taken[0]) == pytest.approx(ring.volume)


@pytest.mark.parametrize("sliver", [1e-13, 1e-11])
def test_a_mesh_that_manifold3d_would_change_is_left_to_it(sliver: float) -> None:
    ball = trimesh.creation.icosphere(2)
    vertices = np.asarray(ball.vertices).copy()
    a, b = ball.edges_unique[0]
    vertices[b] = vertices[a] + [sliver, 0, 0]
    solid = repair(InputMesh(vertices, np.asarray(ball.faces, dtype=np.int64), "ball", ()))
    assert isinstance(solid.shape, Manifold)
    assert solid.manifold.volume() == pytest.approx(_native.mesh_volume(vertices, np.asarray(ball.faces, np.int32)))


def test_windings_decide_where_rounding_folds_a_closed_surface() -> None:
    def wall(x: float, y: float, z: float) -> float:
        s, c = np.sin(4 * np.array([x, y, z])), np.cos(4 * np.array([x, y, z]))
        return float(min(0.35 - abs(s @ np.roll(c, -1)), 0.98 - max(abs(x), abs(y), abs(z))))

    body = Manifold.level_set(wall, [-1, -1, -1, 1, 1, 1], 0.1).to_mesh64()
    rounded = np.asarray(body.vert_properties[:, :3], dtype=np.float32).astype(float)
    exact, solid = Manifold(body).volume(), repair(load_mesh((rounded, body.tri_verts)))
    assert solid.manifold.volume() / solid.frame.scale**3 == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_the_union_does_not_depend_on_the_order_of_solids(seed: int) -> None:
    rng = np.random.default_rng(seed)
    solids = [
        Manifold.sphere(0.3 + rng.random(), 8 + 8 * int(rng.integers(8))).translate(rng.random(3)) for _ in range(12)
    ]
    volume = unite(solids, keep_cavities=True).volume()
    assert volume == pytest.approx(Manifold.batch_boolean(solids, OpType.Add).volume(), rel=1e-9)
    assert unite(solids[::-1], keep_cavities=True).volume() == pytest.approx(volume, rel=1e-9)
