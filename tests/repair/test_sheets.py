"""Sheets become slabs, and surfaces without inside or area a thin solid."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.union import to_arrays
from rlacd.repair.wanted import DEFAULT_GAP
from rlacd.solid.frame import HALF_THICKNESS
from tests.repair.repaired import BOX, join, moved, solid_of, steps, volume
from tests.shapes_bad import band, klein_bottle


def test_a_sheet_that_hangs_between_two_boxes_stays():
    """All its corners are corners of the boxes."""
    left, right = moved(BOX, -3, 0, 0), moved(BOX, 3, 0, 0)
    sheet = trimesh.Trimesh([[-2, -1, 1], [2, -1, 1], [2, 1, 1], [-2, 1, 1]], [[0, 1, 2], [0, 2, 3]], process=False)
    solid = solid_of(join(left, right, sheet))
    assert solid.bodies[0].deviation < 2 * HALF_THICKNESS
    assert volume(solid) == pytest.approx(16 + 8 * 2 * HALF_THICKNESS / solid.frame.scale, rel=1e-3)


@pytest.mark.parametrize("tip", [(1.6, 0.5, 1.7), (1.7, 0.1, 1.8), (2.3, 0.1, 2.2)])
def test_a_fin_that_leans_into_its_body_is_kept_where_it_comes_out_again(tip):
    plate = trimesh.creation.box((4, 0.4, 4))
    corners = [int(np.argmin(np.linalg.norm(plate.vertices - (x, y, 2), axis=1))) for x in (2, -2) for y in (-0.2, 0.2)]
    fins = [[*corners[:2], 8], [*corners[2:], 9]]
    mesh = trimesh.Trimesh(
        np.vstack([plate.vertices, tip, (-2.3, 0, 2)]), np.vstack([plate.faces, fins]), process=False
    )
    solid = solid_of(mesh)
    there = solid.frame.to_frame(mesh.vertices)
    query = SurfaceQuery(*to_arrays(solid.manifold))
    assert (query.inside(there) | (query.distance(there) <= 2 * HALF_THICKNESS)).all()
    assert volume(solid) == pytest.approx(6.4, rel=1e-3)


def test_a_sliver_that_begins_inside_its_body_is_kept_where_it_leads_out():
    corners = [int(np.argmin(np.linalg.norm(BOX.vertices - at, axis=1))) for at in ((-1, -1, -1), (1, -1, -1))]
    sliver = [[*corners, 8], [*corners[::-1], 8]]
    tip = np.array([[0.0, 0.9, 2.0]])
    solid = solid_of((np.vstack([BOX.vertices, tip]), np.vstack([BOX.faces, sliver])))
    assert SurfaceQuery(*to_arrays(solid.manifold)).distance(solid.frame.to_frame(tip)) <= 2 * HALF_THICKNESS
    assert volume(solid) == pytest.approx(8, rel=0.01)


@pytest.mark.parametrize("sheets", [3, 4, 5])
def test_sheets_that_share_an_edge(sheets):
    angle = 2 * np.pi * np.arange(sheets) / sheets
    around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.vstack([[[0, 0, 0], [0, 0, 1]], around, around + np.array([0, 0, 1])])
    faces = [f for i in range(sheets) for f in ([0, 2 + i, 1], [1, 2 + i, 2 + sheets + i])]
    solid = solid_of((vertices, faces))
    assert solid.manifold.volume() == pytest.approx(sheets * solid.frame.scale**2 * 2 * HALF_THICKNESS, rel=0.02)


@pytest.mark.parametrize("twists", [0, 1, 2, 3])
def test_twisted_bands_become_slabs(twists):
    mesh = band(twists)
    solid = solid_of(mesh)
    assert steps(solid) == ["slab"]
    area = mesh.area * solid.frame.scale**2
    # The faces of a twisted square lie at an angle; a vertex keeps its distance to both, so the slab is thicker there.
    assert 0.99 < solid.manifold.volume() / (2 * HALF_THICKNESS * area) < (1.01 if twists == 0 else 1.4)
    assert solid.bodies[0].deviation < 3 * HALF_THICKNESS


def test_the_hull_of_edges_is_said_to_leave_out_points():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    solid = solid_of((points, np.array([[0, 1, 2], [3, 3, 3]])))
    assert "convex hull of all edges" in solid.warnings[-1]
    assert solid.frame.to_input(solid.left_out).tolist() == [[0, 1, 0]]


def with_leaves(count):
    """Small triangles in a ball, some of them far from all others."""
    random = np.random.default_rng(3)
    leaves = (random.normal(size=(count, 1, 3)) * 0.3 + random.normal(size=(count, 3, 3)) * 0.03).reshape(-1, 3)
    return leaves, np.arange(3 * count).reshape(-1, 3)


@pytest.mark.slow
@pytest.mark.parametrize("count", [310, 600])
def test_hundreds_of_leaves_are_one_crowd_that_leaves_none_outside(count):
    vertices, faces = with_leaves(count)
    solid = solid_of((vertices, faces))
    assert set(steps(solid)) == {"wrapped"}
    assert max(body.deviation for body in solid.bodies) < 2 * DEFAULT_GAP
    query, there = SurfaceQuery(*to_arrays(solid.shape)), solid.frame.to_frame(vertices)
    assert query.distance(there)[~query.inside(there)].max(initial=0) <= 2 * HALF_THICKNESS


def test_a_solid_with_a_bent_fin_is_not_called_a_shell():
    fin = [[1, -1, 1], [1, 1, 1], [2, 1, 1], [2, -1, 1], [2, 1, 2], [2, -1, 2]]
    faces = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]]
    solid = solid_of(join(BOX, trimesh.Trimesh(fin, faces, process=False)))
    assert volume(solid) == pytest.approx(8, rel=1e-2)
    assert solid.holes
    assert not solid.warnings


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 12))
@settings(max_examples=25, deadline=None)
@pytest.mark.promise("any-mesh")
def test_random_soup_gives_a_closed_solid_near_it(seed, count):
    random = np.random.default_rng(seed)
    vertices = random.uniform(-1, 1, (max(3, count // 2), 3)).round(1)
    faces = random.integers(0, len(vertices), (count, 3))
    solid = solid_of((vertices, faces))
    assert np.isfinite([body.deviation for body in solid.bodies]).all()


def test_cloth_is_never_filled():
    x, y = np.meshgrid(np.linspace(-1, 1, 12), np.linspace(-1, 1, 12))
    i = np.arange(11 * 12).reshape(11, 12)[:, :-1].ravel()
    cloth = trimesh.Trimesh(
        np.stack([x, y, 0.05 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3),
        np.concatenate([np.stack([i, i + 1, i + 13], 1), np.stack([i, i + 13, i + 12], 1)]),
        process=False,
    )
    solid = solid_of(cloth)
    assert steps(solid) == ["slab"]
    assert not solid.warnings


def test_a_bottle_without_an_inside_becomes_a_closed_solid():
    solid_of(klein_bottle())
