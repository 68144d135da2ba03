"""Make the sample mesh: a chair with turned legs, a curved back and spindles, and a jug with a handle on its seat.

    python examples/sample.py chair.glb

Two bodies, a few thousand triangles, and what makes convex decomposition hard: thin parts, holes, a hollow vessel.
"""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import trimesh
from manifold3d import CrossSection, Manifold

Point = tuple[float, float, float]
Y_UP = trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1.0, 0.0, 0.0])  # glTF's up axis


def rod(start: Point, end: Point, start_radius: float, end_radius: float, segments: int = 16) -> Manifold:
    """Return a tapered rod with round ends: the hull of two balls."""
    ends = ((start, start_radius), (end, end_radius))
    return Manifold.batch_hull([Manifold.sphere(radius, segments).translate(place) for place, radius in ends])


def chain(points: npt.NDArray[np.float64], radius: float) -> Manifold:
    """Return rods of one radius through `points` [N, 3]."""
    rods = [rod(tuple(a), tuple(b), radius, radius) for a, b in pairwise(points)]
    return sum(rods[1:], start=rods[0])


def chair() -> Manifold:
    """Return a chair 0.9 m high, feet on z = 0, its back towards +y."""
    seat_height, splay = 0.45, 1.25
    seat = Manifold.batch_hull(
        [Manifold.sphere(0.03, 24).translate((x, y, seat_height)) for x in (-0.20, 0.20) for y in (-0.19, 0.19)]
    )
    corners = [(x, y) for x in (-0.17, 0.17) for y in (-0.16, 0.16)]
    parts = [seat]
    parts += [rod((x, y, seat_height), (splay * x, splay * y, 0.014), 0.024, 0.014) for x, y in corners]
    side = [rod((x, -0.18, 0.18), (x, 0.18, 0.18), 0.011, 0.011) for x in (-0.194, 0.194)]
    parts += [*side, rod((-0.194, 0.0, 0.18), (0.194, 0.0, 0.18), 0.011, 0.011)]

    # The crest rail is an arc that leans back; posts and spindles run from the seat to points of it.
    angle = np.linspace(-0.75, 0.75, 9)
    crest = np.stack([0.30 * np.sin(angle), 0.07 + 0.25 * np.cos(angle), np.full(9, 0.88)], axis=1)
    parts.append(chain(crest, 0.022))
    for k in (0, 2, 4, 6, 8):
        radius = 0.018 if k in (0, 8) else 0.010
        parts.append(rod((0.80 * crest[k, 0], 0.17, seat_height), tuple(crest[k]), radius, radius))
    return sum(parts[1:], start=parts[0])


def jug() -> Manifold:
    """Return a hollow jug 0.2 m high with a handle, its bottom on z = 0."""
    outline = [(0.055, 0.0), (0.075, 0.05), (0.07, 0.12), (0.055, 0.17), (0.066, 0.20)]
    inside = [(0.05, 0.01), (0.067, 0.05), (0.062, 0.12), (0.047, 0.17), (0.06, 0.205)]
    body, room = (
        CrossSection([[(0.0, line[0][1]), *line, (0.0, line[-1][1])]]).revolve(40) for line in (outline, inside)
    )
    bend = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
    grip = np.stack([0.055 + 0.06 * np.cos(bend), np.zeros(9), 0.108 + 0.058 * np.sin(bend)], axis=1)
    return body + chain(grip, 0.009) - room


def sample() -> trimesh.Scene:
    """Return the chair and the jug as the two nodes of a scene, in metres, y up as glTF has it."""
    scene = trimesh.Scene()
    for name, solid in {"chair": chair(), "jug": jug().rotate((0, 0, -35)).translate((-0.05, -0.04, 0.481))}.items():
        mesh = solid.to_mesh()
        scene.add_geometry(trimesh.Trimesh(mesh.vert_properties, mesh.tri_verts), node_name=name, geom_name=name)
    scene.apply_transform(Y_UP)
    return scene


if __name__ == "__main__":
    sample().export(sys.argv[1] if len(sys.argv) > 1 else "chair.glb")
