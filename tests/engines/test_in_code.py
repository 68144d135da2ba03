"""Programs that build models get hulls from `rlacd.engines`; programs that call CoACD get them from `rlacd.compat`.

Engines that are not in the project's own environment are asked by ``make engines``, in theirs.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.compat import coacd
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from tests.models import table

MASS = 3.0
"""Of the body, before and after it gets hulls."""

DROP, SECONDS, STEP = 0.02, 1.0, 1 / 500


class Fallen(NamedTuple):
    """What an engine says of a body: its mass, the corners of its hulls, and its height and speed after a fall."""

    mass: float
    corners: list[int]
    height: float
    speed: float


def moments(result: Decomposition) -> tuple[Any, Any, list[float]]:
    """The centre and inertia of a body as heavy as it should be; the inertia also as its diagonal and xy, xz, yz."""
    mass = result.report.mass
    inertia = MASS / mass.volume_abs * np.array(mass.inertia_abs)
    return np.array(mass.centre_abs), inertia, [*np.diag(inertia), *inertia[np.triu_indices(3, 1)]]


def in_mujoco(weighed: Decomposition, mesh: Any, options: dict[str, Any]) -> Fallen:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    from rlacd.engines.mujoco import add_hulls

    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    centre, _, six = moments(weighed)
    full = {"mass": MASS, "ipos": centre, "fullinertia": six, "explicitinertial": True}
    body = spec.worldbody.add_body(name="table", pos=[0, 0, DROP], **full)
    body.add_freejoint()
    add_hulls(spec, body, mesh, **options)
    add_hulls(spec, spec.worldbody.add_body(name="table2", pos=[2, 0, 0]), weighed, settings={"contype": 0})
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(round(SECONDS / STEP)):
        mujoco.mj_step(model, data)
    geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 1]
    corners = [int(model.mesh_graph[model.mesh_graphadr[model.geom_dataid[geom]]]) for geom in geoms]
    return Fallen(model.body_mass[1], corners, data.qpos[2], np.abs(data.qvel).max())


def in_drake(weighed: Decomposition, mesh: Any, options: dict[str, Any]) -> Fallen:
    pytest.importorskip("pydrake", reason="drake is not installed")
    import pydrake.all as drake

    from rlacd.engines.drake import add_hulls

    builder = drake.DiagramBuilder()
    plant, scene = drake.AddMultibodyPlantSceneGraph(builder, STEP)
    rubber = drake.CoulombFriction(0.9, 0.9)
    plant.RegisterCollisionGeometry(plant.world_body(), drake.RigidTransform(), drake.HalfSpace(), "floor", rubber)
    centre, _, six = moments(weighed)
    inertia = drake.SpatialInertia.MakeFromCentralInertia(MASS, centre, drake.RotationalInertia(*six))
    body = plant.AddRigidBody("table", inertia)
    add_hulls(plant, body, mesh, settings=rubber, **options)
    plant.Finalize()
    diagram = builder.Build()
    simulator = drake.Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetFreeBodyPose(context, body, drake.RigidTransform([0, 0, DROP]))
    simulator.AdvanceTo(SECONDS)
    hulls = [scene.model_inspector().GetConvexHull(each) for each in plant.GetCollisionGeometriesForBody(body)]
    height = plant.EvalBodyPoseInWorld(context, body).translation()[2]
    speed = np.abs(plant.GetVelocities(context)).max()
    return Fallen(body.default_mass(), [hull.num_vertices() for hull in hulls], height, speed)


def in_newton(weighed: Decomposition, mesh: Any, options: dict[str, Any]) -> Fallen:
    newton = pytest.importorskip("newton", reason="newton is not installed (make engines)")
    import warp

    from rlacd.engines.newton import add_hulls

    warp.set_device("cpu")
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    centre, inertia, _ = moments(weighed)
    place = warp.transform((0, 0, DROP), warp.quat_identity())
    body = builder.add_body(xform=place, mass=MASS, com=centre, inertia=warp.mat33(inertia))
    add_hulls(builder, body, mesh, **options)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    now, then, control = model.state(), model.state(), model.control()
    for _ in range(round(SECONDS / STEP)):
        solver.step(now, then, control, None, STEP)
        now, then = then, now
    kinds = zip(builder.shape_source, builder.shape_type, strict=True)
    hulls = [source for source, kind in kinds if kind == newton.GeoType.CONVEX_MESH]
    corners = [min(len(hull.vertices), hull.maxhullvert) for hull in hulls]
    height, speed = now.body_q.numpy()[0][2], np.abs(now.body_qd.numpy()).max()
    return Fallen(builder.body_mass[body], corners, height, speed)


@pytest.mark.parametrize(
    "engine", [in_mujoco, in_drake, pytest.param(in_newton, marks=pytest.mark.nightly)], ids=lambda each: each.__name__
)
@pytest.mark.parametrize("is_decomposed", [False, True])
def test_a_body_gets_hulls_keeps_its_mass_falls_and_rests(engine: Callable[..., Fallen], is_decomposed: bool) -> None:
    options = {"threads": 1, "quality": "fast"}
    result = rlacd.decompose(table(), **options)
    mesh, given = (result, {}) if is_decomposed else (table(), options)
    fallen = engine(result, mesh, given)
    assert fallen.mass == pytest.approx(MASS)
    assert fallen.corners == [len(hull.vertices) for hull in result]
    assert fallen.height == pytest.approx(0.0, abs=0.002)
    assert fallen.speed < 0.01
    if is_decomposed:
        with pytest.raises(OptionError, match="threads"):
            engine(result, result, options)


def newton_takes(mesh: trimesh.Trimesh, folder: Path) -> list[Any]:
    newton = pytest.importorskip("newton", reason="newton is not installed (make engines)")
    builder = newton.ModelBuilder()
    builder.add_shape_mesh(builder.add_body(), mesh=newton.Mesh(mesh.vertices, mesh.faces.ravel()))
    builder.approximate_meshes("coacd")
    return [shape.vertices for shape in builder.shape_source]


def genesis_takes(mesh: trimesh.Trimesh, folder: Path) -> list[Any]:
    genesis = pytest.importorskip("genesis", reason="genesis is not installed (make engines)")
    from genesis.options import CoacdOptions
    from genesis.utils.mesh import convex_decompose

    genesis.init(backend=genesis.cpu, logging_level="error")
    return [hull.vertices for hull in convex_decompose(mesh, CoacdOptions())]


def obj2mjcf_takes(mesh: trimesh.Trimesh, folder: Path) -> list[Any]:
    command = pytest.importorskip("obj2mjcf.cli", reason="obj2mjcf is not installed (make engines)")
    mesh.export(folder / "table.obj")
    command.process_obj(folder / "table.obj", command.Args(str(folder), decompose=True, save_mjcf=True, overwrite=True))
    return [trimesh.load_mesh(file).vertices for file in sorted((folder / "table").glob("*_collision_*.obj"))]


def scikit_robot_takes(mesh: trimesh.Trimesh, folder: Path) -> list[Any]:
    module = pytest.importorskip("skrobot.utils.convex_decomposition", reason="scikit-robot is not installed")
    return [hull.vertices for hull in module.convex_decomposition(mesh)]


@pytest.mark.nightly
@pytest.mark.parametrize("takes", [newton_takes, genesis_takes, obj2mjcf_takes, scikit_robot_takes])
def test_what_calls_coacd_takes_hulls_of_rlacd_in_its_place(
    takes: Callable[..., list[Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, original = [], coacd.run_coacd

    @functools.wraps(original)
    def run_coacd(*args: Any, **kwargs: Any) -> Any:
        calls.append(original(*args, **kwargs))
        return calls[-1]

    monkeypatch.setattr(coacd, "run_coacd", run_coacd)
    monkeypatch.setitem(sys.modules, "coacd", coacd)
    monkeypatch.setenv("GS_CACHE_FILE_PATH", str(tmp_path))  # Genesis keeps hulls for later runs
    found = takes(table(), tmp_path)
    (ours,) = calls
    assert len(found) == len(ours) > 1
    for points, (vertices, _) in zip(found, ours, strict=True):
        assert np.sort(points, axis=0) == pytest.approx(np.sort(vertices, axis=0), abs=1e-6)
