"""Decompose every mesh of a folder and say what went wrong: crashes, hangs, invalid hulls, broken promises.

    python benchmarks/corpus.py MESHES/test --out test.jsonl [--jobs 2] [--limit 120] [--options '{"max_vertices": 32}']
    python benchmarks/corpus.py --table test.jsonl

Each mesh is decomposed in a worker process with one thread; a worker that crashes or exceeds the limit is replaced and
the mesh recorded. Finished meshes are not computed again, so a run can be stopped and resumed.
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
    """Count hulls that are not closed, outward oriented and convex, judged without our own kernels."""
    bad = 0
    for hull in hulls:
        vertices, faces = np.asarray(hull.vertices), np.asarray(hull.faces)
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        extent = np.ptp(vertices, axis=0).max()
        # Height of every vertex over every facet, but for needles, whose planes floating point cannot tell.
        sound = lengths > 1e-9 * extent**2
        heights = (vertices[None] - corners[sound, :1]) @ (normals[sound] / lengths[sound, None])[:, :, None]
        convex = heights.max(initial=0.0) <= 1e-6 * extent
        bad += not (hull.is_watertight and hull.is_winding_consistent and hull.volume > 0 and convex)
    return bad


def decompose_one(path: str, options: dict[str, Any]) -> dict[str, Any]:
    import rlacd

    start = time.process_time()
    try:
        result = rlacd.decompose(path, threads=1, **options)
    except rlacd.RlacdError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    report = result.report
    return {
        "cpu": time.process_time() - start,
        "parts": report["parts"],
        "invalid": invalid_hulls(result.hulls),
        "concavity": report["concavity"]["max"],
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
    finished = {json.loads(line)["file"] for line in out.read_text().splitlines()} if out.exists() else set()
    paths = [p for p in sorted(folder.rglob("*")) if p.suffix.lower() in ENDINGS]
    waiting = [p for p in paths if str(p.relative_to(folder)) not in finished][::-1]
    total, workers = len(waiting), [Worker(options) for _ in range(min(jobs, max(1, len(waiting))))]
    done = 0
    with out.open("a") as file:
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
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    good = [r for r in rows if "parts" in r]
    print(f"meshes {len(rows)}, decomposed {len(good)}")
    for kind in ("bug", "error"):
        for row in rows:
            if kind in row:
                print(f"  {kind}: {row['file']}: {row[kind]}")
    print(f"meshes with invalid hulls: {[r['file'] for r in good if r['invalid']]}")
    print(f"meshes with a part over the threshold: {[r['file'] for r in good if r['concavity'] > 0.05]}")
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
