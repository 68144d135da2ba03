"""Damage closed meshes and measure how well repair recovers the original solids.

    python -m benchmarks.repair_damaged FOLDER FILE ... [--shares 0.05,0.1,0.2] [--out damaged.jsonl]
    python -m benchmarks.repair_damaged --table damaged.jsonl

Runs every family of `fuzz.flaws` at every share of damaged faces, with quality="fast" and one thread. `under` is the
largest distance of the undamaged surface from the hulls; `over` is the largest distance of the hulls' surface from the
damaged or undamaged input, whichever is nearer: a fin is part of the input. A place is named where a warning says one,
and what is missed most lies at a hole that the report lists. Lengths are in the frame of the undamaged mesh.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import rlacd
from fuzz.flaws import FAMILIES
from rlacd.io.read.load import load_mesh
from rlacd.repair.distance import SurfaceQuery, spread_points
from rlacd.repair.repair import repair
from rlacd.solid.frame import Frame

SPACING = 0.02
THRESHOLD = 0.05
UNDER, OVER = 0.005, THRESHOLD + 0.01


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

    points, _ = spread_points(*solid.surface, SPACING)
    missed = apart(points)
    under, lost = missed.max(), frame.to_input(points[missed.argmax()])
    holes = result.report["holes"]
    is_hole = any(np.linalg.norm(lost - hole["at_abs"]) <= hole["width_abs"] for hole in holes)
    inputs = [SurfaceQuery(*solid.surface), SurfaceQuery(frame.to_frame(damaged[0]), damaged[1])]
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


def table(rows: list[dict[str, Any]]) -> str:
    """One line per family and share."""
    lines = ["| family | share | hulls | under mean | worst | over mean | worst | outside the bars | no place named |"]
    lines += ["|---|---|---|---|---|---|---|---|---|"]
    for family, share in dict.fromkeys((row["family"], row["share"]) for row in rows):
        some = [row for row in rows if (row["family"], row["share"]) == (family, share)]
        under, over = (np.array([row[key] for row in some]) for key in ("under", "over"))
        missed = (under > UNDER) | (over > OVER)
        unlocated = missed & ~np.array([row["located"] for row in some])
        lines.append(
            f"| {family} | {share:.0%} | {sum(row['hulls'] for row in some)} | {under.mean():.4f} | {under.max():.4f} "
            f"| {over.mean():.4f} | {over.max():.4f} | {missed.sum()} of {len(some)} | {unlocated.sum()} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("files", nargs="*")
    parser.add_argument("--shares", default="0.05,0.1,0.2")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    if options.table:
        print(table([json.loads(line) for line in options.table.read_text().splitlines()]))
        return
    rows = []
    for name in options.files:
        mesh = load_mesh(options.folder / name)
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
        for family in FAMILIES:
            for share in map(float, options.shares.split(",")):
                rows.append({"file": name, **measure(vertices, faces, family, share)})
                if options.out:
                    with options.out.open("a") as out:
                        out.write(json.dumps(rows[-1]) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()
