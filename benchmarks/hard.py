"""Shapes that are hard for the defaults, each of at most 100,000 triangles: many bodies, sponges, sheets, noise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import trimesh
from manifold3d import Manifold
from tests import shapes_large as large

from benchmarks.cli import OUT, check_methods, words, write
from benchmarks.compare import side_by_side
from benchmarks.runner import Bench
from rlacd.cli.exit_codes import exit_codes


def gyroid(edge: float = 0.077, waves: float = 6.5) -> large.Mesh:
    """A wall along a gyroid, cut to a cube."""

    def inside(x: float, y: float, z: float) -> float:
        s, c = np.sin(waves * np.array([x, y, z])), np.cos(waves * np.array([x, y, z]))
        wall = 0.35 - abs(s[0] * c[1] + s[1] * c[2] + s[2] * c[0])
        return float(min(wall, 0.98 - abs(x), 0.98 - abs(y), 0.98 - abs(z)))

    mesh = Manifold.level_set(inside, [-1, -1, -1, 1, 1, 1], edge).to_mesh64()
    return mesh.vert_properties[:, :3], mesh.tri_verts.astype(np.int32)


SHAPES: dict[str, Callable[[], large.Mesh]] = {
    "gyroid": gyroid,
    "sponge": large.sponge,
    "boxes": large.boxes,
    "screws": lambda: large.screws(150),
    "bristles": large.bristles,
    "terrain": lambda: large.terrain(192),
    "sheet": lambda: large.sheet(90_000),
    "ball": lambda: large.noisy_ball(100_000),
}


@click.command()
@OUT
@click.option("--methods", default="fast,default", show_default=True, help="As for compare.")
def app(out: Path, methods: str) -> None:
    """Write the shapes to OUT/shapes and compare methods on them.

    \b
    python -m benchmarks hard --out RUN
    """
    with exit_codes():
        check_methods(methods)
        (out / "shapes").mkdir(parents=True, exist_ok=True)
        for name, make in SHAPES.items():
            trimesh.Trimesh(*make(), process=False).export(out / "shapes" / f"{name}.ply")
        bench = Bench(out / "shapes", [f"{name}.ply" for name in SHAPES], out, say=click.echo)
        write(side_by_side(bench, "Hard shapes", {name: bench.run(name) for name in words(methods)}), out, "hard")
