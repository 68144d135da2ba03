"""Closed, outward oriented solids of size about 1, each a function of a random generator."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import mapbox_earcut
import numpy as np
import numpy.typing as npt
from trimesh import creation

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Random: TypeAlias = np.random.Generator
Triangles: TypeAlias = tuple[Floats, Ints]


def _arrays(mesh: creation.Trimesh) -> Triangles:
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)


def box(random: Random) -> Triangles:
    return _arrays(creation.box())


def cylinder(random: Random) -> Triangles:
    return _arrays(creation.cylinder(0.5, 1, sections=int(random.choice([3, 4, 5, 8, 24]))))


def cone(random: Random) -> Triangles:
    return _arrays(creation.cone(0.5, 1, sections=int(random.choice([3, 4, 7, 16]))))


def sphere(random: Random) -> Triangles:
    return _arrays(creation.icosphere(int(random.integers(0, 3))))


def globe(random: Random) -> Triangles:
    return _arrays(creation.uv_sphere(1, (int(random.integers(3, 9)), int(random.integers(3, 12)))))


def torus(random: Random) -> Triangles:
    return _arrays(creation.torus(1, random.choice([0.05, 0.3, 0.9]), *random.integers(3, 13, 2)))


def plate(random: Random) -> Triangles:
    return _arrays(creation.box((1, 1, random.choice([1e-9, 1e-6, 1e-4, 1e-3, 0.02]))))


def needle(random: Random) -> Triangles:
    return _arrays(creation.cylinder(random.choice([1e-6, 1e-3, 0.02]), 1, sections=int(random.integers(3, 6))))


def wedge(random: Random) -> Triangles:
    """A block that tapers to an edge, or nearly so."""
    x, y = random.choice([0.0, 1e-9, 1e-3, 0.3], 2)
    return extruded(np.array([[0, 0], [1, 0], [1, y], [0, 1 + x]]) if y else np.array([[0, 0], [1, 0], [0, 1 + x]]))


def star(random: Random) -> Triangles:
    """A prism over a star with possibly thin points."""
    count = 2 * int(random.integers(3, 8))
    radius = np.where(np.arange(count) % 2, random.choice([0.02, 0.3, 0.7]), 1.0)
    angle = 2 * np.pi * np.arange(count) / count
    return extruded(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def profile(random: Random) -> Triangles:
    """A prism over a comb: walls and slits of any width."""
    teeth = int(random.integers(1, 5))
    widths = random.choice([1e-6, 1e-3, 0.05, 0.3, 1.0], 2 * teeth + 1)
    x = np.repeat(np.concatenate([[0], np.cumsum(widths)]), 2)[1:-1]
    height = np.repeat(np.where(np.arange(2 * teeth + 1) % 2, random.choice([0.0, 1e-3, 0.3]), 1.0), 2)
    top = np.stack([x, height], axis=1)[::-1]
    return extruded(np.concatenate([[[0, -0.2], [x[-1], -0.2]], top]))


def extruded(outline: Floats) -> Triangles:
    """The prism of height 1 over a polygon [N, 2], counter-clockwise."""
    n = len(outline)
    flat = mapbox_earcut.triangulate_float64(np.ascontiguousarray(outline), np.array([n], dtype=np.uint32))
    cap = np.array(flat, dtype=np.int64).reshape(-1, 3)
    a, b, c = (outline[cap[:, k]] for k in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    cap[turned] = cap[turned][:, ::-1]
    here = np.arange(n)
    there = (here + 1) % n
    sides = np.concatenate([np.stack([here, there, there + n], 1), np.stack([here, there + n, here + n], 1)])
    vertices = np.concatenate([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 1.0)])
    return vertices, np.concatenate([cap[:, ::-1], cap + n, sides])


PRIMITIVES: dict[str, Callable[[Random], Triangles]] = {
    function.__name__: function
    for function in (box, cylinder, cone, sphere, globe, torus, plate, needle, wedge, star, profile)
}
