"""The overhead of a batch: meshes per minute, CPU seconds per task beyond the mesh's own, memory."""

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

from benchmarks.tables import Table
from rlacd.batch import find_assets

app = typer.Typer(add_completion=False)

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


@app.command()
def batch(
    meshes: Path,
    count: Annotated[int, typer.Option(help="Every n-th mesh by name, so many of them; 0: all.")] = 60,
    jobs: Annotated[list[int] | None, typer.Option(help="May be repeated; default: 1 and 2.")] = None,
    option: Annotated[list[str] | None, typer.Option(help="Of rlacd batch, such as --option=--ray=local.")] = None,
) -> None:
    """Run a batch in other numbers of processes, twice each: the second time, all results exist.

    Wall times are meaningful only on an idle machine; CPU seconds barely depend on the load.

    \b
    python -m benchmarks batch ../shared/meshes/test --count 60 --jobs 1 --jobs 2 --option=--quality=fast
    """
    assets = find_assets(meshes)
    chosen = assets[:: max(1, len(assets) // count)][:count] if count else assets
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        links = Path(folder, "meshes")
        for asset in chosen:
            link = links / asset.name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(asset.path.resolve())
        for number in jobs or [1, 2]:
            out = Path(folder, f"jobs{number}")
            command = [sys.executable, "-m", "rlacd", "batch", str(links), "-o", str(out), "--jobs", str(number)]
            command += option or []
            wall, cpu, own, together = measured(command)
            again = measured(command)[1]
            rows = [json.loads(line) for line in (out / "timings.jsonl").read_text().splitlines()]
            spent = np.array([row.get("cpu", 0.0) for row in rows])
            seconds = f"{np.median(spent):.2f}, {spent.mean():.2f}, {spent.max():.2f}"
            beside = f"{(cpu - spent.sum()) / len(rows):.3f}"
            lines.append(
                [number, f"{60 * len(rows) / wall:.0f}", seconds, beside, f"{again:.2f}", f"{own:.0f}, {together:.0f}"]
            )
    header = ["jobs", "meshes/min", "CPU s: median, mean, most", "beside it, each", "again, all", "MB: run, all"]
    note = f"{len(chosen)} meshes, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}."
    print(Table(header, lines, note))
