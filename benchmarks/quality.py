r"""The benefit of searching: hulls of every quality level against one pass, and CPU seconds on one core.

    python benchmarks/quality.py MESHES --list MESHES/quick.txt --out quality.jsonl
    python benchmarks/quality.py --table quality.jsonl [--baseline earlier.jsonl]

Runs with one thread, pinned to one core where the system allows it. All seconds, the search's budget included, are CPU
seconds, independent of the load. Finished runs are skipped.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

import rlacd

METHODS: dict[str, dict[str, Any]] = {
    "fast, greedy-hull-sum": {"quality": "fast", "policy": "greedy-hull-sum"},
    "fast": {"quality": "fast"},
    "balanced": {"quality": "balanced"},
    "best, 5 s": {"quality": "best", "budget": 5.0},
    "best, 10 s": {"quality": "best", "budget": 10.0},
}
BASELINES = ("fast, greedy-hull-sum", "fast")


def measure(path: Path, options: dict[str, Any]) -> dict[str, Any]:
    start = time.process_time()
    result = rlacd.decompose(path, threads=1, **options)
    cpu = time.process_time() - start
    report = result.report
    error = report["concavity"]
    return {"parts": len(result), "cpu": cpu, "search": report["search"], "error": error["max"]}


def table(rows: list[dict[str, Any]], baseline: list[dict[str, Any]]) -> str:
    """Mean ratios of hulls and time over the meshes, of those that all methods, `fast` among them, have run on."""
    runs = {(row["mesh"], row["method"]): row for row in rows}
    compared = {(row["mesh"], row["method"]): row["parts"] for row in baseline}
    methods = [m for m in METHODS if any(row["method"] == m for row in rows)]
    meshes = [mesh for mesh in dict.fromkeys(row["mesh"] for row in rows) if all((mesh, m) in runs for m in methods)]
    names = [name for name in BASELINES if any(name == method for _, method in compared)]
    lines = [
        f"| {len(meshes)} meshes | hulls | {' | '.join(f'/ {name}' for name in names)} | CPU s: mean, median "
        "| / fast: median, worst | largest error |",
        "|---|---|" + "---|" * len(names) + "---|---|---|",
    ]
    for method in methods:
        some = [runs[mesh, method] for mesh in meshes]
        cells = [method, str(sum(run["parts"] for run in some))]
        for name in names:
            ratios = np.array([run["parts"] / compared[run["mesh"], name] for run in some])
            cells.append(f"{ratios.mean():.3f} ± {ratios.std(ddof=1) / np.sqrt(len(ratios)):.3f}")
        seconds = [run["cpu"] for run in some]
        slower = [runs[mesh, method]["cpu"] / runs[mesh, "fast"]["cpu"] for mesh in meshes]
        cells += [f"{np.mean(seconds):.2f}, {np.median(seconds):.2f}", f"{np.median(slower):.2f}, {max(slower):.2f}"]
        cells.append(f"{max(run['error'] for run in some):.4f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="?", help="folder that the names in the list are relative to")
    parser.add_argument("--list", type=Path, help="file with one mesh a line")
    parser.add_argument("--out", type=Path, help="JSON lines, one run a line")
    parser.add_argument("--thresholds", type=Path, help="JSON object of thresholds by mesh; 0.05 by default")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--table", type=Path, help="print the table of such a file")
    parser.add_argument("--baseline", type=Path, help="with hulls of the same methods, run at an earlier commit")
    args = parser.parse_args()
    if args.table is not None:
        rows, baseline = (
            [json.loads(line) for line in path.read_text().splitlines()]
            for path in (args.table, args.baseline or args.table)
        )
        print(table(rows, baseline))
        return
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    time.perf_counter = time.process_time  # the budget's clock too
    lines = args.out.read_text().splitlines() if args.out.exists() else []
    thresholds = json.loads(args.thresholds.read_text()) if args.thresholds else {}
    done = {(row["mesh"], row["method"]) for row in map(json.loads, lines)}
    for name in args.list.read_text().split():
        for method in args.methods:
            if (name, method) in done:
                continue
            row = {
                "mesh": name,
                "method": method,
                **measure(args.meshes / name, {"threshold": thresholds.get(name, 0.05), **METHODS[method]}),
            }
            with args.out.open("a") as out:
                out.write(json.dumps(row) + "\n")
            print(name, method, row["parts"], f"{row['cpu']:.1f} s", flush=True)


if __name__ == "__main__":
    main()
