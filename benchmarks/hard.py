"""Shapes that are hard for the defaults, each of at most 100,000 triangles: many bodies, sponges, sheets, noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import numpy as np
import trimesh
import typer
from manifold3d import Manifold
from tests import shapes_large as large

from benchmarks.cli import Out, check_methods, words, write
from benchmarks.compare import about, comparison, mesh_by_mesh
from benchmarks.runner import Bench, Limits
from benchmarks.store import Store
from benchmarks.tables import Page, failures
from rlacd.cli.exit_codes import exit_codes

app = typer.Typer(add_completion=False)


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


@app.command()
def hard(
    out: Out,
    methods: Annotated[str, typer.Option(help="As for compare.")] = "fast,default",
    limit: Annotated[float, typer.Option(help="Seconds a method may take for one shape.")] = 600.0,
) -> None:
    """Write the shapes to OUT/shapes and compare methods on them.

    \b
    python -m benchmarks hard --out RUN
    """
    with exit_codes():
        check_methods(methods)
        store = Store(out)
        (out / "shapes").mkdir(exist_ok=True)
        for name, make in SHAPES.items():
            trimesh.Trimesh(*make(), process=False).export(out / "shapes" / f"{name}.ply")
        names = [f"{name}.ply" for name in SHAPES]
        bench = Bench(out / "shapes", names, store, Limits(limit), typer.echo)
        groups = {method: bench.run(method) for method in words(methods)}
        page = Page("Hard shapes", [about(bench), mesh_by_mesh(groups), comparison(groups)])
        page.add("## Failures", failures(row for rows in groups.values() for row in rows))
        write(page, out, "hard")
        store.close()
