"""Bullet: URDF."""

import pybullet
from harness import GRAVITY, STEP, run, state

pybullet.connect(pybullet.DIRECT)


def take(file):
    body = pybullet.loadURDF(file, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    shapes = pybullet.getCollisionShapeData(body, -1)
    mass = pybullet.getDynamicsInfo(body, -1)[0]
    return [{"mass": mass, "is_mesh": shape[2] == pybullet.GEOM_MESH} for shape in shapes]


def fall(file, starts, steps):
    pybullet.resetSimulation()
    pybullet.setGravity(0, 0, GRAVITY)
    pybullet.setTimeStep(STEP)
    floor = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[20, 20, 1])
    pybullet.createMultiBody(0, floor, basePosition=[0, 0, -1])
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    bodies = [pybullet.loadURDF(file, flags=flags) for _ in starts]
    for body, start in zip(bodies, starts, strict=True):
        centre = pybullet.getDynamicsInfo(body, -1)[3]
        pybullet.resetBasePositionAndOrientation(
            body, [a + b for a, b in zip(start, centre, strict=True)], [0, 0, 0, 1]
        )
    for _ in range(steps):
        pybullet.stepSimulation()
    return [placed(body) for body in bodies]


def placed(body):
    """Bullet gives the pose of the centre of mass."""
    inertial = pybullet.invertTransform(*pybullet.getDynamicsInfo(body, -1)[3:5])
    place = pybullet.multiplyTransforms(*pybullet.getBasePositionAndOrientation(body), *inertial)
    return state(*place, *pybullet.getBaseVelocity(body))


run("Bullet", "pybullet", take, fall)
