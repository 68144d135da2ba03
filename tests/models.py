"""Bodies to write as models, and what each simulator says of them after a fall on a plane."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.decomposition import Decomposition

DROP = 0.05
"""How far bodies fall, metres."""


@dataclass(frozen=True)
class Rest:
    """Where a body came to rest, and how: the height of its lowest point, its speed, mass, and number of hulls."""

    lowest: float
    speed: float
    mass: float
    hulls: int


def table() -> trimesh.Trimesh:
    """A top and four legs in one piece, standing on z = 0: 0.4 by 0.3 by 0.2 m."""
    import manifold3d

    solid = manifold3d.Manifold.cube((0.4, 0.3, 0.02)).translate((0.0, 0.0, 0.18))
    for x in (0.0, 0.37):
        for y in (0.0, 0.27):
            solid += manifold3d.Manifold.cube((0.03, 0.03, 0.18)).translate((x, y, 0.0))
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


TABLE_VOLUME = 0.4 * 0.3 * 0.02 + 4 * 0.03 * 0.03 * 0.18


def decomposed_table() -> Decomposition:
    return rlacd.decompose(table(), threads=1)


def mujoco_model(path: Path) -> Any:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    return mujoco.MjModel.from_xml_path(str(path))


def points_of_geom(model: Any, data: Any, geom: int) -> Any:
    """Where the corners of a geom's mesh lie in the world."""
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def fall_in_mujoco(path: Path, seconds: float = 1.5) -> Rest:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], pos=[0, 0, -DROP])
    model = spec.compile()
    data = mujoco.MjData(model)
    body = 1
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_contype[g]]
    return Rest(
        min(_lowest_in_mujoco(model, data, geom) for geom in geoms) + DROP,
        float(np.abs(data.qvel).max()),
        float(model.body_mass[body]),
        len(geoms),
    )


def _lowest_in_mujoco(model: Any, data: Any, geom: int) -> float:
    import mujoco

    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        return float(data.geom_xpos[geom, 2] - np.abs(data.geom_xmat[geom].reshape(3, 3)[2]) @ model.geom_size[geom])
    return float(points_of_geom(model, data, geom)[:, 2].min())


def fall_in_bullet(path: Path, seconds: float = 1.5) -> Rest:
    bullet = pytest.importorskip("pybullet", reason="the extra sim is not installed")
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0, 0, -9.81, physicsClientId=client)
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        bullet.createMultiBody(0, plane, basePosition=[0, 0, -DROP], physicsClientId=client)
        body = bullet.loadURDF(str(path), physicsClientId=client)
        for _ in range(round(seconds * 240)):
            bullet.stepSimulation(physicsClientId=client)
        linear, angular = bullet.getBaseVelocity(body, physicsClientId=client)
        contacts = bullet.getContactPoints(bodyA=body, physicsClientId=client)
        return Rest(
            max((contact[8] for contact in contacts), default=np.inf),  # the distance between the surfaces
            float(np.abs([linear, angular]).max()),
            float(bullet.getDynamicsInfo(body, -1, physicsClientId=client)[0]),
            len(bullet.getCollisionShapeData(body, -1, physicsClientId=client)),
        )
    finally:
        bullet.disconnect(client)


def fall_in_drake(path: Path, seconds: float = 1.0) -> Rest:
    pytest.importorskip("pydrake", reason="drake is not installed")
    from pydrake.geometry import HalfSpace
    from pydrake.math import RigidTransform
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.001)
    (instance,) = Parser(plant).AddModels(str(path))
    ground = RigidTransform([0, 0, -DROP])
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "ground", CoulombFriction(0.8, 0.8))
    plant.Finalize()
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(seconds)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    (index,) = plant.GetBodyIndices(instance)
    body = plant.get_body(index)
    velocity = plant.EvalBodySpatialVelocityInWorld(context, body).get_coeffs()
    height = plant.EvalBodyPoseInWorld(context, body).translation()[2]
    return Rest(
        float(height) + DROP,  # for bodies whose lowest point is their origin's height
        float(np.abs(velocity).max()),
        float(body.default_mass()),
        len(plant.GetCollisionGeometriesForBody(body)),
    )


FALLS = [(fall_in_mujoco, "xml"), (fall_in_bullet, "urdf"), (fall_in_drake, "sdf"), (fall_in_drake, "urdf")]


def assert_stands(rest: Rest, result: Decomposition, density: float = 1000.0) -> None:
    """The table stands on its legs: it weighs what it should, every hull counts, and it neither sinks nor creeps."""
    assert rest.mass == pytest.approx(TABLE_VOLUME * density, rel=1e-6)
    assert rest.hulls == len(result)
    assert abs(rest.lowest) < 2e-3
    assert rest.speed < 1e-2


def inside(hulls: list[trimesh.Trimesh], points: np.ndarray, slack: float) -> np.ndarray:
    """Whether each point lies in one of the hulls, or no farther than `slack` from it."""
    each = []
    for hull in hulls:
        heights = (points @ hull.face_normals.T) - (hull.triangles[:, 0] * hull.face_normals).sum(axis=1)
        each.append(heights.max(axis=1) <= slack)
    return np.any(each, axis=0)
