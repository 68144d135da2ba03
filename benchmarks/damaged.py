"""Closed meshes with a share of their surface destroyed: how well repair recovers the original solids."""

from __future__ import annotations

import re
import time
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import trimesh
import typer

import rlacd
from benchmarks.tables import Table
from fuzz.flaws import FAMILIES
from rlacd.cli.exit_codes import exit_codes
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import SurfaceQuery, spread_points
from rlacd.repair.repair import repair
from rlacd.solid.frame import Frame

app = typer.Typer(add_completion=False)

SPACING = 0.02
"""Between the points at which distances are measured."""

UNDER, OVER = 0.005, 0.06
"""The bars: input outside the hulls, and hulls beyond the input at the threshold 0.05."""


def measure(vertices: Any, faces: Any, family: str, share: float) -> dict[str, Any]:
    """Damage one mesh, decompose it, and compare the hulls with the undamaged mesh."""
    frame = Frame.of(vertices)
    damaged = FAMILIES[family](vertices, faces, share, np.random.default_rng(0))
    started = time.process_time()
    result = rlacd.decompose(trimesh.Trimesh(*damaged, process=False), quality="fast", threads=1)
    seconds = time.process_time() - started
    solid = repair(load_mesh(trimesh.Trimesh(vertices, faces, process=False)))
    hulls = [(frame.to_frame(hull.vertices), np.asarray(hull.faces)) for hull in result]
    queries = [SurfaceQuery(*hull) for hull in hulls]

    def apart(points: Any, skip: int = -1) -> Any:
        """Distances to the union of the hulls, 0 inside."""
        nearest = np.full(len(points), np.inf)
        for i, query in enumerate(queries):
            if i != skip:
                distance = query.distance(points)
                distance[query.inside(points)] = 0
                nearest = np.minimum(nearest, distance)
        return nearest

    surface: tuple[Any, Any] = solid.surface
    points, _ = spread_points(*surface, SPACING)
    missed = apart(points)
    under, lost = missed.max(), frame.to_input(points[missed.argmax()])
    holes = result.report["holes"]
    is_hole = any(np.linalg.norm(lost - hole["at_abs"]) <= hole["width_abs"] for hole in holes)
    inputs = [SurfaceQuery(*surface), SurfaceQuery(frame.to_frame(damaged[0]), damaged[1])]
    over = 0.0
    for i, hull in enumerate(hulls):
        points, _ = spread_points(*hull, SPACING)
        outer = points[apart(points, skip=i) > 1e-6] if len(hulls) > 1 else points
        if len(outer):
            over = max(over, float(np.minimum(*(query.distance(outer) for query in inputs)).max()))
    return {
        "family": family,
        "share": share,
        "hulls": len(hulls),
        "under": float(under),
        "over": over,
        "located": (is_hole or under <= UNDER)
        and any(re.search(r" (at|near) \(", warning) for warning in result.report["warnings"]),
        "seconds": seconds,
    }


def table(rows: list[dict[str, Any]]) -> Table:
    """One line per family and share."""
    lines = []
    for family, share in dict.fromkeys((row["family"], row["share"]) for row in rows):
        some = [row for row in rows if (row["family"], row["share"]) == (family, share)]
        under, over = (np.array([row[key] for row in some]) for key in ("under", "over"))
        missed = (under > UNDER) | (over > OVER)
        unlocated = missed & ~np.array([row["located"] for row in some])
        distances = [f"{values.mean():.4f}, {values.max():.4f}" for values in (under, over)]
        hulls = sum(row["hulls"] for row in some)
        lines.append([family, f"{share:.0%}", hulls, *distances, f"{missed.sum()} of {len(some)}", unlocated.sum()])
    header = ["family", "share", "hulls", "under: mean, worst", "over: mean, worst", "outside the bars", "not named"]
    return Table(header, lines)


@app.command()
def damaged(
    folder: Path,
    files: list[str],
    shares: Annotated[str, typer.Option(help="Shares of the faces that are damaged.")] = "0.05,0.1,0.2",
) -> None:
    """Damage closed meshes by every family of flaws at every share, decompose them with quality="fast", one thread.

    under: largest distance of the undamaged surface from the hulls. over: largest distance of the hulls' surface from
    the damaged or undamaged input, whichever is nearer, since a fin is part of the input. Not named: outside the bars,
    and no warning says where. Longest side of the undamaged mesh: 2.

    \b
    python -m benchmarks damaged ../shared/meshes/train FILE FILE
    """
    with exit_codes():
        rows = []
        for name in files:
            mesh = load_mesh(folder / name)
            vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
            for family, share in product(FAMILIES, map(float, shares.split(","))):
                rows.append(measure(vertices, faces, family, share))
                print(name, rows[-1], flush=True)
        print(table(rows))
