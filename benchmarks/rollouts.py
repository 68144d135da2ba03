"""The overhead of a request to a pool.

    python benchmarks/rollouts.py --jobs 2
    python benchmarks/rollouts.py --ray local --jobs 2

CPU seconds are those of this process and all its descendants, and barely depend on the load; wall times are meaningful
only on an idle machine. With Ray, the CPU time of Ray's own servers is reported separately.
"""

from __future__ import annotations

import json
import resource
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import psutil
import trimesh
import typer

from rlacd.batch import Batch, JobSpec
from rlacd.pool import open_pool

app = typer.Typer(add_completion=False)

SERVERS = ("raylet", "gcs_server", "dashboard", "log_monitor", "monitor.py", "runtime_env")

Ray = Annotated[str | None, typer.Option(help="A cluster: local, auto, or its address.")]


class Used:
    """Wall and CPU seconds since the start."""

    def __init__(self) -> None:
        self._start, self._own, self._others = time.perf_counter(), self._seconds(), self._family()

    def spent(self) -> dict[str, float]:
        """Seconds: ``wall``; ``own``, of this process; ``workers``, and ``servers``, Ray's."""
        now = self._family()
        spent = {kind: now[kind] - self._others[kind] for kind in now}
        return {"wall": time.perf_counter() - self._start, "own": self._seconds() - self._own, **spent}

    def _seconds(self) -> float:
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return usage.ru_utime + usage.ru_stime

    def _family(self) -> dict[str, float]:
        """CPU seconds by kind of process; the time of an ended process is part of its parent's, which waited for it."""
        spent = {"workers": 0.0, "servers": 0.0}
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent["workers"] += usage.ru_utime + usage.ru_stime
        for process in psutil.Process().children(recursive=True):
            try:
                times, words = process.cpu_times(), " ".join(process.cmdline())
            except psutil.Error:
                continue
            kind = "servers" if any(name in words for name in SERVERS) else "workers"
            spent[kind] += times.user + times.system + times.children_user + times.children_system
        return spent


class _Nothing:
    def begin(self, meshes: int) -> None: ...

    def passed_over(self, asset: Any) -> None: ...

    def started(self, asset: Any) -> None: ...

    def finished(self, row: Any, timing: Any) -> None: ...


@app.command()
def boxes(count: int = 300, jobs: int = 2, ray: Ray = None) -> None:
    """Run a batch of boxes, which need no cut, and print the overhead of each beside its decomposition."""
    with tempfile.TemporaryDirectory() as folder, open_pool(jobs, ray) as pool:
        for part in ("warm", "boxes"):
            for number in range(count if part == "boxes" else 2 * jobs):
                path = Path(folder, part, f"{number:04d}.stl")
                path.parent.mkdir(exist_ok=True)
                trimesh.creation.box((1, 2, 3 + number / count)).export(path)
        for part in ("warm", "boxes"):
            usage, out = Used(), Path(folder, f"out-{part}")
            Batch(Path(folder, part), str(out), JobSpec.of({"quality": "fast"})).run(pool, _Nothing())
            spent = usage.spent()
        rows = [json.loads(line) for line in (out / "timings.jsonl").read_text().splitlines()]
        mesh = sum(row["cpu"] for row in rows)
    spent["workers"] -= mesh
    each = {name: f"{1000 * seconds / count:.2f} ms" for name, seconds in spent.items()}
    beside = ", ".join(f"{name} {spent}" for name, spent in each.items())
    print(f"{count} boxes, {1000 * mesh / count:.2f} ms each; beside it: {beside}")


if __name__ == "__main__":
    app()
