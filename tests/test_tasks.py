"""`python -m benchmarks physics`: hulls within the threshold do what its tasks ask for, one hull a shape does not."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import trimesh
from benchmarks.engines import ENGINES, STEP
from benchmarks.tasks import SHAPES, TASKS, mesh_of

import rlacd

pytest.importorskip("mujoco", reason="the extra sim is not installed")
pytest.importorskip("pybullet", reason="the extra sim is not installed")

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


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_single_closed_bodies(name: str) -> None:
    mesh = mesh_of(name)
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert np.prod(mesh.extents) > mesh.volume > 0


@pytest.mark.parametrize("engine", ENGINES)
def test_both_engines_place_and_read_bodies_alike(engine: str) -> None:
    scene = TASKS["gripper lifts plate"]()
    exact = {name: mesh_of(name) for name in ("plate", "jaw")}
    world = ENGINES[engine](scene, exact, {name: hulls(name, True) for name in exact})
    for index, body in enumerate(scene.bodies):
        assert world.place(index)[:3, 3] == pytest.approx(body.at, abs=1e-6)
        assert world.place(index)[:3, :3] == pytest.approx(
            trimesh.transformations.quaternion_matrix(body.turn)[:3, :3], abs=1e-6
        )
    assert [values.tolist() for values in world.joints(2)] == [[0.0, 0.0], [0.0, 0.0]]
