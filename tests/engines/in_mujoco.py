"""MuJoCo: MJCF; with the argument "mjx" or "warp" its other two engines, on the processor."""

import os
import sys

import mujoco
import numpy as np
from harness import STEP, kept, run, state

OTHER = sys.argv[3] if len(sys.argv) > 3 else ""

if OTHER == "mjx":  # compiles a function for each pair of shapes, which takes all its time
    os.environ["XLA_FLAGS"] = "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"
    import jax
    from mujoco import mjx
elif OTHER == "warp":
    import mujoco_warp
    import warp

    warp.config.quiet = True
    warp.set_device("cpu")


def world(file, starts):
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 1])
    for index, start in enumerate(starts):
        frame = spec.worldbody.add_frame(pos=start)
        frame.attach_body(mujoco.MjSpec.from_file(file).worldbody.first_body(), f"{index}_", "")
    return spec.compile()


def take(file):
    model = world(file, [[0, 0, 1]])
    meshes = [model.geom_dataid[geom] for geom in range(1, model.ngeom) if model.geom_contype[geom]]
    if OTHER == "mjx":
        shapes = mjx.put_model(model)._impl.mesh_convex
        hulls = [convex(shapes[mesh]) for mesh in meshes]
    else:
        there = mujoco_warp.put_model(model) if OTHER else model
        arrays = [getattr(there, name) for name in ("mesh_graph", "mesh_graphadr", "mesh_vert", "mesh_vertadr")]
        hulls = [hull(mesh, *(each.numpy() if OTHER else each for each in arrays)) for mesh in meshes]
    return [{**kept(points, faces, model.body_mass[1]), "vertices": count} for count, points, faces in hulls]


def convex(shape):
    """The hull of a mesh in MJX: corners, and polygons that repeat their last one as often as it takes."""
    polygons = np.asarray(shape.face)
    corners = np.arange(polygons[..., 0].size).reshape(polygons.shape[:2])
    faces = np.concatenate([corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)])
    return len(shape.vert), polygons.reshape(-1, 3), faces


def hull(mesh, graphs, graph_starts, corners, corner_starts):
    """MuJoCo keeps the hull of a mesh as a graph: counts, and at the end triangles of the mesh's vertices."""
    graph, points = graphs[graph_starts[mesh] :], corners[corner_starts[mesh] :]
    count, faces = map(int, graph[:2])
    return count, points, graph[2 + 3 * count + 3 * faces :][: 3 * faces].reshape(-1, 3)


def fall(file, starts, steps):
    model = world(file, starts)
    data = stepped(model, steps)
    order = [1, 2, 3, 0]  # w comes first
    moving = zip(data.qpos.reshape(-1, 7), data.qvel.reshape(-1, 6), strict=True)
    return [state(pose[:3], pose[3:][order], speed[:3], speed[3:]) for pose, speed in moving]


def stepped(model, steps):
    data = mujoco.MjData(model)
    if OTHER == "mjx":
        there = mjx.put_model(model)
        fallen = jax.jit(lambda now: jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(there, now), now))
        return mjx.get_data(model, fallen(mjx.make_data(model)))
    if OTHER == "warp":
        mujoco.mj_forward(model, data)
        there, now = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nconmax=2000, njmax=2000)
        for _ in range(steps):
            mujoco_warp.step(there, now)
        mujoco_warp.get_data_into(data, model, now)
        return data
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return data


PACKAGES = {"": ("MuJoCo", "mujoco"), "mjx": ("MJX", "mujoco-mjx"), "warp": ("MuJoCo Warp", "mujoco-warp")}
run(*PACKAGES[OTHER], take, fall)
