r"""What searching brings: hulls of every quality level, against one pass, and the CPU seconds of one core they take.

    python benchmarks/quality.py MESHES --list MESHES/quick.txt --out quality.jsonl [--seconds 10]
    python benchmarks/quality.py --table quality.jsonl

Runs with one thread, pinned to one core where the system can. Seconds are CPU seconds, so that a busy machine does not
matter: a search is cancelled when its CPU time is over. One search, as long as the largest budget, gives the counts of
the shorter ones too, since it goes through the same states. Finished meshes are not computed again.
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

BASELINES = ("greedy-hull-sum", "greedy")
BUDGETS = (0.5, 1.0, 2.0, 5.0, 10.0)


class Stopwatch:
    """A progress callback that notes the parts over the CPU seconds of the search, and ends it in time."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.start: float | None = None
        self.trace: list[tuple[float, int]] = []

    def __call__(self, progress: rlacd.Progress) -> bool:
        if progress.stage != "search":
            return True
        now = time.process_time()
        self.start = now if self.start is None else self.start
        self.trace.append((now - self.start, progress.parts))
        return now - self.start < self.seconds

    def parts_after(self, seconds: float) -> int:
        return next(parts for when, parts in reversed(self.trace) if when <= seconds)


def measure(path: Path, seconds: float) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for policy in BASELINES:
        row[policy] = _timed(path, policy=policy)
    row["balanced"] = _timed(path, quality="balanced")
    watch = Stopwatch(seconds)
    best = _timed(path, quality="best", search_steps=10**6, progress=watch)
    row["best"] = {**best, "after": {str(b): watch.parts_after(b) for b in BUDGETS if b <= seconds}}
    return row


def _timed(path: Path, **options: Any) -> dict[str, Any]:
    start = time.process_time()
    result = rlacd.decompose(path, threads=1, **options)
    cpu = time.process_time() - start
    report = result.report
    return {
        "parts": len(result),
        "cpu": cpu,
        "search": report["search"],
        "concavity": report["concavity"]["max"],
        "repaired_from": len(result.source.faces),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Means over the meshes of the ratio of hulls, with their standard errors."""
    lines = [
        f"| {len(rows)} meshes | hulls | / greedy-hull-sum | / greedy | CPU s, mean (median) | worst concavity |",
        "|---|---|---|---|---|---|",
    ]

    def line(name: str, counts: list[int], seconds: list[float], worst: float) -> None:
        cells = [name, str(sum(counts))]
        for baseline in BASELINES:
            ratios = np.array([n / row[baseline]["parts"] for n, row in zip(counts, rows, strict=True)])
            cells.append(f"{ratios.mean():.3f} ± {ratios.std(ddof=1) / np.sqrt(len(ratios)):.3f}")
        cells += [f"{np.mean(seconds):.2f} ({np.median(seconds):.2f})", f"{worst:.4f}"]
        lines.append("| " + " | ".join(cells) + " |")

    def add(name: str, key: str) -> None:
        runs = [row[key] for row in rows]
        worst = max(run["concavity"] for run in runs)
        line(name, [run["parts"] for run in runs], [run["cpu"] for run in runs], worst)

    for baseline in BASELINES:
        add(f"fast, {baseline}", baseline)
    add("balanced", "balanced")
    for budget in BUDGETS:
        if all(str(budget) in row["best"]["after"] for row in rows):
            counts = [row["best"]["after"][str(budget)] for row in rows]
            seconds = [min(row["greedy"]["cpu"] + budget, row["best"]["cpu"]) for row in rows]
            line(f"best, {budget:g} s", counts, seconds, max(row["best"]["concavity"] for row in rows))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="?", help="folder that the names in the list are relative to")
    parser.add_argument("--list", type=Path, help="file with one mesh a line")
    parser.add_argument("--out", type=Path, help="JSON lines, one mesh a line")
    parser.add_argument("--seconds", type=float, default=10.0, help="longest budget of the search")
    parser.add_argument("--table", type=Path, help="print the table of such a file")
    args = parser.parse_args()
    if args.table is not None:
        print(table([json.loads(line) for line in args.table.read_text().splitlines()]))
        return
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    done = {json.loads(line)["mesh"] for line in args.out.read_text().splitlines()} if args.out.exists() else set()
    for name in args.list.read_text().split():
        if name in done:
            continue
        row = {"mesh": name, **measure(args.meshes / name, args.seconds)}
        with args.out.open("a") as out:
            out.write(json.dumps(row) + "\n")
        print(name, {key: value["parts"] for key, value in row.items() if isinstance(value, dict)}, flush=True)


if __name__ == "__main__":
    main()
