"""Large and awkward shapes that keep every stage of a decomposition busy for long; made of arithmetic, no files.

python -m tests.shapes_large FOLDER        write those that are hard for the defaults
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh
from manifold3d import Manifold

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]
Mesh = tuple[Floats, Ints]

_BOX = trimesh.creation.box(bounds=[(0, 0, 0), (1, 1, 1)])
_CORNERS, _CUBE = np.array(_BOX.vertices), _BOX.faces.astype(np.int32)


def sponge(level: int = 3) -> Mesh:
    """A Menger sponge, closed and clean: the squares between its cells and what is not in it."""
    cells = np.ones((1, 1, 1), dtype=bool)
    keep = np.add.outer(np.add.outer([0, 1, 0], [0, 1, 0]), [0, 1, 0]) < 2
    for _ in range(level):
        cells = np.kron(cells, keep)
    return _around_cells(cells)


def _around_cells(cells: npt.NDArray[np.bool_]) -> Mesh:
    padded = np.pad(cells, 1)
    shape = np.array(padded.shape) + 1
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            at = np.argwhere(padded & ~np.roll(padded, -side, axis))
            u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
            at = at + (side > 0) * np.eye(3, dtype=int)[axis]
            ring = [at, at + u, at + u + v, at + v][::side]
            a, b, c, d = (np.ravel_multi_index(tuple(corner.T), tuple(shape)) for corner in ring)
            faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    used, index = np.unique(np.concatenate(faces), return_inverse=True)
    vertices = np.stack(np.unravel_index(used, tuple(shape)), axis=1).astype(np.float64)
    return vertices, index.reshape(-1, 3).astype(np.int32)


def spiked_ball(length: float = 1e6, faces: int = 20_000) -> Mesh:
    """A ball of radius 1 one of whose corners is drawn out."""
    vertices, triangles = noisy_ball(faces, 0.0)
    vertices[int(vertices[:, 2].argmax())] *= length
    return vertices, triangles


def screws(count: int = 1500, sides: int = 12, seed: int = 0) -> Mesh:
    """Threaded rods that cross each other at random."""
    rng = np.random.default_rng(seed)
    along, around = 20, sides
    t, a = np.meshgrid(np.linspace(0, 1, along), np.arange(around) / around * 2 * np.pi, indexing="ij")
    radius = 0.02 * (1 + 0.3 * np.sin(2 * np.pi * 6 * t + a))
    rod = np.stack([radius * np.cos(a), radius * np.sin(a), 0.5 * t], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    p, q = (i * around + j).ravel(), (i * around + (j + 1) % around).ravel()
    ends = np.arange(1, around - 1)
    top = (along - 1) * around
    triangles = np.concatenate(
        [
            np.stack([p, q, q + around], axis=1),
            np.stack([p, q + around, p + around], axis=1),
            np.stack([0 * ends, ends + 1, ends], axis=1),
            np.stack([top + 0 * ends, top + ends, top + ends + 1], axis=1),
        ]
    )
    turned, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    turned *= np.sign(np.linalg.det(turned))[:, None, None]
    return _copies(rod, triangles.astype(np.int32), turned, rng.random((count, 3)))


def terrain(side: int = 512, seed: int = 0) -> Mesh:
    """A rough open height field of side x side squares."""
    rng = np.random.default_rng(seed)
    height = sum(
        0.3 / 2**k * np.kron(rng.random((2**k + 1, 2**k + 1)), np.ones((side // 2**k, side // 2**k)))[:side, :side]
        for k in range(1, 7)
        if 2**k <= side
    )
    x, y = np.meshgrid(np.linspace(0, 2, side), np.linspace(0, 2, side), indexing="ij")
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), _grid(side, side)


def sheet(faces: int = 1_000_000) -> Mesh:
    """An open wavy sheet."""
    side = round((faces / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    return np.stack([x, y, 0.2 * np.sin(5 * x) * np.cos(4 * y)], axis=-1).reshape(-1, 3), _grid(side, side)


def boxes(count: int = 5000, seed: int = 0) -> Mesh:
    """Boxes beside each other, on a grid with gaps."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(count ** (1 / 3)))
    at = np.argwhere(np.ones((side, side, side)))[:count]
    scale = 0.3 + 0.5 * rng.random((count, 3, 1)) * np.eye(3)
    return _copies(_CORNERS, _CUBE, scale * np.eye(3), at.astype(np.float64))


def bristles(count: int = 1000, seed: int = 0) -> Mesh:
    """Thin leaning needles that stand on a plate."""
    rng = np.random.default_rng(seed)
    lean = np.tile(np.eye(3), (count, 1, 1)) * [0.01, 0.01, 1.0]
    lean[:, :2, 2] = 0.2 * rng.normal(size=(count, 2))
    needles = _copies(_CORNERS, _CUBE, lean, np.column_stack([2 * rng.random((count, 2)), np.full(count, -0.02)]))
    plate = _CORNERS * [2.2, 2.2, 0.1] - [0.1, 0.1, 0.1]
    return np.concatenate([needles[0], plate]), np.concatenate([needles[1], _CUBE + len(needles[0])]).astype(np.int32)


def noisy_ball(faces: int = 1_000_000, noise: float = 0.01, seed: int = 0) -> Mesh:
    """A closed ball of about this many triangles, each corner moved along its radius."""
    rings = max(3, round((faces / 4) ** 0.5))
    ball = trimesh.creation.uv_sphere(1.0, count=(rings, 2 * rings))
    moved = 1 + noise * np.random.default_rng(seed).normal(size=(len(ball.vertices), 1))
    return ball.vertices * moved, ball.faces.astype(np.int32)


def gyroid(edge: float = 0.077, waves: float = 6.5) -> Mesh:
    """A wall along a gyroid, cut to a cube."""

    def inside(x: float, y: float, z: float) -> float:
        s, c = np.sin(waves * np.array([x, y, z])), np.cos(waves * np.array([x, y, z]))
        wall = 0.35 - abs(s[0] * c[1] + s[1] * c[2] + s[2] * c[0])
        return float(min(wall, 0.98 - abs(x), 0.98 - abs(y), 0.98 - abs(z)))

    mesh = Manifold.level_set(inside, [-1, -1, -1, 1, 1, 1], edge).to_mesh64()
    return mesh.vert_properties[:, :3], mesh.tri_verts.astype(np.int32)


def _grid(rows: int, columns: int) -> Ints:
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    faces = [np.stack([a, a + columns, a + columns + 1], axis=1), np.stack([a, a + columns + 1, a + 1], axis=1)]
    return np.concatenate(faces).astype(np.int32)


def _copies(vertices: Floats, faces: Ints, turns: Floats, shifts: Floats) -> Mesh:
    """Copies of a mesh, each turned by a matrix [3, 3] and shifted."""
    placed = np.einsum("nij,vj->nvi", turns, vertices) + shifts[:, None]
    firsts = len(vertices) * np.arange(len(shifts))
    return placed.reshape(-1, 3), (faces + firsts[:, None, None]).reshape(-1, 3).astype(np.int32)


LARGE: dict[str, Callable[[], Mesh]] = {
    "sponge": sponge,
    "spike": spiked_ball,
    "screws": screws,
    "terrain": terrain,
    "boxes": boxes,
    "bristles": bristles,
    "ball": noisy_ball,
    "sheet": sheet,
}
"""By name, in the size that the promise about `timeout` is measured with."""

HARD: dict[str, Callable[[], Mesh]] = {
    "gyroid": gyroid,
    "sponge": sponge,
    "boxes": boxes,
    "screws": lambda: screws(150),
    "bristles": bristles,
    "terrain": lambda: terrain(192),
    "sheet": lambda: sheet(90_000),
    "ball": lambda: noisy_ball(100_000),
}
"""Of at most 100,000 triangles each."""

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in HARD.items():
        trimesh.Trimesh(*make(), process=False).export(folder / f"{name}.ply")
