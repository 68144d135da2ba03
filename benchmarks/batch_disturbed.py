r"""A batch that is killed again and again, here and on a Ray cluster, against one that was left alone.

    python benchmarks/batch.py MESHES --count 0 --jobs 2 --keep CALM --option=--quality=fast
    python benchmarks/batch_disturbed.py MESHES CALM/jobs2 OUT --option=--quality=fast

At 20 % of the meshes the run and its workers get SIGKILL, at 35 % again. It goes on over Ray, on a cluster of two nodes
of one processor each beside its head; at half of the meshes one of the nodes is killed and another one joins, at 75 %
the run gets SIGKILL again. Then it is let finish on this machine, and every byte is compared.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from filecmp import cmp
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from ray.cluster_utils import Cluster

from rlacd.fleet import find_assets

TIMES = "timings.jsonl"
"""The file that differs from run to run."""

RLACD = [sys.executable, "-c", "from rlacd.cli import main; main()"]


def rows_of(out: Path) -> int:
    """Count the meshes that have a row, in the manifest or in the journals."""
    rows = 0
    for path in (out / "manifest.jsonl", out / ".rlacd" / "manifest.jsonl"):
        if path.exists():
            rows = max(rows, path.read_bytes().count(b"\n"))
    return rows


def run_until(command: list[str], out: Path, share: float, most: int, then: Callable[[], None] | None = None) -> None:
    """Run a batch up to a share of the meshes, then kill it with all its processes; up to the end if that is 1."""
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    start, first = time.perf_counter(), rows_of(out)
    while process.poll() is None and (share == 1 or rows_of(out) < share * most):
        time.sleep(0.2)
        if then is not None and rows_of(out) >= most / 2:
            then()
            then = None
    if process.poll() is None:
        family = [*psutil.Process(process.pid).children(recursive=True), psutil.Process(process.pid)]
        for member in family:
            if member.is_running():
                os.kill(member.pid, signal.SIGKILL)
    code = process.wait()
    wall = time.perf_counter() - start
    print(f"| {' '.join(command[3:4] + command[6:])} | {first} to {rows_of(out)} | {wall:.0f} | {code} |", flush=True)


def differences(calm: Path, disturbed: Path) -> tuple[int, list[str]]:
    """Compare all files of two folders byte for byte; how many there are, and those that differ or are missing."""
    files = {
        path.relative_to(folder).as_posix()
        for folder in (calm, disturbed)
        for path in folder.rglob("*")
        if path.is_file() and path.name != TIMES and path.name != "lock"
    }
    wrong = [
        name
        for name in sorted(files)
        if not ((calm / name).is_file() and (disturbed / name).is_file())
        or not cmp(calm / name, disturbed / name, shallow=False)
    ]
    return len(files), wrong


def main(
    meshes: Path,
    calm: Path,
    out: Path,
    option: Annotated[list[str] | None, typer.Option(help="Of rlacd batch, such as --option=--quality=fast.")] = None,
) -> None:
    most = len(find_assets(meshes))
    command = [*RLACD, "batch", str(meshes), "-o", str(out), *(option or [])]
    print("| command | rows | wall s | exit code |\n|---|---|---|---|")
    for share in (0.2, 0.35):
        run_until([*command, "--jobs", "2"], out, share, most)

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    nodes: list[Any] = [cluster.add_node(num_cpus=1) for _ in range(2)]
    cluster.wait_for_nodes()

    def lose_a_node() -> None:
        cluster.remove_node(nodes[0], allow_graceful=False)
        print("| (a node is killed, another one joins) | | | |", flush=True)
        nodes.append(cluster.add_node(num_cpus=1))

    try:
        run_until([*command, "--ray", cluster.address], out, 0.75, most, then=lose_a_node)
    finally:
        cluster.shutdown()
    run_until([*command, "--jobs", "2"], out, 1, most)

    files, wrong = differences(calm, out)
    print(f"\n{files} files compared, {len(wrong)} differ or are missing")
    print("\n".join(wrong[:20]))


if __name__ == "__main__":
    typer.run(main)
