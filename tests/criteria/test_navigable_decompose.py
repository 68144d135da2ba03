"""Navigable space from end to end: which hulls come out, what the report and the files say, bad input."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from manifold3d import Manifold, OpType

import rlacd
from rlacd.cli.main import app
from tests.hulls import assert_convex_hull
from tests.shapes import box, point_to_triangles


def mesh_of(solid: Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


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
    return mesh_of(Manifold.batch_boolean([walls, *furniture], OpType.Add))


def ell() -> trimesh.Trimesh:
    return mesh_of(box((0, 0, 0), (2, 0.4, 0.4)) + box((0, 0, 0), (0.4, 0.4, 2)))


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
    assert balls is not None
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


def test_every_room_counts_when_asked_for() -> None:
    space = rlacd.NavigableSpace(0.05, 0.01, reachable_only=False)
    result = rlacd.decompose(house(door=0), criterion=space)
    assert len(result) > 6
    assert intrusion(result) <= 1e-9


def test_a_door_wider_than_the_ball_opens_the_inside() -> None:
    space = rlacd.NavigableSpace(0.05, 0.01)  # a ball of radius 0.1 in a house of 2
    shut, opened = (rlacd.decompose(house(door), criterion=space) for door in (0.19, 0.21))
    assert fills(shut, AIR)
    assert not fills(opened, AIR)
    assert len(shut) < 6 < len(opened)
    assert intrusion(opened) <= 1e-9


def test_seeds_open_a_sealed_room() -> None:
    space = rlacd.NavigableSpace(0.05, 0.01, seeds=[AIR])
    assert len(rlacd.decompose(house(door=0), criterion=space)) > 6


@pytest.mark.slow
@pytest.mark.parametrize("ball", [0.9, 1.1])
@pytest.mark.promise("navigable")
def test_the_hole_of_a_torus_is_free_exactly_when_the_ball_fits(ball: float) -> None:
    torus = trimesh.creation.torus(0.75, 0.25, major_sections=96, minor_sections=64)  # a hole of radius 0.5
    size, tolerance = 2.0, 0.02
    result = rlacd.decompose(torus, criterion=rlacd.NavigableSpace((0.5 - tolerance) * ball / size, tolerance / size))
    assert result.balls is not None
    in_the_hole = np.linalg.norm(result.balls.centres, axis=1).min() < 0.27
    assert in_the_hole == (ball < 1)


@pytest.mark.slow
@pytest.mark.parametrize("ball", [0.98, 1.02])
def test_a_pipe_stays_open_exactly_when_the_ball_fits(ball: float) -> None:
    outside, inside = Manifold.cylinder(2, 0.4, 0.4, 48, True), Manifold.cylinder(3, 0.3, 0.3, 48, True)
    pipe = mesh_of((outside - inside).rotate((10, 20, 30)))
    space = rlacd.NavigableSpace(radius_abs=(0.3 - 0.02) * np.cos(np.pi / 48) * ball, tolerance_abs=0.02)
    result = rlacd.decompose(pipe, criterion=space)
    assert result.balls is not None
    a_ball_is_in_the_middle = bool((np.linalg.norm(result.balls.centres, axis=1) < result.balls.radii).any())
    assert a_ball_is_in_the_middle == (ball < 1)
    assert ball > 1 or not fills(result, (0.0, 0.0, 0.0))


def test_the_report_tells_of_the_balls() -> None:
    result = rlacd.decompose(ell(), criterion=rlacd.NavigableSpace(0.05, 0.02), policy="navacd")
    report = result.report
    space = report["navigable"]
    assert result.balls is not None
    assert space["balls"] == len(result.balls) > 0
    assert space["radius"] == pytest.approx(0.1)
    assert space["intrusion"]["max"] == 0
    assert len(space["intrusion"]["per_part"]) == len(result)
    assert "concavity" not in report
    assert report["options"]["criterion"]["radius"] == 0.05
    json.dumps(report, allow_nan=False)
    for hull in result:
        assert_convex_hull(hull)


def test_lengths_in_the_meshs_own_unit() -> None:
    mesh = ell()
    by_share = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(0.05, 0.02))
    mesh.apply_scale(1000)
    by_length = rlacd.decompose(mesh, criterion=rlacd.NavigableSpace(radius_abs=100.0, tolerance_abs=40.0))
    assert by_share.balls is not None
    assert by_length.balls is not None
    assert len(by_share) == len(by_length) == 2
    assert np.allclose(by_share.balls.centres * 1000, by_length.balls.centres, atol=1e-3)


@pytest.mark.slow
def test_max_hulls_gives_way_by_as_little_as_it_can() -> None:
    result = rlacd.decompose(house(door=0.5), criterion=rlacd.NavigableSpace(0.05, 0.01), max_hulls=4)
    assert len(result) <= 4
    assert result.report["navigable"]["intrusion"]["max"] > 0
    assert any("ball" in warning for warning in result.report["warnings"])


def test_the_same_bytes_for_any_number_of_threads(tmp_path: Path) -> None:
    space = rlacd.NavigableSpace(0.04, 0.02)
    for threads in (1, 3):
        result = rlacd.decompose(house(door=0.5), criterion=space, threads=threads)
        result.save(tmp_path / f"{threads}.obj")
        result.save_balls(tmp_path / f"{threads}.csv")
    assert (tmp_path / "1.obj").read_bytes() == (tmp_path / "3.obj").read_bytes()
    assert (tmp_path / "1.csv").read_bytes() == (tmp_path / "3.csv").read_bytes()


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


@pytest.mark.slow
def test_balanced_is_not_worse_than_one_pass_where_balls_decide() -> None:
    space = rlacd.NavigableSpace(0.05, 0.01)
    for mesh in (bumpy_ball(), house(door=0.5)):
        fast, balanced = (rlacd.decompose(mesh, criterion=space, quality=name) for name in ("fast", "balanced"))
        assert len(balanced) <= len(fast)


def test_time_that_runs_out_while_parts_are_divided_leaves_valid_hulls() -> None:
    def stop(progress: rlacd.Progress) -> bool:
        return progress.stage != "search"

    space = rlacd.NavigableSpace(0.1, 0.02)
    result = rlacd.decompose(bumpy_ball(), criterion=space, quality="fast", progress=stop)
    assert result.report["stopped_by"] == "cancel"
    assert any("those found so far are valid" in warning for warning in result.report["warnings"])
    assert intrusion(result) < 1e-6


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


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--radius", "0.05"], "--radius needs --criterion navigable"),
        (["--everywhere"], "--everywhere needs --criterion navigable"),
        (["--balls", "b.csv"], "--balls needs --criterion navigable"),
        (["--criterion", "navigable", "-t", "0.1"], "has radius and tolerance instead"),
        (["--criterion", "navigable", "--radius", "0"], "radius"),
        (["--criterion", "navigable", "--tolerance", "-1"], "tolerance"),
        (["--criterion", "navigable", "--seed-point", "1,2"], "--seed-point is '1,2'; it takes 3 numbers"),
        (["--criterion", "navigable", "--seed-point", "0.2,0.2,0.2"], "inside"),
        (["--criterion", "navigable", "--closed-plane", "0,0,0,1"], "normal"),
        (["--criterion", "navigable", "--balls", "b.txt"], ".csv or .glb"),
    ],
)
def test_bad_options_are_one_sentence(mesh: Path, tmp_path: Path, words: list[str], sentence: str) -> None:
    done = run("decompose", mesh, "-o", tmp_path / "out.glb", *words)
    assert done.exit_code in (2, 3)
    assert sentence in " ".join(done.stderr.split())
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out.glb").exists()


def test_a_ball_larger_than_the_object_gives_one_hull() -> None:
    result = rlacd.decompose(ell(), criterion=rlacd.NavigableSpace(1.5, 0.01))
    assert len(result) == 1
    assert any("larger" in warning for warning in result.report["warnings"])


@pytest.mark.slow
def test_an_open_mesh_says_what_was_measured_to() -> None:
    bowl = mesh_of(Manifold.sphere(1, 32).trim_by_plane((0, 0, -1), 0))
    bowl.update_faces(bowl.triangles_center[:, 2] < -1e-9)
    result = rlacd.decompose(bowl, criterion=rlacd.NavigableSpace(0.05, 0.02))
    assert any("open" in warning for warning in result.report["warnings"])


@pytest.mark.parametrize(
    "make",
    [
        lambda: rlacd.NavigableSpace(0, 0.01),
        lambda: rlacd.NavigableSpace(0.05, float("nan")),
        lambda: rlacd.NavigableSpace(0.05, 0.01, seeds=[(1, 2)]),
        lambda: rlacd.NavigableSpace(0.05, 0.01, closed_planes=[((0, 0, 0), 1)]),
        lambda: rlacd.decompose(ell(), criterion="balls"),
        lambda: rlacd.decompose(ell(), criterion=rlacd.NavigableSpace(), threshold=0.1),
    ],
)
def test_bad_spaces_are_refused(make: Callable[[], Any]) -> None:
    with pytest.raises(rlacd.OptionError):
        make()


@pytest.mark.nightly
@pytest.mark.promise("navigable")
def test_no_hull_overlaps_a_final_ball_on_real_meshes(corpus: Path) -> None:
    for name in (corpus / "quick.txt").read_text().split()[::4]:
        result = rlacd.decompose(corpus / name, criterion=rlacd.NavigableSpace(0.05, 0.01), policy="navacd")
        assert result.report["navigable"]["intrusion"]["max"] == 0, name
        assert result.balls is not None
        scale = np.ptp(result.source.vertices, axis=0).max()
        assert intrusion(result) <= 1e-7 * scale, name
