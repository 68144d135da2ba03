"""Newton: USD, solved by MuJoCo Warp on the processor."""

import newton
import warp
from harness import STEP, kept, run, state

warp.config.quiet = True
warp.set_device("cpu")


def builder_of(file):
    builder = newton.ModelBuilder()
    builder.add_usd(file)
    return builder


def take(file):
    builder = builder_of(file)
    said = []
    for index, (kind, flags) in enumerate(zip(builder.shape_type, builder.shape_flags, strict=True)):
        if flags & newton.ShapeFlags.COLLIDE_SHAPES:
            assert kind == newton.GeoType.CONVEX_MESH, kind
            mesh = builder.shape_source[index]
            said.append(kept(mesh.vertices, mesh.indices, builder.body_mass[0]))
    return said


def fall(file, starts, steps):
    many = newton.ModelBuilder()
    many.add_ground_plane()
    body = builder_of(file)
    for start in starts:
        many.add_builder(body, xform=warp.transform(start, warp.quat_identity()))
    model = many.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=False, njmax=2000, nconmax=2000)
    now, then = model.state(), model.state()
    newton.eval_fk(model, model.joint_q, model.joint_qd, now)
    control = model.control()
    for _ in range(steps):
        now.clear_forces()
        solver.step(now, then, control, None, STEP)
        now, then = then, now
    moving = zip(now.body_q.numpy(), now.body_qd.numpy(), strict=True)
    return [state(pose[:3], pose[3:], speed[:3], speed[3:]) for pose, speed in moving]


run("Newton", "newton", take, fall)
