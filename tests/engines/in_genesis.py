"""Genesis, on the processor: URDF."""

import genesis
from harness import GRAVITY, STEP, run, state, volume

genesis.init(backend=genesis.cpu, logging_level="error")


def world(file, starts):
    scene = genesis.Scene(sim_options=genesis.options.SimOptions(dt=STEP, gravity=(0, 0, GRAVITY)), show_viewer=False)
    scene.add_entity(genesis.morphs.Plane())
    bodies = [scene.add_entity(genesis.morphs.URDF(file=file, pos=start)) for start in starts]
    scene.build()
    return scene, bodies


def take(file):
    _, (body,) = world(file, [[0, 0, 1]])
    said = []
    for geom in body.geoms:
        assert geom.is_convex
        said.append(
            {
                "vertices": len(geom.init_verts),
                "volume": volume(geom.init_verts, geom.init_faces),
                "mass": body.get_mass(),
            }
        )
    return said


def fall(file, starts, steps):
    scene, bodies = world(file, starts)
    for _ in range(steps):
        scene.step()
    said = []
    for body in bodies:
        w, x, y, z = body.get_quat().tolist()
        said.append(state(body.get_pos().tolist(), [x, y, z, w], body.get_vel().tolist(), body.get_ang().tolist()))
    return said


run("Genesis", "genesis-world", take, fall)
