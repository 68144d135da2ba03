"""Two builds of rlacd take turns on the same meshes: how much processor time each needs, and whether the hulls agree.

    python benchmarks/turns.py OLD/.venv/bin/python NEW/.venv/bin/python MESHES --list MESHES/quick.txt \\
        [--options '{"policy": "navacd", "criterion": {"radius": 0.05, "tolerance": 0.01}}'] [--repeat 2]

For machines that are never idle: one thread, processor time instead of the clock, the least of a few runs, and both
builds under the same load within seconds. Every build runs in a process of its own, warmed up by the first mesh.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
from pathlib import Path
from typing import Any

WORKER = """
import hashlib, json, sys, time
import numpy as np
import rlacd

options = json.loads(sys.argv[1])
if isinstance(options.get("criterion"), dict):
    options["criterion"] = rlacd.NavigableSpace(**options["criterion"])
for line in sys.stdin:
    start = time.process_time()
    result = rlacd.decompose(line.strip(), threads=1, **options)
    seconds = time.process_time() - start
    digest = hashlib.sha256()
    for hull in result:
        digest.update(np.ascontiguousarray(hull.vertices).tobytes())
        digest.update(np.ascontiguousarray(hull.faces).tobytes())
    print(json.dumps({"cpu": seconds, "parts": len(result), "digest": digest.hexdigest()}), flush=True)
"""


class Build:
    """One build, waiting for meshes."""

    def __init__(self, python: str, options: str) -> None:
        command = [python, "-c", WORKER, options]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def decompose(self, path: Path) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{path}\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit(f"a build ended on {path}")
        row: dict[str, Any] = json.loads(answer)
        return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", help="Python of an environment with one build")
    parser.add_argument("new", help="and with the other")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--list", type=Path, required=True, help="file with one mesh a line, relative to the folder")
    parser.add_argument("--options", default="{}", help="of rlacd.decompose, as JSON")
    parser.add_argument("--repeat", type=int, default=2)
    given = parser.parse_args()
    builds = [Build(python, given.options) for python in (given.old, given.new)]
    names = given.list.read_text().split()
    for build in builds:
        build.decompose(given.folder / names[0])
    seconds: list[tuple[float, float]] = []
    parts = [0, 0]
    different = 0
    for name in names:
        rows = [[build.decompose(given.folder / name) for build in builds] for _ in range(given.repeat)]
        old, new = (min(run[i]["cpu"] for run in rows) for i in (0, 1))
        same = rows[0][0]["digest"] == rows[0][1]["digest"]
        different += not same
        parts = [parts[i] + rows[0][i]["parts"] for i in (0, 1)]
        seconds.append((old, new))
        print(f"{name} {old:.3f} s -> {new:.3f} s, {new / old:.2f}{'' if same else ', other hulls'}", flush=True)
    sums = [sum(pair[i] for pair in seconds) for i in (0, 1)]
    medians = [statistics.median(pair[i] for pair in seconds) for i in (0, 1)]
    print(f"median {medians[0]:.3f} s -> {medians[1]:.3f} s, {medians[1] / medians[0]:.2f}")
    print(f"sum {sums[0]:.2f} s -> {sums[1]:.2f} s, {sums[1] / sums[0]:.2f}")
    print(f"median ratio {statistics.median(new / old for old, new in seconds):.2f}")
    print(f"parts {parts[0]} -> {parts[1]}, other hulls on {different} of {len(names)} meshes")


if __name__ == "__main__":
    main()
