r"""Decompose every mesh of a folder and report failures: crashes, hangs, invalid hulls, broken promises.

    python benchmarks/corpus.py MESHES/test --out test.jsonl [--jobs 2] [--limit 120] [--options '{"max_vertices": 32}']
    python benchmarks/corpus.py MESHES/test --out space.jsonl --options \
        '{"criterion": {"radius": 0.05, "tolerance": 0.01}, "policy": "navacd"}'
    python benchmarks/corpus.py --table test.jsonl

Each mesh is decomposed in a worker process with one thread; if a worker crashes or exceeds the limit, it is replaced
and the mesh recorded. Finished meshes are skipped, so a run can be stopped and resumed.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import time
from collections import Counter
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import numpy as np

ENDINGS = {".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"}


def invalid_hulls(hulls: list[Any]) -> int:
    """Count hulls that are not closed, outward oriented and convex, without using our kernels."""
    bad = 0
    for hull in hulls:
        vertices, faces = np.asarray(hull.vertices), np.asarray(hull.faces)
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        extent = np.ptp(vertices, axis=0).max()
        # Height of every vertex over every facet except needles, whose plane is not defined in floating point.
        sound = lengths > 1e-9 * extent**2
        heights = (vertices[None] - corners[sound, :1]) @ (normals[sound] / lengths[sound, None])[:, :, None]
        convex = heights.max(initial=0.0) <= 1e-6 * extent
        bad += not (hull.is_watertight and hull.is_winding_consistent and hull.volume > 0 and convex)
    return bad


def overlapped_balls(hulls: list[Any], balls: Any, slack: float) -> int:
    """Count hull-ball pairs that overlap by more than `slack`, without using our kernels."""
    count = 0
    for hull in hulls:
        corners = hull.triangles
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals[lengths[:, 0] > 0] / lengths[lengths[:, 0] > 0]
        offsets = (normals @ np.asarray(hull.vertices).T).max(axis=1)
        # A ball beyond one facet's plane is disjoint; only the others need a distance.
        height = np.full(len(balls), -np.inf)
        for normal, offset in zip(normals, offsets, strict=True):
            np.maximum(height, balls.centres @ normal - offset, out=height)
        near = np.flatnonzero(height < balls.radii - slack)
        distance = distance_to_triangles(balls.centres[near], corners)
        count += int(np.count_nonzero((height[near] <= 0) | (distance < balls.radii[near] - slack)))
    return count


def distance_to_triangles(points: Any, corners: Any) -> Any:
    """Distances [N]: to the plane of each triangle if the projection falls inside, and always to its three edges."""
    best = np.full(len(points), np.inf)
    if len(points) == 0:
        return best
    for a, b, c in corners:
        for start, end in ((a, b), (b, c), (c, a)):
            along = end - start
            t = np.clip((points - start) @ along / max(along @ along, 1e-300), 0, 1)
            best = np.minimum(best, np.linalg.norm(points - start - t[:, None] * along, axis=1))
        normal = np.cross(b - a, c - a)
        if (length := np.linalg.norm(normal)) > 0:
            normal = normal / length
            inside = np.ones(len(points), dtype=bool)
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= (points - start) @ np.cross(normal, end - start) >= 0
            best[inside] = np.minimum(best[inside], np.abs((points[inside] - a) @ normal))
    return best


def decompose_one(path: str, options: dict[str, Any]) -> dict[str, Any]:
    import rlacd

    space = options.get("criterion")
    if isinstance(space, dict):
        options = {**options, "criterion": rlacd.NavigableSpace(**space)}
    start = time.process_time()
    try:
        result = rlacd.decompose(path, threads=1, **{"quality": "fast", **options})
    except rlacd.RlacdError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    cpu = time.process_time() - start
    report = result.report
    extra: dict[str, Any] = {}
    if result.balls is not None:
        slack = 1e-7 * float(np.ptp(result.source.vertices, axis=0).max())
        account = {key: value for key, value in report["navigable"].items() if key != "intrusion"}
        extra = {**account, "overlapped": overlapped_balls(result.hulls, result.balls, slack)}
    return {
        "cpu": cpu,
        "parts": report["parts"],
        "invalid": invalid_hulls(result.hulls),
        "concavity": report["concavity"]["max"] if "concavity" in report else None,
        **extra,
        **report["hausdorff"],
        "seconds": report["seconds"],
        "steps": dict(Counter(body["step"] for body in report["repair"])),
        "warnings": report["warnings"],
        "faces": len(result.source.faces),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def work(pipe: Connection, options: dict[str, Any]) -> None:
    while (path := pipe.recv()) is not None:
        try:
            pipe.send(decompose_one(path, options))
        except Exception as error:
            pipe.send({"bug": f"{type(error).__name__}: {error}"})


class Worker:
    def __init__(self, options: dict[str, Any]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, options), daemon=True)
        self.process.start()
        theirs.close()
        self.path: Path | None = None
        self.since = 0.0

    def start(self, path: Path) -> None:
        self.path, self.since = path, time.monotonic()
        self.pipe.send(str(path))

    def result(self) -> dict[str, Any]:
        try:
            answer: dict[str, Any] = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            answer = {"bug": f"the process died (exit code {self.process.exitcode})"}
        return answer


def run(folder: Path, out: Path, jobs: int, limit: float, options: dict[str, Any]) -> None:
    finished = (
        {json.loads(line)["file"] for line in out.read_text(encoding="utf-8").splitlines()} if out.exists() else set()
    )
    paths = [p for p in sorted(folder.rglob("*")) if p.suffix.lower() in ENDINGS]
    waiting = [p for p in paths if str(p.relative_to(folder)) not in finished][::-1]
    total, workers = len(waiting), [Worker(options) for _ in range(min(jobs, max(1, len(waiting))))]
    done = 0
    with out.open("a", encoding="utf-8") as file:
        while waiting or any(w.path for w in workers):
            for worker in workers:
                if worker.path is None and waiting:
                    worker.start(waiting.pop())
            ready = wait([w.pipe for w in workers if w.path], timeout=1)
            for i, worker in enumerate(workers):
                if worker.path is None:
                    continue
                if worker.pipe in ready:
                    row = worker.result()
                elif time.monotonic() - worker.since > limit:
                    worker.process.kill()
                    worker.process.join()
                    row = {"bug": f"no result after {limit:g} s"}
                else:
                    continue
                file.write(json.dumps({"file": str(worker.path.relative_to(folder)), **row}) + "\n")
                file.flush()
                done += 1
                print(f"\r{done}/{total} {worker.path.name[:60]:60s}", end="", file=sys.stderr)
                worker.path = None
                if not worker.process.is_alive():
                    workers[i] = Worker(options)
    for worker in workers:
        worker.pipe.send(None)
    print(file=sys.stderr)


def table(out: Path) -> None:
    rows = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    good = [r for r in rows if "parts" in r]
    print(f"meshes {len(rows)}, decomposed {len(good)}")
    for kind in ("bug", "error"):
        for row in rows:
            if kind in row:
                print(f"  {kind}: {row['file']}: {row[kind]}")
    print(f"meshes with invalid hulls: {[r['file'] for r in good if r['invalid']]}")
    print(f"meshes with a part over the threshold: {[r['file'] for r in good if (r['concavity'] or 0) > 0.05]}")
    spacious = [r for r in good if "balls" in r]
    if spacious:
        print(f"meshes with a hull that overlaps a final ball: {[r['file'] for r in spacious if r['overlapped']]}")
        gave_way = [(r["file"], r["shrunk"], r["dropped"], r["most"]) for r in spacious if r["shrunk"] or r["dropped"]]
        print(f"meshes whose balls gave way (shrunk, dropped, most): {gave_way}")
    print("\n| repair step | bodies | meshes |\n|---|---|---|")
    bodies, meshes = Counter[str](), Counter[str]()
    for row in good:
        bodies.update(row["steps"])
        meshes.update(row["steps"].keys())
    for step, count in bodies.most_common():
        print(f"| {step} | {count} | {meshes[step]} |")
    print("\n| | median | mean | 95 % | max |\n|---|---|---|---|---|")
    for name, values in {
        "CPU seconds": [r["cpu"] for r in good],
        "parts": [r["parts"] for r in good],
        "over (frame)": [r["over"] for r in good if r["over"] is not None],
        "under (frame)": [r["under"] for r in good if r["under"] is not None],
        "repair seconds": [r["seconds"]["repair"] for r in good],
    }.items():
        v = np.array(values)
        print(f"| {name} | {np.median(v):.4g} | {v.mean():.4g} | {np.quantile(v, 0.95):.4g} | {v.max():.4g} |")
    for name in ("over", "under", "cpu", "parts"):
        worst = sorted((r for r in good if r[name] is not None), key=lambda r: -r[name])[:10]
        print(f"\nten worst by {name}:")
        for r in worst:
            steps = ", ".join(f"{k} {v}" for k, v in r["steps"].items())
            print(f"  {r[name]:.4g}  {r['file']}  ({r['faces']} faces, {r['parts']} parts; {steps})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit", type=float, default=120, help="seconds a mesh may take")
    parser.add_argument("--options", type=json.loads, default={}, help="options of decompose, as JSON")
    parser.add_argument("--table", type=Path, help="print the table of a finished run")
    args = parser.parse_args()
    if args.table:
        table(args.table)
    else:
        run(args.folder, args.out, args.jobs, args.limit, args.options)
        table(args.out)


if __name__ == "__main__":
    main()
