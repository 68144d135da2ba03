"""MuJoCo: MJCF."""

import mujoco
import numpy as np
from harness import STEP, run, state, volume


def take(file):
    model = mujoco.MjModel.from_xml_path(file)
    return [hull(model, geom) for geom in range(model.ngeom) if model.geom_contype[geom]]


def hull(model, geom):
    """MuJoCo keeps the hull of a mesh as a graph: counts, and then triangles of the mesh's vertices."""
    mesh = model.geom_dataid[geom]
    graph = model.mesh_graph[model.mesh_graphadr[mesh] :]
    count, faces = graph[:2]
    triangles = graph[2 + 3 * count + 3 * faces :][: 3 * faces].reshape(-1, 3)
    points = model.mesh_vert[model.mesh_vertadr[mesh] :]
    return {"vertices": int(count), "volume": volume(points, triangles), "mass": model.body_mass[1]}


def fall(file, starts, steps):
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[20, 20, 1])
    for index, start in enumerate(starts):
        frame = spec.worldbody.add_frame(pos=start)
        frame.attach_body(mujoco.MjSpec.from_file(file).worldbody.first_body(), f"{index}_", "")
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(steps):
        mujoco.mj_step(model, data)
    order = [1, 2, 3, 0]  # w comes first
    speeds = data.qvel.reshape(-1, 6)
    return [state(data.xpos[1 + i], data.xquat[1 + i][order], *np.split(speeds[i], 2)) for i in range(len(starts))]


run("MuJoCo", "mujoco", take, fall)
