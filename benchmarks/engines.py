"""A scene of `benchmarks.tasks` in MuJoCo and in PyBullet: same hulls, masses, friction and steps."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import trimesh

from benchmarks.simulate import get_mujoco
from benchmarks.tasks import Body, Scene, World
from rlacd.solid.arrays import FloatArray

STEP, FRICTION = 0.002, 0.6

UNITS = 10.0
"""Bullet's units in a metre: it puts a skin of 0.001 around each hull."""

Hulls: TypeAlias = Mapping[str, Sequence[trimesh.Trimesh]]


@dataclass(frozen=True)
class Mass:
    """Centre [3] and moments of inertia [3] of a shape: those of the exact mesh, whichever hulls collide."""

    centre: FloatArray
    moments: FloatArray

    def place(self, body: Body) -> FloatArray:
        """Where the centre [3] is at first."""
        turned: FloatArray = trimesh.transformations.quaternion_matrix(body.turn)[:3, :3] @ self.centre
        return np.asarray(body.at) + turned


def mass_of(body: Body, exact: Mapping[str, trimesh.Trimesh]) -> Mass:
    """Of a body, from its mass and shape."""
    if isinstance(body.shape, str):
        mesh = exact[body.shape]
        return Mass(np.asarray(mesh.center_mass), np.diag(mesh.moment_inertia) * body.mass / mesh.volume)
    sides = np.array([body.shape] * 3 if isinstance(body.shape, float) else body.shape)
    if isinstance(body.shape, float):
        return Mass(np.zeros(3), 0.4 * body.mass * sides**2)
    return Mass(np.zeros(3), body.mass / 12 * ((sides**2).sum() - sides**2))


def placed(position: FloatArray, rotation: FloatArray, centre: FloatArray) -> FloatArray:
    """The frame [4, 4] of a shape whose centre of mass is somewhere."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, position - rotation @ centre
    return frame


class Engine(World):
    """What both have: bodies that are pulled to where they have to be."""

    def __init__(self, scene: Scene, exact: Mapping[str, trimesh.Trimesh]) -> None:
        self.scene, self.masses, self.time = scene, [mass_of(body, exact) for body in scene.bodies], 0.0

    def _forces(self) -> list[tuple[int, FloatArray]]:
        found = []
        for index, body in enumerate(self.scene.bodies):
            if body.target is not None:
                there, speed = self.joints(index)
                found.append(
                    (index, np.asarray(body.pull) * (np.asarray(body.target(self.time)) - there - 0.05 * speed))
                )
        return found


class InMujoco(Engine):
    """In MuJoCo, at its defaults."""

    def __init__(self, scene: Scene, exact: Mapping[str, trimesh.Trimesh], hulls: Hulls) -> None:
        super().__init__(scene, exact)
        self.mujoco = mujoco = get_mujoco()
        self.contact: dict[str, Any] = {"friction": [FRICTION, 0.005, 0.0001]}
        self.spec = spec = mujoco.MjSpec()
        spec.option.timestep = STEP
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], **self.contact)
        for name in {body.shape for body in scene.bodies if isinstance(body.shape, str)}:
            for index, hull in enumerate(hulls[name]):
                vertices = (hull.vertices - exact[name].center_mass).ravel()
                spec.add_mesh(name=f"{name}{index}", uservert=vertices.tolist(), userface=hull.faces.ravel().tolist())
        for index, body in enumerate(scene.bodies):
            self._add(index, body, hulls)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def _add(self, index: int, body: Body, hulls: Hulls) -> None:
        mujoco, mass = self.mujoco, self.masses[index]
        made = self.spec.worldbody.add_body(quat=list(body.turn), explicitinertial=True, mass=body.mass)
        made.inertia = mass.moments.tolist()
        made.pos = mass.place(body).tolist()
        kinds = {"slide": mujoco.mjtJoint.mjJNT_SLIDE, "hinge": mujoco.mjtJoint.mjJNT_HINGE}
        for kind, axis in body.moves or ():
            made.add_joint(type=kinds[kind], axis=list(axis))
        if body.moves is None:
            made.add_freejoint()
        if isinstance(body.shape, str):
            for each in range(len(hulls[body.shape])):
                made.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{body.shape}{each}", **self.contact)
        elif isinstance(body.shape, float):
            made.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[body.shape, 0, 0], **self.contact)
        else:
            made.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[side / 2 for side in body.shape], **self.contact)

    def step(self) -> float:
        self.data.xfrc_applied[:] = self.data.qfrc_applied[:] = 0
        for index, force in self._forces():
            if self.scene.bodies[index].moves is None:
                self.data.xfrc_applied[1 + index, :3] = force
            else:
                first = self.model.body_dofadr[1 + index]
                self.data.qfrc_applied[first : first + len(force)] = force
        self.mujoco.mj_step(self.model, self.data)
        self.time += STEP
        return -min(0.0, float(self.data.contact.dist.min())) if self.data.ncon else 0.0

    def place(self, body: int) -> FloatArray:
        rotation = self.data.xmat[1 + body].reshape(3, 3)
        return placed(self.data.xpos[1 + body], rotation, self.masses[body].centre)

    def joints(self, body: int) -> tuple[FloatArray, FloatArray]:
        model, first = self.model, self.model.body_dofadr[1 + body]
        if self.scene.bodies[body].moves is None:
            return self.place(body)[:3, 3], np.array(self.data.qvel[first : first + 3])
        many, start = model.body_dofnum[1 + body], model.jnt_qposadr[model.body_jntadr[1 + body]]
        return np.array(self.data.qpos[start : start + many]), np.array(self.data.qvel[first : first + many])


class InBullet(Engine):
    """In PyBullet, at its defaults, in decimetres."""

    def __init__(self, scene: Scene, exact: Mapping[str, trimesh.Trimesh], hulls: Hulls) -> None:
        super().__init__(scene, exact)
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        self.client = client = BulletClient(pybullet.DIRECT)
        client.setGravity(0, 0, -9.81 * UNITS)
        client.setTimeStep(STEP)
        client.changeDynamics(
            client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE)), -1, lateralFriction=FRICTION
        )
        self.shapes: dict[object, int] = {}
        with tempfile.TemporaryDirectory(prefix="rlacd-") as folder:
            for body in scene.bodies:
                if body.shape not in self.shapes:
                    self.shapes[body.shape] = self._shape(body, exact, hulls, Path(folder))
        self.bodies = [self._add(body, mass) for body, mass in zip(scene.bodies, self.masses, strict=True)]

    def _shape(self, body: Body, exact: Mapping[str, trimesh.Trimesh], hulls: Hulls, folder: Path) -> int:
        client, shape = self.client, body.shape
        if isinstance(shape, str):
            path, first, lines = folder / f"{shape}.obj", 1, []
            for index, hull in enumerate(hulls[shape]):
                lines.append(f"o hull{index}")
                lines += [
                    "v {:.9g} {:.9g} {:.9g}".format(*at) for at in UNITS * (hull.vertices - exact[shape].center_mass)
                ]
                lines += ["f {} {} {}".format(*face) for face in hull.faces + first]
                first += len(hull.vertices)
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
            found = client.createCollisionShape(client.GEOM_MESH, fileName=str(path))
        elif isinstance(shape, float):
            found = client.createCollisionShape(client.GEOM_SPHERE, radius=UNITS * shape)
        else:
            found = client.createCollisionShape(client.GEOM_BOX, halfExtents=[UNITS * side / 2 for side in shape])
        return int(found)

    def _add(self, body: Body, mass: Mass) -> int:
        client, shape = self.client, self.shapes[body.shape]
        centre, turn = (UNITS * mass.place(body)).tolist(), [*body.turn[1:], body.turn[0]]
        if body.moves:
            made = self._jointed(body, shape, centre, turn)
        else:
            made = client.createMultiBody(body.mass if body.moves is None else 0.0, shape, -1, centre, turn)
        last = client.getNumJoints(made) - 1
        client.changeDynamics(made, last, lateralFriction=FRICTION)
        if body.moves is None or body.moves:
            client.changeDynamics(made, last, localInertiaDiagonal=(UNITS**2 * mass.moments).tolist())
        return int(made)

    def _jointed(self, body: Body, shape: int, centre: Sequence[float], turn: Sequence[float]) -> int:
        """A chain of light links, the last of which has the shape."""
        client, moves = self.client, body.moves or ()
        kinds = {"slide": client.JOINT_PRISMATIC, "hinge": client.JOINT_REVOLUTE}
        many, still = len(moves), {"Positions": [0, 0, 0], "Orientations": [0, 0, 0, 1]}
        still |= {f"InertialFrame{name}": value for name, value in still.items()}
        made = client.createMultiBody(
            *(0, -1, -1, centre, turn),
            linkMasses=[0.001] * (many - 1) + [body.mass],
            linkCollisionShapeIndices=[-1] * (many - 1) + [shape],
            linkVisualShapeIndices=[-1] * many,
            linkParentIndices=list(range(many)),
            linkJointTypes=[kinds[kind] for kind, _ in moves],
            linkJointAxis=[list(axis) for _, axis in moves],
            **{f"link{name}": [value] * many for name, value in still.items()},
        )
        for joint in range(many):  # without the motor that brakes it by default
            client.setJointMotorControl2(made, joint, client.VELOCITY_CONTROL, force=0)
        return int(made)

    def step(self) -> float:
        client = self.client
        for index, force in self._forces():
            made = self.bodies[index]
            if self.scene.bodies[index].moves is None:
                at, _ = client.getBasePositionAndOrientation(made)
                client.applyExternalForce(made, -1, (UNITS * force).tolist(), at, client.WORLD_FRAME)
            else:
                for joint, newtons in enumerate(force * UNITS**2 / self._lengths(index)):
                    client.setJointMotorControl2(made, joint, client.TORQUE_CONTROL, force=newtons)
        client.stepSimulation()
        self.time += STEP
        return -min((contact[8] for contact in client.getContactPoints()), default=0.0) / UNITS

    def place(self, body: int) -> FloatArray:
        client, made = self.client, self.bodies[body]
        last = client.getNumJoints(made) - 1
        pose = client.getBasePositionAndOrientation(made) if last < 0 else client.getLinkState(made, last)[:2]
        rotation = np.reshape(client.getMatrixFromQuaternion(pose[1]), (3, 3))
        return placed(np.array(pose[0]) / UNITS, rotation, self.masses[body].centre)

    def joints(self, body: int) -> tuple[FloatArray, FloatArray]:
        client, made = self.client, self.bodies[body]
        if self.scene.bodies[body].moves is None:
            return self.place(body)[:3, 3], np.array(client.getBaseVelocity(made)[0]) / UNITS
        states = client.getJointStates(made, range(client.getNumJoints(made)))
        found = np.array([state[:2] for state in states]).T / self._lengths(body)
        return found[0], found[1]

    def _lengths(self, body: int) -> FloatArray:
        """Bullet's unit of each joint's position, a metre or a radian."""
        return np.array([UNITS if kind == "slide" else 1.0 for kind, _ in self.scene.bodies[body].moves or ()])


ENGINES: dict[str, type[InMujoco] | type[InBullet]] = {"MuJoCo": InMujoco, "PyBullet": InBullet}
