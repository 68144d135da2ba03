"""Genesis, on the processor: URDF."""

import genesis
from harness import GRAVITY, STEP, kept, run, state

genesis.init(backend=genesis.cpu, logging_level="error")


def world(file, starts):
    scene = genesis.Scene(sim_options=genesis.options.SimOptions(dt=STEP, gravity=(0, 0, GRAVITY)), show_viewer=False)
    scene.add_entity(genesis.morphs.Plane())
    return scene, [scene.add_entity(genesis.morphs.URDF(file=file, pos=start)) for start in starts]


def take(file):
    """Before the scene is built, which compiles for minutes."""
    _, (body,) = world(file, [[0, 0, 1]])
    assert all(geom.is_convex for geom in body.geoms)
    return [kept(geom.init_verts, geom.init_faces, body.base_link.desc.mass) for geom in body.geoms]


def fall(file, starts, steps):
    scene, bodies = world(file, starts)
    scene.build()
    for _ in range(steps):
        scene.step()
    said = []
    for body in bodies:
        w, x, y, z = body.get_quat().tolist()
        said.append(state(body.get_pos().tolist(), [x, y, z, w], body.get_vel().tolist(), body.get_ang().tolist()))
    return said


run("Genesis", "genesis-world", take, fall)
