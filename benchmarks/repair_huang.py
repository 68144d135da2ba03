"""The shipped repair against the watertight-manifold algorithm of Huang et al. (2018), through to the hulls.

    python benchmarks/repair_huang.py MESHES --list files.txt --out huang.jsonl [--ways "each 5000,whole 20000"]
    python benchmarks/repair_huang.py MESHES --every 3 --out huang.jsonl
    python benchmarks/repair_huang.py --table huang.jsonl
    python benchmarks/repair_huang.py --rectangles 60

Without a list, every mesh of the folder whose repair made slabs, caps or wraps is taken. Each mesh is repaired in
several ways, then cut and merged in the same way, with one thread:

shipped
    `rlacd.solid.repair`.
each N
    Closed bodies as they are; every other body made watertight on its own, with its share of the surface of N leaves.
whole N
    Closed bodies as they are; all other bodies made watertight together with N leaves, so that rooms behind several
    bodies are closed too.

What Huang's algorithm returns lies a cell outside the input. Every vertex is drawn to `HALF_THICKNESS` in front of its
closest input point, the mesh is simplified by at most `SIMPLIFY`, and all bodies are united. Each way runs in a process
of its own: a crash or a hang costs that way and no other. Seconds are CPU seconds, lengths in the normalised frame.

The last command counts the rectangles (two triangles in a plane x, y or z = constant) on which the algorithm does not
come back within three seconds; it needs milliseconds where it does.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import point_cloud_utils as pcu
from manifold3d import Manifold

from rlacd import _native
from rlacd.clock import Clock
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.finish import merge_parts
from rlacd.policies import make_policy
from rlacd.solid.component import Component
from rlacd.solid.distance import directed_hausdorff, hull_distances
from rlacd.solid.frame import FloatArray
from rlacd.solid.load import load_mesh
from rlacd.solid.repair import HALF_THICKNESS, STEPS, repair
from rlacd.solid.repair_distance import SurfaceQuery, spread_points
from rlacd.solid.repair_skin import skin
from rlacd.solid.repair_union import to_arrays, to_manifold, unite
from rlacd.solid.topology import BoolArray, Edges, IntArray, bodies_of, face_areas, sides_of
from rlacd.workers import Workers

ENDINGS = {".ply", ".obj", ".stl", ".off", ".glb"}
CHANGED = {"slab", "capped", "wrapped"}
SIMPLIFY = 1e-3
LEAST_LEAVES = 50
CUT_SECONDS = 15.0
_FLAT = 1e-6


def closed_bodies(vertices: FloatArray, faces: IntArray, bodies: int, body: IntArray) -> tuple[BoolArray, Manifold]:
    """Return which bodies are closed 2-manifolds with an inside, and the solid they bound, with their own faces."""
    edges = Edges.of(faces, len(vertices))
    sides = sides_of(vertices, faces, edges)
    odd = (edges.valence != 2)[edges.of_halfedge].reshape(-1, 3).any(axis=1) | sides.sheet
    odd |= np.abs(sides.volume[sides.label[0::2]]) <= _FLAT * sides.area[sides.label[0::2]]
    closed = np.bincount(body, odd, bodies) == 0
    of_side = np.zeros(len(sides.volume), dtype=np.int64)
    of_side[sides.label] = np.repeat(body, 2)
    keep = (sides.volume > 0) & closed[of_side]
    v, f, label = skin(vertices, faces, sides, keep, np.zeros(len(faces), dtype=bool), 0.0)
    return closed, unite([to_manifold(v, f[label == i]) for i in np.unique(label)])


def watertight(vertices: FloatArray, faces: IntArray, leaves: int, surface: SurfaceQuery) -> tuple[Manifold, str]:
    """Make faces watertight, take the offset of a cell back, simplify; tells what went wrong, if anything."""
    used, index = np.unique(faces, return_inverse=True)
    corners = vertices[used]
    # Off the origin, rounding can put a flat body between the cells of the octree, which then refines without end.
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    soup = np.ascontiguousarray(corners - middle), np.ascontiguousarray(index.reshape(-1, 3), dtype=np.int32)
    found, found_faces = pcu.make_mesh_watertight(*soup, leaves, 0)
    points = np.asarray(found, dtype=np.float64) + middle
    if len(found_faces) == 0 or not np.isfinite(points).all():
        return Manifold(), "empty"
    closest, _ = surface.closest(points)
    away = points - closest
    length = np.linalg.norm(away, axis=1, keepdims=True)
    points = closest + np.minimum(HALF_THICKNESS / np.maximum(length, 1e-300), 1) * away
    solid = to_manifold(points, np.asarray(found_faces, dtype=np.int64))
    if solid.is_empty():
        return solid, "not manifold"
    solid = solid.simplify(SIMPLIFY)
    return (solid, "") if solid.volume() > 0 else (solid, "inside-out")


def huang(vertices: FloatArray, faces: IntArray, leaves: int, together: bool) -> tuple[Manifold, Counter[str]]:
    """Make a solid of a soup the Huang way."""
    surface = SurfaceQuery(vertices, faces, 1)
    bodies, body = bodies_of(faces, Edges.of(faces, len(vertices)))
    closed, solid = closed_bodies(vertices, faces, bodies, body)
    failures = Counter[str]()
    area = np.bincount(body, face_areas(vertices, faces), bodies)
    parts = [solid]
    groups = [np.flatnonzero(~closed)] if together else [np.array([b]) for b in np.flatnonzero(~closed)]
    for group in groups:
        share = max(LEAST_LEAVES, round(leaves * area[group].sum() / area.sum()))
        part, failure = watertight(vertices, faces[np.isin(body, group)], share, surface)
        if failure:
            failures[failure] += 1
        else:
            parts.append(part)
    return unite(parts), failures


def distances(solid: Manifold, vertices: FloatArray, faces: IntArray) -> tuple[float, float]:
    """How far the solid's surface leads from the input's, and how far input points lie outside the solid."""
    v, f = to_arrays(solid)
    over = directed_hausdorff(
        np.ascontiguousarray(v), f.astype(np.int32), _native.Surface(vertices, faces.astype(np.int32)), threads=1
    )[1]
    query = SurfaceQuery(v, f, 1)
    points, _ = spread_points(vertices, faces, 0.03)
    distance = query.distance(points)
    out = distance > HALF_THICKNESS
    out[out] = ~query.inside(points[out])
    return over, float(distance[out].max(initial=0.0))


def measure(path: Path, way: str) -> dict[str, Any]:
    """Repair one file one way, cut it, judge the hulls."""
    mesh = load_mesh(path)
    start = time.process_time()
    shipped = repair(mesh, threads=1)
    row: dict[str, Any] = {"repair_seconds": time.process_time() - start}
    vertices, faces = shipped.surface
    if way == "shipped":
        solid = shipped.manifold
        row["steps"] = dict(Counter(body.step for body in shipped.bodies))
    else:
        kind, leaves = way.split()
        start = time.process_time()
        solid, failures = huang(vertices, faces.astype(np.int64), int(leaves), kind == "whole")
        row = {"repair_seconds": time.process_time() - start, "failures": dict(failures)}
    if solid.is_empty():
        return {**row, "error": "no solid"}
    row |= {"faces": solid.num_tri(), "volume": solid.volume()}
    row["solid_over"], row["solid_under"] = distances(solid, vertices, faces.astype(np.int64))
    with Workers(1) as workers:
        clock = Clock(CUT_SECONDS)
        criterion = Concavity(0.05)
        start = time.process_time()
        done, left = CutTree(Component(solid), make_policy("greedy"), workers).cut_until(criterion, clock)
        row["cut_seconds"] = time.process_time() - start
        row["cut_complete"] = clock.stopped_by is None
        parts = merge_parts([*done, *left], criterion, workers, Clock(CUT_SECONDS))
    row["parts"] = len(parts)
    row["hull_volume"] = sum(part.hull.volume for part in parts)
    found = hull_distances([part.hull for part in parts], vertices, faces, threads=1)
    row |= {"over": found.over[1], "under": found.under[1]}
    return row


def _answer(pipe: Connection, function: Callable[..., dict[str, Any]], arguments: tuple[Any, ...]) -> None:
    try:
        pipe.send(function(*arguments))
    except Exception as error:
        pipe.send({"error": f"{type(error).__name__}: {error}"})


def in_process(limit: float, function: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:
    """Call a function in a process of its own."""
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=_answer, args=(there, function, arguments))
    process.start()
    there.close()
    row: dict[str, Any] = {"error": f"no result after {limit:g} s"}
    try:
        if here.poll(limit):
            row = here.recv()
    except EOFError:
        process.join()
        row = {"error": f"the process died (exit code {process.exitcode})"}
    process.kill()
    process.join()
    return row


def run(root: Path, files: list[str] | None, every: int, out: Path, ways: list[str], limit: float) -> None:
    """Measure what is not in the output yet."""
    known = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    rows = {(row["file"], row["way"]): row for row in known}
    if files is None:
        files = sorted(str(p.relative_to(root)) for p in root.rglob("*") if p.suffix.lower() in ENDINGS)[::every]
        asked = False
    else:
        asked = True
    for file in files:
        for way in ways:
            row = rows.get((file, way))
            if row is None:
                row = {"file": file, "way": way, **in_process(limit, measure, root / file, way)}
                with out.open("a") as lines:
                    lines.write(json.dumps(row) + "\n")
                print(file, way, row.get("parts"), row.get("error", ""), flush=True)
            if way == "shipped" and not asked and not CHANGED & set(row.get("steps", {})):
                break


def _faces_around(points: FloatArray) -> dict[str, Any]:
    _, found = pcu.make_mesh_watertight(points, np.array([[0, 1, 3], [0, 3, 2]], dtype=np.int32), LEAST_LEAVES, 0)
    return {"faces": len(found)}


def rectangles(count: int) -> None:
    """Count the hangs on rectangles in single precision, at their place and moved to the origin."""
    random = np.random.default_rng(0)
    hangs = Counter[str]()
    for _ in range(count):
        points = np.tile(random.uniform(-1, 1, 3), (4, 1))
        first, second = random.choice(3, 2, replace=False)
        points[[1, 3], first] += random.uniform(0.05, 0.5)
        points[[2, 3], second] += random.uniform(0.05, 0.5)
        points = points.astype(np.float32).astype(np.float64)
        for name, moved in (("as given", points), ("moved to the origin", points - (points[0] + points[3]) / 2)):
            hangs[name] += "error" in in_process(3.0, _faces_around, moved)
    print(f"hangs in {count} rectangles: {dict(hangs)}")


def table(out: Path) -> None:
    """Print one line a mesh and way, and the sums a way."""
    rows: dict[str, dict[str, dict[str, Any]]] = {}
    for line in out.read_text().splitlines():
        row = json.loads(line)
        rows.setdefault(row["file"], {})[row["way"]] = row
    rows = {file: ways for file, ways in rows.items() if len(ways) > 1}
    ways = list(dict.fromkeys(way for found in rows.values() for way in found))
    print("| mesh | steps | way | faces | repair s | cut s | parts | hulls' volume | over | under |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for file, found in sorted(rows.items()):
        steps = ", ".join(f"{step} {n}" for step, n in found["shipped"].get("steps", {}).items())
        for way, row in found.items():
            head = f"| {Path(file).stem[:40]} | {steps} | {way} "
            if "parts" not in row:
                print(head + f"| {row['error']} |")
                continue
            late = "" if row["cut_complete"] else " (stopped)"
            print(
                head
                + f"| {row['faces']} | {row['repair_seconds']:.2f} | {row['cut_seconds']:.2f}{late} | {row['parts']} "
                f"| {row['hull_volume']:.3f} | {row['over']:.3f} | {row['under']:.3f} |"
            )
    done = [found for found in rows.values() if all(found.get(way, {}).get("cut_complete") for way in ways)]
    print(f"\nmeshes {len(rows)}; {len(done)} where every way was done in time, which these sums are of:\n")
    if not done:
        return
    print("| way | parts | repair s | cut s | unfinished | over > 0.055 | under > 0.005 | mean over | mean under |")
    print("|---|---|---|---|---|---|---|---|---|")
    for way in ways:
        r = [found[way] for found in done]
        unfinished = sum(not found.get(way, {}).get("cut_complete") for found in rows.values())
        print(
            f"| {way} | {sum(x['parts'] for x in r)} | {sum(x['repair_seconds'] for x in r):.1f} "
            f"| {sum(x['cut_seconds'] for x in r):.1f} | {unfinished} "
            f"| {sum(x['over'] > 0.055 for x in r)} | {sum(x['under'] > 0.005 for x in r)} "
            f"| {np.mean([x['over'] for x in r]):.4f} | {np.mean([x['under'] for x in r]):.4f} |"
        )
    print(
        "\nBy the step that changes the mesh most; leaks: meshes whose solid lost over a tenth of the shipped volume.\n"
    )
    print("| step | meshes | shipped parts |" + "".join(f" {way} | leaks |" for way in ways[1:]))
    print("|---|---|---|" + "---|---|" * (len(ways) - 1))
    for step in ("capped", "slab", "wrapped"):
        every = [found for found in rows.values() if _heaviest(found["shipped"]) == step]
        some = [found for found in every if found in done]
        line = f"| {step} | {len(some)} | {sum(found['shipped']['parts'] for found in some)} |"
        for way in ways[1:]:
            parts = sum(found[way]["parts"] for found in some)
            line += f" {parts} | {sum(_leaks(found, way) for found in every)} of {len(every)} |"
        print(line)


def _heaviest(row: dict[str, Any]) -> str:
    return str(max(row["steps"], key=STEPS.index))


def _leaks(found: dict[str, dict[str, Any]], way: str) -> bool:
    return bool(found.get(way, {}).get("volume", 0.0) < 0.9 * found["shipped"]["volume"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path, nargs="?")
    parser.add_argument("--list", type=Path, help="file with one mesh a line, relative to the folder")
    parser.add_argument("--every", type=int, default=1, help="without a list: take only every Nth mesh")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--ways", default="each 1000,each 5000,each 20000,whole 5000,whole 20000")
    parser.add_argument("--limit", type=float, default=60, help="seconds one way may take for one mesh")
    parser.add_argument("--cores", help="run on these cores only, e.g. 0 or 0,1")
    parser.add_argument("--table", type=Path, help="print the tables of a finished run")
    parser.add_argument("--rectangles", type=int, help="count hangs on this many rectangles")
    args = parser.parse_args()
    if args.rectangles:
        rectangles(args.rectangles)
        return
    if args.table:
        table(args.table)
        return
    if args.cores:
        os.sched_setaffinity(0, {int(c) for c in args.cores.split(",")})
    ways = ["shipped", *args.ways.split(",")]
    run(args.root, args.list.read_text().split() if args.list else None, args.every, args.out, ways, args.limit)
    table(args.out)


if __name__ == "__main__":
    main()
