"""The overhead of a batch: meshes per minute, CPU time per task beyond the mesh's own, memory.

    python benchmarks/batch.py MESHES --count 60 --jobs 1 --jobs 2
    python benchmarks/batch.py MESHES --count 0 --jobs 2 --keep RESULTS

MESHES is a folder; every n-th of its meshes by name is taken, or all of them (0). Wall times are meaningful only on an
idle machine; CPU times barely depend on the load.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer

from rlacd.batch import find_assets

MB = 2**20


def measured(command: list[str]) -> tuple[float, float, float, float]:
    """Run a command; wall and CPU seconds of all its processes, and peak MB of the command and of all."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    watched, own, together = psutil.Process(process.pid), 0, 0
    while process.poll() is None:
        try:
            held = [watched.memory_info().rss]
            held += [child.memory_info().rss for child in watched.children(recursive=True)]
            own, together = max(own, held[0]), max(together, sum(held))
        except psutil.Error:
            pass
        time.sleep(0.1)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - start, cpu, own / MB, together / MB


def main(
    meshes: Path,
    count: int = 60,
    jobs: Annotated[list[int] | None, typer.Option()] = None,
    keep: Annotated[Path | None, typer.Option(help="Keep the results here.")] = None,
    option: Annotated[list[str] | None, typer.Option(help="Of rlacd batch, such as --option=--quality=best.")] = None,
) -> None:
    assets = find_assets(meshes)
    chosen = assets[:: max(1, len(assets) // count)][:count] if count else assets
    with tempfile.TemporaryDirectory() as folder:
        links = Path(folder, "meshes")
        links.mkdir()
        for asset in chosen:
            link = links / asset.name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(asset.path.resolve())
        print(f"{len(chosen)} meshes of {meshes}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}\n")
        print("| jobs | meshes/min | CPU s/mesh: median | mean | most | beside it, s/mesh | MB run | MB all |")
        print("|---|---|---|---|---|---|---|---|")
        for number in jobs or [1, 2]:
            out = Path(keep or folder, f"jobs{number}")
            command = [
                sys.executable,
                "-c",
                "from rlacd.cli.main import main; main()",
                "batch",
                str(links),
                "-o",
                str(out),
            ]
            command += ["--jobs", str(number), *(option or [])]
            wall, cpu, own, together = measured(command)
            _, idle, _, _ = measured(command)  # all results exist: starting, reading and hashing
            rows = [json.loads(line) for line in (out / "timings.jsonl").read_text().splitlines()]
            spent = np.array([row.get("cpu", 0.0) for row in rows])
            beside = (cpu - spent.sum()) / len(rows)
            print(
                f"| {number} | {60 * len(rows) / wall:.0f} | {np.median(spent):.2f} | {spent.mean():.2f} "
                f"| {spent.max():.2f} | {beside:.3f} | {own:.0f} | {together:.0f} |"
            )
            statuses = [json.loads(line)["status"] for line in (out / "manifest.jsonl").read_text().splitlines()]
            print(f"<!-- {idle:.2f} s CPU to pass over all; {dict((s, statuses.count(s)) for s in set(statuses))} -->")


if __name__ == "__main__":
    typer.run(main)
