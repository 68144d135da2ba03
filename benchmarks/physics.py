"""Ten tasks in two physics engines, with the hulls of every tool."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping
from pathlib import Path

import click
import trimesh

from benchmarks.cli import OUT, PATH, write
from benchmarks.compare import machine
from benchmarks.engines import ENGINES, STEP, Hulls
from benchmarks.film import film
from benchmarks.runner import Bench
from benchmarks.simulate import get_mujoco
from benchmarks.store import Row, Task, load_hulls, load_row, save_row
from benchmarks.tables import Page, Table
from benchmarks.tasks import SHAPES, TASKS, mesh_of
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import MissingExtraError

WAYS = {
    "rlacd (default)": "default",
    "rlacd `fast`": "fast",
    "CoACD": "coacd",
    "CoACD, as many hulls": "coacd-hulls",
    "V-HACD, as many hulls": "vhacd",
}
"""Titles and methods; as many hulls as the first, for each shape."""


@click.command()
@OUT
@click.option("--film", "shown", type=PATH, help="A GIF of two of the tasks too.")
def app(out: Path, shown: Path | None) -> None:
    """Ten tasks in MuJoCo and PyBullet, with the hulls of rlacd, CoACD and V-HACD; needs rlacd[sim].

    \b
    python -m benchmarks physics --out RUN
    """
    with exit_codes():
        _check()
        exact = {name: mesh_of(name) for name in SHAPES}
        (out / "shapes").mkdir(parents=True, exist_ok=True)
        for name, mesh in exact.items():
            mesh.export(out / "shapes" / f"{name}.ply")
        bench = Bench(out / "shapes", [f"{name}.ply" for name in SHAPES], out, say=click.echo)
        ways = decompositions(bench)
        rows = {way: [row for task in TASKS for row in simulated(bench, task, way, exact, ways[way])] for way in ways}
        about = f"Ten tasks, {len(SHAPES)} shapes, steps of {1000 * STEP:g} ms; {machine()}, one thread."
        write(Page("Physics", [about, summary(ways, rows), details(rows)]), out, "physics")
        if shown is not None:
            film(shown, exact, {way: ways[way] for way in (*WAYS,)[:: len(WAYS) - 1]})


def _check() -> None:
    get_mujoco()
    try:
        import pybullet  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("PyBullet is missing: run  pip install 'rlacd[sim]'  and try again.") from error


def decompositions(bench: Bench) -> dict[str, Hulls]:
    """The hulls of every shape, by the title of the tool."""
    first = bench.run("default")
    found: dict[str, Hulls] = {}
    for title, method in WAYS.items():
        if title.endswith("as many hulls"):
            tasks = [Task(row["mesh"], method, row["parts"]) for row in first]
        else:
            tasks = [Task(row["mesh"], method, row["setting"]) for row in first]
        bench.run_tasks(tasks)
        hulls = {Path(task.mesh).stem: load_hulls(bench.hulls_of(task))[0] for task in tasks}
        found[title] = {name: [trimesh.Trimesh(v, f, process=False) for v, f in some] for name, some in hulls.items()}
    return found


def simulated(bench: Bench, task: str, way: str, exact: Mapping[str, trimesh.Trimesh], hulls: Hulls) -> list[Row]:
    """A row for each engine: whether the task was passed, the deepest contact in metres, steps per CPU second."""
    rows = []
    for engine, world_of in ENGINES.items():
        name = Task(task, f"{way} in {engine}", sum(map(len, hulls.values())))
        row = load_row(bench.folder, name)
        if row is None:
            scene = TASKS[task]()
            world = world_of(scene, exact, hulls)
            steps, began = round(scene.seconds / STEP), time.process_time()
            deepest = max(world.step() for _ in range(steps))
            rate = steps / (time.process_time() - began)
            row = {
                "task": task,
                "engine": engine,
                "passed": bool(scene.passed(world)),
                "deepest": deepest,
                "rate": rate,
            }
            save_row(bench.folder, name, row)
        bench.say(f"{way}: {row}")
        rows.append(row)
    return rows


def summary(ways: Mapping[str, Hulls], rows: Mapping[str, list[Row]]) -> Table:
    """A line for each tool."""
    lines = []
    for way, some in rows.items():
        deepest = [1000 * row["deepest"] for row in some]
        passed = [sum(row["passed"] for row in some if row["engine"] == engine) for engine in ENGINES]
        rates = [row["rate"] for row in some if row["task"] == "pile of fifty"]
        lines.append(
            [
                *(way, sum(map(len, ways[way].values())), *passed),
                *(f"{statistics.median(deepest):.1f}, {max(deepest):.0f}", *(f"{rate:.0f}" for rate in rates)),
            ]
        )
    passed_in = [f"passed in {engine}" for engine in ENGINES]
    return Table(
        ["", "hulls", *passed_in, "deepest contact, mm: median, worst", *(f"pile, {name} steps/s" for name in ENGINES)],
        lines,
    )


def details(rows: Mapping[str, list[Row]]) -> Table:
    """Each task with each tool."""
    lines = []
    for same in zip(*rows.values(), strict=True):
        cells = [f"{'yes' if row['passed'] else 'NO'} / {1000 * row['deepest']:.1f}" for row in same]
        lines.append([f"{same[0]['task']}, {same[0]['engine']}", *cells])
    return Table(["task, engine", *rows], lines, "Passed / deepest contact, mm.")
