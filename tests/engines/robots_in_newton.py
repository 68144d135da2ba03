"""Newton: USD stages of robots, before and after, and where the latter rest when their joints are held.

Gets a JSON file with pairs of stages; writes for each what it says of both.
"""

import json
import sys
from pathlib import Path

import newton
import numpy as np
import warp

STEP, SECONDS = 1 / 500, 3.0
STIFF, DAMPED = 2000.0, 200.0  # of all joints, N·m/rad and N·m·s/rad

warp.config.quiet = True
warp.set_device("cpu")


def builder_of(file, **how):
    builder = newton.ModelBuilder()
    builder.add_usd(file, **how)
    return builder


def said_of(builder):
    kinds = [kind for kind, flags in zip(builder.shape_type, builder.shape_flags, strict=True) if flags & COLLIDES]
    convex = [int(kind) for kind in kinds if kind == newton.GeoType.CONVEX_MESH]
    inertia = [np.linalg.eigvalsh(np.reshape(each, (3, 3))).tolist() for each in builder.body_inertia]
    masses = dict(zip(builder.body_label, map(float, builder.body_mass), strict=True))
    return {"masses": masses, "inertia": inertia, "shapes": len(kinds), "convex": len(convex)}


COLLIDES = newton.ShapeFlags.COLLIDE_SHAPES


def rest(file):
    many = newton.ModelBuilder()
    many.add_ground_plane()
    free = builder_of(file, ignore_paths=[".*/(root|world)_joint"])  # of the base and the world
    many.add_builder(free, xform=warp.transform((0, 0, 1.0), warp.quat_identity()))
    count = len(many.joint_target_ke)
    inner = slice(6, count)  # without those of the base
    many.joint_target_mode[inner] = [int(newton.JointTargetMode.POSITION)] * (count - 6)
    many.joint_target_ke[inner], many.joint_target_kd[inner] = [STIFF] * (count - 6), [DAMPED] * (count - 6)
    model = many.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True, njmax=4000, nconmax=4000)
    now, then, control = model.state(), model.state(), model.control()
    for _ in range(round(SECONDS / STEP)):
        solver.step(now, then, control, None, STEP)
        now, then = then, now
    return {"speed": float(np.abs(now.body_qd.numpy()).max())}


answers = []
for before, after in json.loads(Path(sys.argv[1]).read_text()):
    answers.append({"before": said_of(builder_of(before)), "after": {**said_of(builder_of(after)), **rest(after)}})
    Path(sys.argv[2]).write_text(json.dumps(answers))
