"""SAPIEN, whose physics is PhysX: URDF."""

import sapien
from harness import STEP, kept, run, state


def scene():
    made = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    made.set_timestep(STEP)
    made.add_ground(0, render=False)
    return made


def bodies_of(file, here, starts):
    loader = here.create_urdf_loader()
    bodies = []
    for start in starts:
        _, (builder,), _ = loader.parse(file)  # a link without joints is an actor
        builder.visual_records.clear()  # to see them takes a graphics card
        body = builder.build()
        body.set_pose(sapien.Pose(start))
        bodies.append(body)
    return bodies


def take(file):
    (body,) = bodies_of(file, scene(), [[0, 0, 0]])
    component = body.find_component_by_type(sapien.physx.PhysxRigidDynamicComponent)
    return [kept(shape.vertices, shape.triangles, component.mass) for shape in component.collision_shapes]


def fall(file, starts, steps):
    here = scene()
    bodies = bodies_of(file, here, starts)
    for _ in range(steps):
        here.step()
    said = []
    for body in bodies:
        component = body.find_component_by_type(sapien.physx.PhysxRigidDynamicComponent)
        w, x, y, z = body.pose.q
        said.append(state(body.pose.p, [x, y, z, w], component.linear_velocity, component.angular_velocity))
    return said


run("SAPIEN", "sapien", take, fall)
