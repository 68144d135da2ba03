"""The cost of training episodes by where they are played, and the overhead of a request to a pool.

    python benchmarks/rollouts.py train MESHES --count 150 --jobs 0 --jobs 1 --jobs 2
    python benchmarks/rollouts.py overhead --jobs 2
    python benchmarks/rollouts.py overhead --ray local --jobs 2
    python benchmarks/rollouts.py boxes --jobs 2
    python benchmarks/rollouts.py boxes --ray local --jobs 2

CPU seconds are those of this process and all its descendants, and barely depend on the load; wall times are meaningful
only on an idle machine. With Ray, the CPU time of Ray's own servers is reported separately.
"""

from __future__ import annotations

import dataclasses
import json
import resource
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import psutil
import trimesh
import typer

from rlacd.batch import Batch, JobSpec, find_assets
from rlacd.pool import Pool, Request, Shared, answers, open_pool

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


@app.command()
def train(
    meshes: Path,
    count: int = 150,
    jobs: Annotated[list[int] | None, typer.Option()] = None,
    ray: Ray = None,
    cuts: int = 3000,
    warmup: int = 1000,
    environments: int = 4,
) -> None:
    """Train briefly and print cuts per second and CPU seconds, of the learner and of the players."""
    import rlacd.learn.paper.train as module
    from rlacd.learn.paper.options import TrainOptions

    module.export_policy = lambda path, *_: path  # type: ignore[assignment]  # not what is measured
    changes = {"iterations": cuts, "warmup": warmup, "validation": 0, "environments": environments}
    options = TrainOptions.preset("two-cores", **changes)
    assets = find_assets(meshes)
    print("| jobs | cuts | wall s | learner CPU s | players CPU s | cuts/s on an idle machine |")
    print("|---|---|---|---|---|---|")
    for number in jobs or [0, 1, 2]:
        with tempfile.TemporaryDirectory() as folder:
            links = Path(folder, "meshes")
            for asset in assets[:: max(1, len(assets) // count)][:count]:
                link = links / asset.name
                link.parent.mkdir(parents=True, exist_ok=True)
                link.symlink_to(asset.path.resolve())
            with open_pool(number if ray is None else None, ray) as pool:
                usage = Used()
                module.train(links, Path(folder, "run"), options, say=lambda _: None, pool=pool)
                spent = usage.spent()
            made = json.loads(Path(folder, "run", "checkpoint", "state.json").read_text(encoding="utf-8"))["cuts"]
        slowest = spent["own"] if number == 0 else max(spent["own"], spent["workers"] / number)
        print(
            f"| {number} | {made} | {spent['wall']:.0f} | {spent['own']:.1f} | {spent['workers']:.1f} "
            f"| {made / slowest:.0f} |"
        )


@app.command()
def overhead(count: int = 300, jobs: int = 2, ray: Ray = None) -> None:
    """Request episodes of an invalid solid: measures the round trip, without and with a new network each time."""
    import torch
    from safetensors.torch import save

    from rlacd.learn.encoders import make_encoder
    from rlacd.learn.meshes import NOTHING, SOLID, pack_solid
    from rlacd.learn.paper.options import TrainOptions
    from rlacd.learn.paper.qnetwork import QNetwork
    from rlacd.learn.paper.rollout_server import SERVER

    torch.set_num_threads(1)
    options = TrainOptions.preset("two-cores")
    setting = Shared({"options": json.dumps(dataclasses.asdict(options)).encode()})
    weights = save(QNetwork(make_encoder(options.encoder).dim).state_dict())
    files, values = {SOLID: pack_solid(*NOTHING)}, {"axis": 0, "degrees": 0.0, "epsilon": 1.0, "seed": [0]}

    def requests(networks: bool) -> Any:
        for number in range(count):
            shared = {"setting": setting, **({"network": Shared({"weights": weights})} if networks else {})}
            yield number, Request(SERVER, values, files, shared)

    print(f"a network is {len(weights) / 1e6:.1f} MB")
    with open_pool(jobs, ray) as pool:
        _ask(pool, requests(False), 0)  # starts the processes
        for networks in (False, True):
            _ask(pool, requests(networks), count, "with a new network" if networks else "with nothing")


def _ask(pool: Pool, requests: Any, count: int, what: str = "") -> None:
    usage = Used()
    for _, answer in answers(pool, requests):
        if isinstance(answer, Exception):
            raise answer
    if count:
        spent = {name: f"{1000 * seconds / count:.2f}" for name, seconds in usage.spent().items()}
        print(f"{what}: " + ", ".join(f"{name} {value} ms" for name, value in spent.items()) + " a request")


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
