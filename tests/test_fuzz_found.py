"""What fuzzing and the sanitizers have found, each by the smallest input that shows it; and random shapes, judged."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
import trimesh

import rlacd
from fuzz.choices import draw_options
from fuzz.recipes import make_shape
from fuzz.trials import Laboratory, Trial
from rlacd import _native
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Plane, reunite
from rlacd.solid.hull import Hull
from tests.shapes import strangers


def triangles(unit: float) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    vertices = np.clip(random.normal(size=(60, 3)), -1, 1) * unit
    return vertices, random.integers(0, 60, (80, 3)).astype(np.int32)


@pytest.mark.parametrize("unit", [5e-324, 1e-310, 1e-200, 1e149])
def test_surfaces_of_any_size_can_be_asked_for_closest_points(unit: float) -> None:
    vertices, faces = triangles(unit)
    _, on = _native.Surface(vertices, faces).closest(vertices)
    assert ((on >= 0) & (on < 80)).all()


@pytest.mark.parametrize(("count", "is_apart"), [(4, False), (60, True)])
def test_sheets_that_all_cross_are_not_united_when_they_are_many(count: int, is_apart: bool) -> None:
    random = np.random.default_rng(0)
    corners = random.normal(size=(count, 2, 3))
    vertices = np.concatenate([corners, -corners.sum(axis=1, keepdims=True)], axis=1).reshape(-1, 3)  # around 0
    solid = repair(load_mesh((vertices, np.arange(3 * count).reshape(-1, 3))), threads=1)
    assert {body.step for body in solid.bodies} == {"slab"}
    assert solid.is_apart is is_apart
    assert solid.manifold.volume() > 0
    assert sum("cross too often" in said for said in solid.warnings) == is_apart


@pytest.mark.slow
@pytest.mark.parametrize("count", [50, 200])
@pytest.mark.promise("covered")
def test_a_soup_of_triangles_takes_at_most_a_hull_a_face_and_none_is_uncovered(count: int) -> None:
    """United, 50 of them become 47,000 triangles and 272 hulls."""
    vertices = np.random.default_rng(0).random((300, 3))
    faces = np.random.default_rng(1).integers(0, 300, (count, 3))
    result = rlacd.decompose(vertices, faces, threads=1)
    assert 0 < len(result) <= count
    assert any("cross too often" in said for said in result.report.warnings)
    proper = faces[(np.diff(np.sort(faces), axis=1) > 0).all(axis=1)]
    points = np.random.default_rng(2).dirichlet(np.ones(3), (len(proper), 20)) @ vertices[proper]
    outside = np.full(points.shape[:2], np.inf)
    for hull in result:
        heights = np.einsum("fpd,kd->fpk", points, hull.face_normals)
        heights -= (hull.face_normals * hull.triangles[:, 0]).sum(axis=1)
        outside = np.minimum(outside, heights.max(axis=2))
    assert outside.max() < 1e-6


def test_sheets_narrower_than_they_become_thick_are_not_built_inside_out() -> None:
    """Rods a millionth as thick as long, half of them flipped: their slabs had negative volume, and so no mass."""
    shape = make_shape(30363)
    solid = repair(load_mesh((shape.vertices, shape.faces)), threads=1)
    assert min(piece.volume() for piece in solid.manifold.decompose()) > 0
    extent = np.ptp(np.reshape(solid.manifold.bounding_box(), (2, 3)), axis=0)
    assert extent.max() == pytest.approx(2, abs=0.01)


@pytest.mark.parametrize("where", [[-3.9e35, 6.2e35, -2.3e35], [0, 0, 0], [1e300, -1e308, 1e308], [0, 1e-310, 5]])
@pytest.mark.parametrize(("limit", "most"), [({"max_vertices": 4}, 4), ({"max_faces": 11}, 7), ({}, 8)])
def test_limits_hold_where_coordinates_cannot_tell_corners_apart(
    where: list[float], limit: dict[str, int], most: int
) -> None:
    (hull,) = rlacd.decompose((np.array([where] * 3), np.array([[0, 1, 2]])), **limit)
    assert len(hull.vertices) <= most
    assert hull.is_watertight
    assert (hull.bounds[0] <= where).all()
    assert (hull.bounds[1] >= where).all()
    assert (Hull.of(np.vstack([hull.vertices, where])).vertices == hull.vertices).all()


@pytest.mark.slow
def test_reuniting_layers_that_nearly_touch_piles_up_no_faces() -> None:
    shape = make_shape(50089)
    solid = Component(repair(load_mesh((shape.vertices, shape.faces)), threads=1).manifold)
    random = np.random.default_rng(0)
    parts = [solid]
    for _ in range(12):
        x, y, z = random.normal(size=3)
        length = float(np.linalg.norm([x, y, z]))
        plane = Plane((float(x / length), float(y / length), float(z / length)), 0.1 * float(random.normal()))
        cut = [side for part in parts for side in part.cut(plane) if side is not None]
        whole = reunite(strangers(cut))
        parts = [whole] if whole is not None else cut[:3]
        if whole is not None:
            assert len(whole.faces) <= 1.3 * sum(len(side.faces) for side in cut) + 100
    assert sum(len(part.faces) for part in parts) < 3 * len(solid.faces)


@pytest.mark.parametrize(("faces", "said"), [(5, True), (12, False)])
def test_a_hull_of_few_faces_that_leaves_the_room_for_balls_is_reported(faces: int, said: bool) -> None:
    """A tetrahedron around a cube reaches twice its length out of it; where it goes, no balls had been placed."""
    cube = trimesh.creation.box((1, 1, 1))
    result = rlacd.decompose(cube, criterion=rlacd.NavigableSpace(0.8, 0.01), max_faces=faces, quality="fast")
    assert any("bounding box" in warning for warning in result.report.warnings) is said


def test_a_mesh_of_a_few_steps_of_floating_point_is_reported() -> None:
    """Hulls thinner than coordinates resolve are made thicker: by much, in a mesh nine steps long."""
    cube = trimesh.creation.box((1, 1, 1))
    far, near = cube.copy(), cube.copy()
    far.vertices = cube.vertices * 40 * np.spacing(1e3) + 1e3
    near.vertices = cube.vertices + 1e3
    for mesh, said in ((far, True), (near, False)):
        report = rlacd.decompose(mesh, quality="fast").report
        assert any("move the mesh to the origin" in warning for warning in report.warnings) is said


def test_a_needle_of_inverted_shells_has_a_mass() -> None:
    """With its cavities kept, because balls go there, most of it was inside out: a solid of negative volume."""
    shape = make_shape(500635)
    for keep in (True, False):
        assert repair(load_mesh((shape.vertices, shape.faces)), keep_cavities=keep).manifold.volume() > 0


@pytest.mark.slow
@pytest.mark.parametrize("corners", [14, 60])
@pytest.mark.parametrize("limit", [None, 5])
def test_sheets_that_cross_take_no_more_hulls_than_they_have_faces(corners: int, limit: int | None) -> None:
    """Cut, they fall into hundreds of pieces."""
    random = np.random.default_rng(0)
    vertices = random.random((corners, 3))
    faces = np.array([random.choice(corners, 3, replace=False) for _ in range(24)])
    result = rlacd.decompose(vertices, faces, openings="thin", quality="fast", threads=1, max_hulls=limit)
    assert len(result) <= (limit or 24)
    assert result.report.hausdorff.missed < 0.005
    assert limit or result.report.concavity.max < 0.05


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3, 40))
@pytest.mark.promise("any-mesh", "covered", "report-true")
def test_promises_hold_for_any_soup_and_any_options(seed: int) -> None:
    with contextlib.closing(Laboratory(0, None)) as laboratory:
        trial = laboratory.retry(Trial(0, seed, "shape"), make_shape(seed), draw_options(seed))
    assert trial.is_well, trial.said
