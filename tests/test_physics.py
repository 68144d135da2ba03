"""`python -m benchmarks physics` and `piles`: what hulls within the threshold let happen, and one hull does not."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
import trimesh
from benchmarks import simulate
from benchmarks.engines import ENGINES, STEP
from benchmarks.piles import app
from benchmarks.tasks import TASKS, mesh_of
from click.testing import CliRunner

import rlacd
from tests.scripts import ROOT, script

pytest.importorskip("mujoco", reason="the extra sim is not installed")
pytest.importorskip("pybullet", reason="the extra sim is not installed")


def cup() -> trimesh.Trimesh:
    """A cup 0.2 m high, open at the top, with a hole of 8 cm through its bottom."""
    profile = [(0.04, 0.0), (0.07, 0.0), (0.07, 0.2), (0.06, 0.2), (0.06, 0.02), (0.04, 0.02), (0.04, 0.0)]
    return trimesh.creation.revolve(np.array(profile), sections=32)


@pytest.fixture(scope="module")
def decomposed() -> rlacd.Decomposition:
    return rlacd.decompose(cup(), quality="fast", threads=1)


@pytest.mark.slow
def test_balls_pass_the_hole_of_a_cup_and_rest_in_it_as_hulls_but_not_as_one(decomposed: rlacd.Decomposition) -> None:
    drops = simulate.drops_in_mujoco(decomposed)
    assert drops.holes >= 2  # along the axis, from above and from below
    assert drops.passed == drops.holes
    assert drops.rested == drops.hollows > 0
    one = simulate.drops_in_mujoco(rlacd.decompose(cup(), max_hulls=1, quality="fast", threads=1))
    assert (one.holes, one.hollows, one.passed, one.rested) == (drops.holes, drops.hollows, 0, 0)


def test_balls_fall_onto_a_box_as_far_as_geometry_says() -> None:
    """On a face, a ball stops one radius above it; beside an edge, it slides down the circle around the edge."""
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    radius = simulate.BALL * simulate.SIZE
    starts = np.array([[0.0, 0.0, 0.2], [0.1 + 0.8 * radius, 0.0, 0.2], [0.1 + 2 * radius, 0.0, 0.2]])
    traced = simulate.exact_depths(simulate.surface_of(box), starts, np.array([0.0, 0.0, -1.0]), 0.5)
    assert traced == pytest.approx([0.1 - radius, 0.1 - 0.6 * radius, 0.5], abs=5e-5)
    one = rlacd.decompose(box, quality="fast", threads=1)
    assert simulate._depths_in_mujoco(one, starts, 2, -1.0, 0.5) == pytest.approx(traced, abs=5e-5)


@pytest.mark.slow
def test_the_command_writes_a_page_with_hulls_beside_primitives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a box and a ball, both parts become primitives, in fewer bytes."""
    monkeypatch.setattr(simulate, "SECONDS", 0.05)
    monkeypatch.setattr(simulate, "COPIES", 4)
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "meshes" / "box.ply")
    trimesh.creation.icosphere(4).export(tmp_path / "meshes" / "ball.ply")
    given = [str(tmp_path / "meshes"), "--out", str(tmp_path / "run")]
    done = CliRunner().invoke(app, [*given, "--piles", "2", "--methods", "fast,fast:primitives=true"])
    assert done.exit_code == 0, done.output
    lines = (tmp_path / "run" / "piles.md").read_text().splitlines()
    cells = {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ")[1:] for line in lines if " | " in line}
    assert cells["parts; a mesh"] == ["2; 1.0", "2; 1.0"]
    assert cells["of these primitives"] == ["0", "2"]
    sizes = [int(cell.split(";")[0].replace(",", "")) for cell in cells["bytes; a mesh"]]
    assert sizes[1] < sizes[0]
    assert float(cells["steps/s"][0]) > 0
    assert cells["box.ply, fast:primitives=true"][0] == "1"
    wrong = CliRunner().invoke(app, [*given, "--methods", "slow"])
    assert wrong.exit_code == 2
    assert "there is no method 'slow'" in wrong.output


@pytest.mark.nightly
def test_the_mug_hangs_by_its_handle_and_its_one_hull_falls(tmp_path: Path) -> None:
    hulls, one = script(ROOT / "examples" / "mug.py").main(tmp_path, threads=1)
    assert hulls.held
    assert hulls.height > 0.2
    assert hulls.speed**2 / (2 * 9.81) < 0.01, "it may swing for minutes, but not so high that it gets off the peg"
    assert not one.held
    assert one.height < 0.06


# --- ten tasks --------------------------------------------------------------------------------------------------------


QUICK = ("ball into mug", "nut onto bolt", "gears that mesh")


@functools.cache
def hulls(name: str, one: bool) -> list[trimesh.Trimesh]:
    """As tight as a threshold of 0.02, or one."""
    mesh = mesh_of(name)
    return [mesh.convex_hull] if one else list(rlacd.decompose(mesh, threshold=0.02, quality="fast", threads=1))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "task", [pytest.param(t, marks=pytest.mark.slow if t in QUICK else pytest.mark.nightly) for t in TASKS]
)
def test_a_task_is_passed_with_tight_hulls_and_not_with_one_a_shape(task: str, engine: str) -> None:
    for one in (False, True):
        scene = TASKS[task]()
        names = {body.shape for body in scene.bodies if isinstance(body.shape, str)}
        exact = {name: mesh_of(name) for name in names}
        world = ENGINES[engine](scene, exact, {name: hulls(name, one) for name in names})
        for _ in range(round(scene.seconds / STEP)):
            world.step()
        if task != "pile of fifty" or not one:  # one hull a mug lies as still
            assert scene.passed(world) is not one
