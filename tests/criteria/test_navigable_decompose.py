"""Navigable space from end to end: which hulls come out, what the report and the files say, bad input."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from manifold3d import Manifold, OpType

import rlacd
from rlacd.cli.main import app
from tests.hulls import assert_convex_hull
from tests.shapes import box, point_to_triangles, trimesh_of


def house(door: float) -> trimesh.Trimesh:
    """A house of 2 x 2 x 2 with thick walls, a table and a pillar inside, and a door `door` wide (0: none)."""
    inside = box((-0.85, -0.85, -0.85), (0.85, 0.85, 0.85))
    furniture = [
        box((-0.5, -0.5, -0.3), (0.5, 0.5, -0.2)),
        box((-0.05, -0.05, -0.9), (0.05, 0.05, -0.2)),
        box((0.6, 0.6, -0.9), (0.75, 0.75, 0.9)),
    ]
    walls = box((-1, -1, -1), (1, 1, 1)) - inside
    if door:
        walls -= box((-door / 2, -1.1, -0.85), (door / 2, -0.8, 0.6))
    return trimesh_of(Manifold.batch_boolean([walls, *furniture], OpType.Add))


def ell() -> trimesh.Trimesh:
    return trimesh_of(box((0, 0, 0), (2, 0.4, 0.4)) + box((0, 0, 0), (0.4, 0.4, 2)))


AIR = (-0.7, -0.7, 0.7)
"""A place in the house where nothing stands."""


def fills(result: rlacd.Decomposition, point: tuple[float, float, float]) -> bool:
    """Whether a hull covers the point."""
    return any(
        bool((hull.face_normals @ point <= (hull.face_normals * hull.triangles[:, 0]).sum(1)).all()) for hull in result
    )


def intrusion(result: rlacd.Decomposition) -> float:
    """Deepest that any hull reaches into any ball, in the input's unit, by brute force over facets and edges."""
    balls = result.balls
    deepest = 0.0
    for hull in result:
        distance = point_to_triangles(balls.centres, np.asarray(hull.vertices), np.asarray(hull.faces))
        corners = hull.triangles
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        outside = ((balls.centres[:, None] - corners[None, :, 0]) * normals).sum(axis=2).max(axis=1) > 0
        depth = balls.radii - np.where(outside, distance, -distance)
        deepest = max(deepest, float(depth.max(initial=0.0)))
    return deepest


def test_a_sealed_house_is_one_hull() -> None:
    result = rlacd.decompose(house(door=0), criterion=rlacd.NavigableSpace(0.05, 0.01))
    assert len(result) == 1


def test_a_door_wider_than_the_ball_opens_the_inside() -> None:
    space = rlacd.NavigableSpace(0.05, 0.01)  # a ball of radius 0.1 in a house of 2
    shut, opened = (rlacd.decompose(house(door), criterion=space) for door in (0.19, 0.21))
    assert fills(shut, AIR)
    assert not fills(opened, AIR)
    assert len(shut) < 6 < len(opened)
    assert intrusion(opened) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("ball", [0.9, 1.1])
@pytest.mark.promise("navigable")
def test_the_hole_of_a_torus_is_free_exactly_when_the_ball_fits(ball: float) -> None:
    torus = trimesh.creation.torus(0.75, 0.25, major_sections=96, minor_sections=64)  # a hole of radius 0.5
    size, tolerance = 2.0, 0.02
    result = rlacd.decompose(torus, criterion=rlacd.NavigableSpace((0.5 - tolerance) * ball / size, tolerance / size))
    in_the_hole = np.linalg.norm(result.balls.centres, axis=1).min() < 0.27
    assert in_the_hole == (ball < 1)


def test_the_report_and_a_file_tell_of_the_balls(tmp_path: Path) -> None:
    result = rlacd.decompose(ell(), criterion=rlacd.NavigableSpace(0.05, 0.02), policy="navacd")
    report = result.report
    space = report["navigable"]
    assert space["balls"] == len(result.balls) > 0
    assert space["radius"] == pytest.approx(0.1)
    assert space["intrusion"]["max"] == 0
    assert len(space["intrusion"]["per_part"]) == len(result)
    assert len(result.save_balls(tmp_path / "balls.csv").read_text().splitlines()) == 1 + len(result.balls)
    assert "concavity" not in report
    assert report["options"]["criterion"]["radius"] == 0.05
    json.dumps(report, allow_nan=False)
    for hull in result:
        assert_convex_hull(hull)


def test_a_threshold_does_not_go_with_it() -> None:
    with pytest.raises(rlacd.OptionError, match="has radius and tolerance instead"):
        rlacd.decompose(ell(), criterion=rlacd.NavigableSpace(), threshold=0.1)


def test_lengths_in_the_meshs_own_unit() -> None:
    mesh = ell()
    by_share = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(0.05, 0.02))
    mesh.apply_scale(1000)
    by_length = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(radius_abs=100.0, tolerance_abs=40.0))
    assert len(by_share) == len(by_length) == 2
    assert np.allclose(by_share.balls.centres * 1000, by_length.balls.centres, atol=1e-3)


@pytest.mark.slow
def test_max_hulls_gives_way_by_as_little_as_it_can() -> None:
    result = rlacd.decompose(house(door=0.5), criterion=rlacd.NavigableSpace(0.05, 0.01), max_hulls=4)
    assert len(result) <= 4
    assert result.report["navigable"]["intrusion"]["max"] > 0
    assert any("ball" in warning for warning in result.report["warnings"])


def bumpy_ball() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(3)
    x, y = ball.vertices[:, :1], ball.vertices[:, 1:2]
    ball.vertices *= 1 + 0.35 * np.sin(5 * x) * np.cos(4 * y)
    return ball


@pytest.mark.slow
def test_one_pass_eliminates_parts_that_others_can_hold_together() -> None:
    """A policy that stands for a published method does not: the same cuts, merged, are more hulls."""
    space, mesh = rlacd.NavigableSpace(0.1, 0.02), bumpy_ball()
    divided = [rlacd.decompose(mesh, criterion=space, quality="fast", threads=threads) for threads in (1, 3)]
    merged = rlacd.decompose(mesh, criterion=space, quality="fast", policy="greedy-excess-norm+edges")
    assert len(divided[0]) < len(merged)
    assert intrusion(divided[0]) < 1e-6
    assert divided[0].report["hausdorff"]["under"] < 5e-3
    for one, other in zip(*divided, strict=True):
        assert one.vertices.tobytes() == other.vertices.tobytes()
    assert "search" in divided[0].report["seconds"]
    assert "search" not in merged.report["seconds"]


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    ell().export(tmp_path / "ell.stl")
    return tmp_path / "ell.stl"


@pytest.mark.slow
def test_the_command_writes_the_balls(mesh: Path, tmp_path: Path) -> None:
    words = ["decompose", mesh, "-o", tmp_path / "out.glb", "--criterion", "navigable"]
    for ending in ("csv", "glb"):
        report = tmp_path / "report.json"
        assert run(*words, "--balls", tmp_path / f"balls.{ending}", "--report", report).exit_code == 0
    with (tmp_path / "balls.csv").open() as file:
        rows = list(csv.DictReader(file))
    spheres = trimesh.load(tmp_path / "balls.glb").to_geometry()
    assert len(rows) == len(spheres.split())
    assert all(float(row["radius"]) > 0 for row in rows)
    assert len(rows) == json.loads(report.read_text(encoding="utf-8"))["navigable"]["balls"] > 0
    places = np.array([[float(row[name]) for name in "xyz"] for row in rows])
    hulls = trimesh.load_scene(tmp_path / "out.glb").to_mesh().split()
    reach = np.min([point_to_triangles(places, hull.vertices, hull.faces) for hull in hulls], axis=0)
    assert (reach >= np.array([float(row["radius"]) for row in rows]) - 1e-4).all(), "a hull reaches into a ball"


def test_the_command_takes_seeds_and_planes(mesh: Path, tmp_path: Path) -> None:
    words = ["--criterion", "navigable", "--radius-abs", 0.2, "--tolerance-abs", 0.05, "--report", "-", "-q"]
    place = ["--seed-point", "1.5,0.2,1.5", "--closed-plane", "0,0,1,0"]
    done = run("decompose", mesh, "-o", tmp_path / "out.glb", *words, *place)
    assert done.exit_code == 0, done.output
    options = json.loads(done.stdout)["options"]["criterion"]
    assert options["seeds"] == [[1.5, 0.2, 1.5]]
    assert options["closed_planes"] == [[[0, 0, 1], 0]]


@pytest.mark.nightly
@pytest.mark.promise("navigable")
def test_no_hull_overlaps_a_final_ball_on_real_meshes(corpus: Path) -> None:
    for name in (corpus / "quick.txt").read_text().split()[::4]:
        result = rlacd.decompose(corpus / name, criterion=rlacd.NavigableSpace(0.05, 0.01), policy="navacd")
        assert result.report["navigable"]["intrusion"]["max"] == 0, name
        assert result.balls is not None
        scale = np.ptp(result.source.vertices, axis=0).max()
        assert intrusion(result) <= 1e-7 * scale, name
