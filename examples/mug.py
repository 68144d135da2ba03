"""Hang a mug on a peg by its handle, in MuJoCo: as convex hulls it hangs, as its one convex hull it falls off.

    python examples/mug.py [FOLDER]

Writes ``mug.xml`` (hulls) and ``mug_one_hull.xml``, with their meshes, and a picture of where both end up.
Needs the extras ``sim`` and, for the picture, ``view``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
import trimesh
from manifold3d import CrossSection, Manifold, OpType

import rlacd

PEG = np.array([0.0, 0.0, 0.3])
"""The middle of the peg, which points along y; metres."""

SECONDS = 8.0


@dataclass(frozen=True)
class Outcome:
    """Where the mug is after `SECONDS`.

    Attributes
    ----------
    height
        Of its centre of mass above the ground, metres.
    speed
        Of its centre, metres per second.
    held
        Whether what is to hold it, the peg or the ground, touches it.
    geoms
        What collides or is seen, placed: triangles [F, 3, 3] and colour [3] of each.
    """

    height: float
    speed: float
    held: bool
    geoms: list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]


def mug() -> trimesh.Trimesh:
    """A mug 10 cm high, its bottom on z = 0, its handle towards +x."""
    outside = CrossSection([[(0.0, 0.0), (0.036, 0.0), (0.040, 0.004), (0.040, 0.1), (0.0, 0.1)]]).revolve(48)
    inside = CrossSection([[(0.0, 0.005), (0.034, 0.005), (0.036, 0.008), (0.036, 0.11), (0.0, 0.11)]]).revolve(48)
    bend = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    path = np.stack([0.038 + 0.032 * np.cos(bend), np.zeros(13), 0.052 + 0.030 * np.sin(bend)], axis=1)
    balls = [Manifold.sphere(0.0045, 16).translate(tuple(point)) for point in path]
    handle = [Manifold.batch_hull(list(pair)) for pair in pairwise(balls)]
    solid = Manifold.batch_boolean([outside, *handle], OpType.Add) - inside
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def drop(path: Path) -> Outcome:
    """Let the mug of an MJCF file fall on the ground from 20 cm, tilted."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    (body,) = spec.worldbody.bodies
    body.pos, body.quat = [0, 0, 0.2], [np.cos(0.2), np.sin(0.2), 0, 0]
    return _simulate(spec, held_by="ground")


def hang(path: Path) -> Outcome:
    """Put the mug of an MJCF file on the peg, upright, the peg through its handle, and let go."""
    spec = mujoco.MjSpec.from_file(str(path))
    world, kind = spec.worldbody, mujoco.mjtGeom
    world.add_geom(name="ground", type=kind.mjGEOM_PLANE, size=[1, 1, 0.1])
    world.add_geom(name="post", type=kind.mjGEOM_BOX, size=[0.01, 0.01, 0.17], pos=[0, 0.06, 0.17])
    back, front = PEG + np.array([0.0, 0.05, 0.0]), PEG - np.array([0.0, 0.03, 0.0])
    world.add_geom(name="peg", type=kind.mjGEOM_CAPSULE, size=[0.004, 0, 0], fromto=[*back, *front])
    world.add_geom(name="knob", type=kind.mjGEOM_SPHERE, size=[0.008, 0, 0], pos=front)
    (body,) = spec.worldbody.bodies
    body.pos = PEG - [0.057, 0.0, 0.067]  # the peg is in the handle's hole, below its upper end
    return _simulate(spec, held_by="peg")


def draw(outcomes: list[Outcome], path: Path, width: int = 1400) -> None:
    """Draw the outcomes side by side."""
    from PIL import Image

    from rlacd.viewer.render import Body, render

    panels = []
    for outcome in outcomes:
        bodies = [Body(triangles, color) for triangles, color in outcome.geoms]
        panels.append(render(bodies, width // len(outcomes), width // len(outcomes), samples=64))
    drawn = Image.fromarray(np.concatenate(panels, axis=1))
    Image.alpha_composite(Image.new("RGBA", drawn.size, "white"), drawn).convert("RGB").save(path)


def _simulate(spec: Any, held_by: str) -> Outcome:
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < SECONDS:
        mujoco.mj_step(model, data)
    holder = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, held_by)
    touched = {int(geom) for contact in data.contact for geom in contact.geom}
    mug_body = 1
    return Outcome(
        float(data.xipos[mug_body, 2]),
        float(np.linalg.norm(data.cvel[mug_body, 3:])),
        holder in touched,
        [_placed(model, data, geom) for geom in range(model.ngeom) if model.geom_group[geom] != 2],
    )


def _placed(model: Any, data: Any, geom: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    size, kind = model.geom_size[geom], mujoco.mjtGeom(model.geom_type[geom])
    color = np.array([0.45, 0.45, 0.48])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertices, faces = (
            values[first : first + count]
            for values, first, count in (
                (model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]),
                (model.mesh_face, model.mesh_faceadr[mesh], model.mesh_facenum[mesh]),
            )
        )
        shape = trimesh.Trimesh(vertices, faces, process=False)
        color = model.geom_rgba[geom, :3].astype(np.float64) ** 2.2
    elif kind == mujoco.mjtGeom.mjGEOM_PLANE:
        shape = trimesh.creation.box((0.30, 0.30, 0.004), trimesh.transformations.translation_matrix([0, 0, -0.002]))
        color = np.array([0.75, 0.75, 0.75])
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        shape = trimesh.creation.capsule(height=2 * size[1], radius=size[0])
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        shape = trimesh.creation.icosphere(subdivisions=3, radius=size[0])
    else:
        shape = trimesh.creation.box(2 * size)
    points = shape.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return points[shape.faces], color


def main(folder: Path, threads: int | None = None) -> list[Outcome]:
    """Decompose the mug, drop it, hang both forms of it on the peg, and tell what became of them."""
    folder.mkdir(parents=True, exist_ok=True)
    ceramic = 2400.0
    hulls = rlacd.decompose(mug(), preset="mujoco", threads=threads)
    one = rlacd.decompose(mug(), max_hulls=1, threads=threads)
    outcomes = []
    for name, result in (("mug", hulls), ("mug_one_hull", one)):
        path = result.save(folder / f"{name}.xml", density=ceramic)
        dropped, hung = drop(path), hang(path)
        outcomes.append(hung)
        verdict = "hangs on the peg" if hung.held else "fell off"
        print(
            f"{name}: {len(result)} hulls; dropped, its centre rests {dropped.height:.3f} m above the ground; "
            f"hung up, it {verdict}, {hung.height:.3f} m above the ground"
        )
    return outcomes


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    draw(main(where), where / "mug.png")
    print(f"drawn in {where / 'mug.png'}")
