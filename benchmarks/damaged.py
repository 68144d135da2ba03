"""Closed meshes with a share of their surface destroyed: how well repair recovers the original solids."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
import trimesh

import rlacd
from benchmarks.cli import PATH
from benchmarks.tables import Table
from fuzz.flaws import FAMILIES
from rlacd.cli.exit_codes import exit_codes
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import spread_points
from rlacd.repair.repair import repair
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull

SPACING = 0.02
"""Between the points of the undamaged surface whose distances from the hulls are measured."""

UNDER = 0.005
"""What of the undamaged surface is farther from the hulls than this has to be named in a warning."""


def measure(mesh: Any, family: str, share: float) -> tuple[int, float, bool]:
    """Damage one mesh and decompose it: the hulls, how far the undamaged mesh is from them, whether that is told."""
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    damaged = FAMILIES[family](vertices, faces, share, np.random.default_rng(0))
    result = rlacd.decompose(trimesh.Trimesh(*damaged, process=False), quality="fast", threads=1)
    solid = repair(mesh)
    frame = solid.frame
    surface: tuple[Any, Any] = solid.surface
    points, _ = spread_points(*surface, SPACING)
    hulls = [hull for each in result if (hull := Hull.of(frame.to_frame(each.vertices)))]
    missed = hull_union(hulls, 1).distance(points, 1)
    under, lost = float(missed.max()), frame.to_input(points[missed.argmax()])
    holes = result.report.holes
    is_hole = any(np.linalg.norm(lost - hole.at_abs) <= hole.width_abs for hole in holes)
    places = any(re.search(r" (at|near) \(", warning) for warning in result.report.warnings)
    return len(result), under, under <= UNDER or (is_hole and places)


@click.command()
@click.argument("folder", type=PATH)
@click.argument("files", nargs=-1, required=True)
@click.option("--shares", default="0.05,0.1,0.2", show_default=True, help="Shares of the faces that are damaged.")
def app(folder: Path, files: tuple[str, ...], shares: str) -> None:
    """Damage closed meshes by every family of flaws at every share, decompose them with quality="fast", one thread.

    under: largest distance of the undamaged surface from the hulls (longest side: 2). Not named: it is over 0.005, and
    no warning says where.

    \b
    python -m benchmarks damaged ../shared/meshes/train FILE FILE
    """
    with exit_codes():
        lines = []
        meshes = [load_mesh(folder / name) for name in files]
        for family, share in product(FAMILIES, map(float, shares.split(","))):
            hulls, under, named = zip(*(measure(mesh, family, share) for mesh in meshes), strict=True)
            worst = f"{np.mean(under):.4f}, {max(under):.4f}"
            lines.append([family, f"{share:.0%}", sum(hulls), worst, len(named) - sum(named)])
            click.echo(lines[-1])
        click.echo(Table(["family", "share", "hulls", "under: mean, worst", "not named"], lines))
