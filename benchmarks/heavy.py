"""CPU seconds, memory and hulls of inputs that are hard for the defaults: many bodies, sponges, sheets, lattices.

    python benchmarks/heavy.py --out heavy.jsonl [--quality fast] [NAME ...]

Each input is generated, has at most 100,000 triangles, and is decomposed on one thread in its own process. A process is
ended after `--limit` CPU seconds.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from manifold3d import Manifold, OpType


def block(low: Any, high: Any) -> Manifold:
    return Manifold.cube(tuple(np.subtract(high, low))).translate(tuple(low))


def union(solids: list[Manifold]) -> Manifold:
    return Manifold.batch_boolean(solids, OpType.Add)


def shifted(x: float, y: float, z: float) -> Any:
    return trimesh.transformations.translation_matrix((x, y, z))


def grate(n: int) -> Manifold:
    plate = block((0, 0, 0), (n + 0.3, n + 0.3, n / 100))
    holes = itertools.product(range(n), repeat=2)
    return plate - union([block((i + 0.3, j + 0.3, -1), (i + 1, j + 1, n)) for i, j in holes])


def menger(level: int) -> Manifold:
    side, holes = 3**level, []
    for width in (3**k for k in range(level)):
        for i, j in itertools.product(range(width, side, 3 * width), repeat=2):
            for axis in range(3):
                ends = ((i, j), -1), ((i + width, j + width), side + 1)
                low, high = ((*end[:axis], out, *end[axis:]) for end, out in ends)
                holes.append(block(low, high))
    return block((0, 0, 0), (side, side, side)) - union(holes)


def boxes(count: int) -> trimesh.Trimesh:
    random = np.random.default_rng(0)
    places, sizes = random.uniform(-1, 1, (count, 3)), random.uniform(0.01, 0.1, (count, 3))
    made = [trimesh.creation.box(size, shifted(*place)) for size, place in zip(sizes, places, strict=True)]
    return trimesh.util.concatenate(made)


def lattice(n: int) -> trimesh.Trimesh:
    places = itertools.product(range(n), repeat=3)
    return trimesh.util.concatenate([trimesh.creation.box((0.6, 0.6, 0.6), shifted(*place)) for place in places])


def tetrahedra(level: int) -> Manifold:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)

    def pieces(middle: Any, size: float, left: int) -> list[Manifold]:
        if left == 0:
            return [Manifold.hull_points(1.02 * size * corners + middle)]
        return [p for c in corners for p in pieces(middle + c * size / 2, size / 2, left - 1)]

    return union(pieces(np.zeros(3), 1.0, level))


def gyroid(edge: float, waves: float = 6.5) -> Manifold:
    def inside(x: float, y: float, z: float) -> float:
        s, c = np.sin(waves * np.array([x, y, z])), np.cos(waves * np.array([x, y, z]))
        wall = 0.35 - abs(s[0] * c[1] + s[1] * c[2] + s[2] * c[0])
        return float(min(wall, 0.98 - abs(x), 0.98 - abs(y), 0.98 - abs(z)))

    return Manifold.level_set(inside, [-1, -1, -1, 1, 1, 1], edge)


def sheet(heights: Any, below: Any) -> trimesh.Trimesh:
    """Close the space between two height fields [n, n] over a square."""
    n = len(heights)
    x, y = np.meshgrid(*[np.linspace(-1, 1, n)] * 2, indexing="ij")
    points = np.concatenate([np.stack([x, y, z], axis=-1).reshape(-1, 3) for z in (heights, below)])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (q.ravel() for q in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    top = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([i[0, :], i[1:, -1], i[-1, -2::-1], i[-2:0:-1, 0]])
    after, n2 = np.roll(rim, -1), n * n
    side = np.concatenate([np.stack([rim, after, after + n2], 1), np.stack([rim, after + n2, rim + n2], 1)])
    mesh = trimesh.Trimesh(points, np.concatenate([top, top[:, ::-1] + n2, side]), process=False)
    trimesh.repair.fix_normals(mesh)
    return mesh


def cloth(n: int) -> trimesh.Trimesh:
    x, y = np.meshgrid(*[np.linspace(-1, 1, n)] * 2, indexing="ij")
    z = 0.12 * np.sin(7 * x + 2 * y) * np.cos(5 * y) + 0.05 * np.sin(13 * x * y)
    return sheet(z + 0.01, z - 0.01)


def terrain(n: int) -> trimesh.Trimesh:
    random = np.random.default_rng(3)
    x, y = np.meshgrid(*[np.linspace(0, 1, n)] * 2, indexing="ij")
    z = np.zeros((n, n))
    for octave, _ in itertools.product(range(1, 7), range(4)):
        a, b, phase = random.normal(size=3) * 2**octave
        z += 0.06 / 1.7**octave * np.sin(a * x + b * y + phase)
    return sheet(z, np.full((n, n), -0.3))


def oven() -> trimesh.Trimesh:
    random = np.random.default_rng(0)
    walls = (((2, 0.1, 2), (0, -0.95, 0)), ((0.1, 2, 2), (-0.95, 0, 0)), ((0.1, 2, 2), (0.95, 0, 0)))
    walls += (((2, 2, 0.1), (0, 0, -0.95)), ((2, 2, 0.1), (0, 0, 0.95)))
    made = [trimesh.creation.box(extents, shifted(*place)) for extents, place in walls]
    turn = trimesh.transformations.rotation_matrix
    for shelf in range(4):
        for i in range(60):
            at = shifted(-0.88 + 1.76 * i / 59, 0, -0.6 + 0.4 * shelf) @ turn(np.pi / 2, (1, 0, 0))
            made.append(trimesh.creation.cylinder(0.006, 1.8, sections=12, transform=at))
        for i in range(20):
            at = shifted(0, -0.88 + 1.76 * i / 19, -0.585 + 0.4 * shelf) @ turn(np.pi / 2, (0, 1, 0))
            made.append(trimesh.creation.cylinder(0.006, 1.8, sections=12, transform=at))
    for _ in range(600):
        place = (*random.uniform(-0.8, 0.8, 2), random.uniform(0.65, 0.9))
        made.append(trimesh.creation.box(random.uniform(0.01, 0.06, 3), shifted(*place)))
    return trimesh.util.concatenate(made)


SHAPES = {
    "grate of 10 x 10": lambda: grate(10),
    "grate of 40 x 40": lambda: grate(40),
    "5,000 boxes": lambda: boxes(5000),
    "lattice of 17^3 boxes": lambda: lattice(17),
    "Menger sponge": lambda: menger(3),
    "sponge of tetrahedra": lambda: tetrahedra(5),
    "gyroid": lambda: gyroid(0.077),
    "wavy cloth": lambda: cloth(100),
    "oven": oven,
    "terrain": lambda: terrain(155),
}


def decompose(path: str, quality: str) -> None:
    import rlacd

    before = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    result = rlacd.decompose(path, threads=1, quality=quality)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    search = result.report["search"] or {}
    row = {"cpu": round(sum(usage[:2]) - before, 1), "mb": usage.ru_maxrss // 1024, "hulls": len(result)}
    print(json.dumps({**row, "work": search.get("work"), "allowed": search.get("allowed")}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"some of: {', '.join(SHAPES)}")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--quality", default="balanced")
    parser.add_argument("--limit", type=int, default=600)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        decompose(given.one, given.quality)
        return
    for name in given.names or SHAPES:
        made = SHAPES[name]()
        if isinstance(made, Manifold):
            mesh = made.to_mesh64()
            made = trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "shape.ply"
            made.export(path)
            done = subprocess.run(
                [sys.executable, __file__, "--one", str(path), "--quality", given.quality],
                capture_output=True,
                text=True,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (given.limit, given.limit)),
            )
        own = (
            json.loads(done.stdout) if done.returncode == 0 else {"failed": done.stderr[-300:], "code": done.returncode}
        )
        row = json.dumps({"name": name, "triangles": len(made.faces), "quality": given.quality, **own})
        print(row, flush=True)
        if given.out:
            with given.out.open("a") as file:
                file.write(row + "\n")


if __name__ == "__main__":
    main()
