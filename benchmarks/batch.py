"""The overhead of a batch: meshes per minute, CPU seconds per task beyond the mesh's own, memory."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np
import psutil

from benchmarks.cli import PATH
from benchmarks.tables import Table
from rlacd.batch import find_assets


def measured(command: list[str]) -> tuple[float, float, float]:
    """Run a command: wall seconds, CPU seconds of all its processes, and its own peak MB."""
    before, start, most = psutil.Process().cpu_times(), time.perf_counter(), 0
    process = psutil.Popen(command, stderr=subprocess.DEVNULL)
    while process.poll() is None:
        with contextlib.suppress(psutil.Error):
            most = max(most, process.memory_info().rss)
        time.sleep(0.1)
    after = psutil.Process().cpu_times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - start, cpu, most / 2**20


@click.command()
@click.argument("meshes", type=PATH)
@click.option("--count", default=0, help="Every n-th mesh by name, so many of them; 0: all.")
@click.option("--jobs", multiple=True, type=int, default=[1, 2], show_default=True, help="May be repeated.")
@click.option(
    "--option", multiple=True, default=["--quality=fast"], help="Of rlacd batch, such as --option=--ray=local."
)
def app(meshes: Path, count: int, jobs: tuple[int, ...], option: tuple[str, ...]) -> None:
    """Run a batch in other numbers of processes, twice each: the second time, all results exist.

    Wall times are meaningful only on an idle machine; CPU seconds barely depend on the load.

    \b
    python -m benchmarks batch ../shared/meshes/test --count 60 --jobs 1 --jobs 2
    """
    assets = find_assets(meshes)
    chosen = assets[:: max(1, len(assets) // count)][:count] if count else assets
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        links = Path(folder, "meshes")
        for asset in chosen:
            (links / asset.name).parent.mkdir(parents=True, exist_ok=True)
            (links / asset.name).symlink_to(asset.path.resolve())
        for number in jobs:
            out = Path(folder, f"jobs{number}")
            command = [sys.executable, "-m", "rlacd", "batch", str(links), "-o", str(out), "--jobs", str(number)]
            wall, cpu, memory = measured([*command, *option])
            _, again, _ = measured([*command, *option])
            rows = [json.loads(line) for line in (out / "timings.jsonl").read_text().splitlines()]
            spent = np.array([row.get("cpu", 0.0) for row in rows])
            lines.append(
                [
                    number,
                    f"{60 * len(rows) / wall:.0f}",
                    f"{np.median(spent):.2f}, {spent.mean():.2f}, {spent.max():.2f}",
                    f"{(cpu - spent.sum()) / len(rows):.3f}",
                    f"{memory:.0f}, {max(row.get('peak_mb', 0) for row in rows):.0f}",
                    f"{again:.2f}",
                ]
            )
    header = ["jobs", "meshes/min", "CPU s: median, mean, most", "beside it, each", "MB: run, worker", "again, CPU s"]
    note = f"{len(chosen)} meshes, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}."
    click.echo(Table(header, lines, note))
