"""Navigable space on real meshes: the greedy policies compared with CoACD.

    python benchmarks/navigable.py MESHES --list MESHES/quick.txt --out navigable.jsonl [--methods navacd,coacd]
    python benchmarks/navigable.py --table navigable.jsonl

Every method and mesh runs in its own process, pinned to the cores given. Ours are timed three times after a first run
(median; load, repair and report included), CoACD once, at its default threshold 0.05: it has no radius option, so
compare its distances and time, not its number of parts. Distances are those of `rlacd.solid.distance`, in the frame
where the longest side is 2. Finished rows are skipped.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

SETTINGS = {"r2.5t5": (0.025, 0.05), "r5t1": (0.05, 0.01)}
METHODS: dict[str, dict[str, Any]] = {
    "navacd": {"policy": "navacd", "quality": "fast"},
    "greedy-150": {"policy": "greedy-hull-sum", "quality": "fast"},
    "greedy-162": {"policy": "greedy-hull-sum+edges", "quality": "fast"},
    "greedy": {"quality": "fast"},
    "balanced": {"quality": "balanced"},
    "best": {"quality": "best", "budget": 5.0},
}
COACD_CRACKS = 1e-3
"""CoACD's hulls leave cracks of about 1e-5; cracks narrower than this are closed, or their walls would count."""


def run_ours(path: Path, method: str, setting: str, threads: int) -> dict[str, Any]:
    import rlacd

    space = rlacd.NavigableSpace(*SETTINGS[setting])
    rlacd.decompose(path, criterion=space, threads=threads, **METHODS[method])
    seconds, cpu = [], []
    for _ in range(3):
        wall, used = time.perf_counter(), time.process_time()
        result = rlacd.decompose(path, criterion=space, threads=threads, **METHODS[method])
        seconds.append(time.perf_counter() - wall)
        cpu.append(time.process_time() - used)
    report = result.report
    return {
        "parts": report["parts"],
        "hull_faces": report["faces"],
        **report["hausdorff"],
        "seconds": statistics.median(seconds),
        "cpu": statistics.median(cpu),
        "stages": report["seconds"],
        "navigable": {key: value for key, value in report["navigable"].items() if key != "intrusion"},
        "intrusion": report["navigable"]["intrusion"]["max"],
        "warnings": report["warnings"],
    }


def run_coacd(path: Path, threads: int) -> dict[str, Any]:
    import coacd

    from rlacd.io.read.load import load_mesh
    from rlacd.repair.repair import repair
    from rlacd.solid.distance import hull_union
    from rlacd.solid.hull import Hull

    coacd.set_log_level("error")
    source = load_mesh(path)
    wall, used = time.perf_counter(), time.process_time()
    pieces = coacd.run_coacd(coacd.Mesh(source.vertices, source.faces), threshold=0.05)
    seconds, cpu = time.perf_counter() - wall, time.process_time() - used
    solid = repair(source)
    hulls = [hull for v, _ in pieces if (hull := Hull.of(solid.frame.to_frame(v))) is not None]
    union, (vertices, faces) = hull_union(hulls, threads), solid.surface
    from rlacd import _native

    return {
        "parts": len(hulls),
        "hull_faces": int(sum(len(hull.faces) for hull in hulls)),
        "over": union.over(_native.Surface(vertices, faces), 2e-3, COACD_CRACKS, threads)[1],
        "under": union.under(vertices, faces, 2e-3, threads)[1],
        "seconds": seconds,
        "cpu": cpu,
    }


def one(path: Path, method: str, setting: str, cores: list[int]) -> None:
    os.sched_setaffinity(0, cores)
    row = run_coacd(path, len(cores)) if method == "coacd" else run_ours(path, method, setting, len(cores))
    row["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(row))


def everything(folder: Path, names: list[str], methods: list[str], out: Path, cores: str, limit: float) -> None:
    rows = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()] if out.exists() else []
    finished = {(row["file"], row["method"], row["setting"]) for row in rows}
    jobs = [(n, m, s) for n in names for m in methods for s in (SETTINGS if m != "coacd" else ["-"])]
    with out.open("a", encoding="utf-8") as file:
        for name, method, setting in jobs:
            if (name, method, setting) in finished:
                continue
            command = [sys.executable, __file__, "--one", str(folder / name), method, setting, "--cores", cores]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
                row = json.loads(done.stdout) if done.returncode == 0 else {"error": done.stderr.strip()[-500:]}
            except subprocess.TimeoutExpired:
                row = {"error": f"more than {limit:g} s"}
            file.write(json.dumps({"file": name, "method": method, "setting": setting, **row}) + "\n")
            file.flush()
            print(name, method, setting, row.get("parts"), f"{row.get('seconds', 0):.2f} s", row.get("error", ""))


def table(out: Path) -> None:
    rows = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    groups = sorted(
        {(row["setting"], row["method"]) for row in rows},
        key=lambda g: (g[0], list(METHODS).index(g[1]) if g[1] in METHODS else 9),
    )
    print(
        "| setting | method | meshes | parts | mean | hull faces | over: mean / most | under: mean / most "
        "| seconds: median / mean / most | peak MB |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for setting, method in groups:
        some = [row for row in rows if (row["setting"], row["method"]) == (setting, method) and "error" not in row]
        column = {
            key: np.array([row[key] for row in some], dtype=float)
            for key in ("parts", "hull_faces", "over", "under", "seconds", "peak_mb")
        }
        print(
            f"| {setting} | {method} | {len(some)} | {column['parts'].sum():.0f} | {column['parts'].mean():.1f} "
            f"| {column['hull_faces'].sum():.0f} | {column['over'].mean():.3f} / {column['over'].max():.3f} "
            f"| {column['under'].mean():.4f} / {column['under'].max():.3f} "
            f"| {np.median(column['seconds']):.2f} / {column['seconds'].mean():.2f} / {column['seconds'].max():.2f} "
            f"| {column['peak_mb'].max():.0f} |"
        )
    failed = [f"{row['file']} {row['method']} {row['setting']}: {row['error']}" for row in rows if "error" in row]
    print("\n".join(failed) if failed else "\nno failures")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--list", type=Path, help="file with one mesh a line, relative to the folder; default: all")
    parser.add_argument("--out", type=Path, default=Path("navigable.jsonl"))
    parser.add_argument("--methods", default=",".join(METHODS), help="comma-separated; coacd is one of them")
    parser.add_argument("--cores", default="0,1", help="pin to these cores")
    parser.add_argument("--limit", type=float, default=600, help="seconds a mesh and method")
    parser.add_argument("--table", type=Path, help="print the table of a finished run")
    parser.add_argument("--one", nargs=3, metavar=("PATH", "METHOD", "SETTING"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    cores = [int(core) for core in given.cores.split(",")]
    if given.one:
        one(Path(given.one[0]), given.one[1], given.one[2], cores)
    elif given.table:
        table(given.table)
    elif given.folder is None:
        parser.error("give a folder of meshes, or --table")
    else:
        endings = {".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"}
        names = (
            given.list.read_text().split()
            if given.list
            else [
                str(p.relative_to(given.folder)) for p in sorted(given.folder.rglob("*")) if p.suffix.lower() in endings
            ]
        )
        everything(given.folder, names, given.methods.split(","), given.out, given.cores, given.limit)


if __name__ == "__main__":
    main()
