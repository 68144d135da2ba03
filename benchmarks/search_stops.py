"""When a search is exhausted: what stopping earlier would save, and the parts it would cost.

    python benchmarks/search_stops.py run MESHES --list LIST --out searches.jsonl
    python benchmarks/search_stops.py table searches.jsonl

Decomposes meshes at the default level on one thread without giving up, and records after every batch of trials the work
and CPU seconds so far, the parts and the volume of their hulls. A rule that stops a search changes nothing before it
stops, so what each rule saves and costs follows exactly from that record; a smaller bound on work, which also shortens
the trials, is approximated. The oracle stops after the last trial that saved a part.

Ratios are to the whole search: geometric means over the meshes that need one, with a 95 % interval by resampling the
meshes; time is that of the whole decomposition. Finished runs are not repeated.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from policies import drawn

import rlacd
from rlacd.errors import RlacdError
from rlacd.search import levels, neighbourhood
from rlacd.search.budget import SearchBudget
from rlacd.search.operators import Trial


@dataclass(frozen=True)
class Point:
    """A search after a batch of trials: work, parts and hull volume of the best state, trials, CPU seconds so far."""

    work: int
    parts: int
    now: int
    volume: float
    trials: int
    cpu: float


def record(points: list[Point]) -> None:
    """Let searches append to `points`, and not give up."""
    levels.BOUNDED_PATIENCE = neighbourhood.PATIENCE
    make, portfolio = neighbourhood.Neighbourhood._make, levels._portfolio

    def made(state: neighbourhood.Neighbourhood, trials: Sequence[Trial], budget: SearchBudget) -> None:
        make(state, trials, budget)
        count, volume = neighbourhood.cost(state._best)
        points.append(Point(budget.work.done, count, len(state.parts), volume, len(trials), time.process_time()))

    def begun(context: Any, parts: Any, rankings: Any, budget: SearchBudget, *limits: float) -> Any:
        starts = portfolio(context, parts, rankings, budget, *limits)
        count, volume = neighbourhood.cost(starts[0])
        points.append(Point(budget.work.done, count, count, volume, 0, time.process_time()))
        return starts

    neighbourhood.Neighbourhood._make, levels._portfolio = made, begun  # type: ignore[assignment, method-assign]


@dataclass(frozen=True)
class Searched:
    """The record of one mesh."""

    points: list[Point]
    allowed: int
    cpu: float

    @property
    def last_gain(self) -> list[int]:
        """For every point, the first that had as few parts."""
        first, found = 0, []
        for i, point in enumerate(self.points):
            first = i if point.parts < self.points[first].parts else first
            found.append(first)
        return found

    def idle(self) -> Iterator[tuple[float, float, float]]:
        """For every point: trials per part, and shares of the allowed work, since the last gain; the latter in all."""
        for i, since in enumerate(self.last_gain):
            here = self.points[i]
            trials = sum(point.trials for point in self.points[since + 1 : i + 1])
            yield trials / here.now, (here.work - self.points[since].work) / self.allowed, here.work / self.allowed

    def stop(self, rule: Callable[[float, float, float], bool]) -> int:
        """The first point at which a rule stops."""
        return next((i for i, idle in enumerate(self.idle()) if rule(*idle)), len(self.points) - 1)


app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    meshes: Path,
    split: str = "test",
    faces: int = 12_000,
    listed: Annotated[Path | None, typer.Option("--list", help="Files in place of a split's.")] = None,
    first: Annotated[int | None, typer.Option(help="Only the first of them.")] = None,
    out: Path = Path("searches.jsonl"),
) -> None:
    """Decompose meshes and record their searches."""
    known = {json.loads(line)["file"] for line in out.read_text().splitlines()} if out.exists() else set()
    files = listed.read_text().split() if listed else drawn(meshes, split, faces)
    points: list[Point] = []
    record(points)
    with out.open("a", encoding="utf-8") as sink:
        for file in [file for file in files[:first] if file not in known]:
            points.clear()
            begun = time.process_time()
            try:
                report = rlacd.decompose(meshes / file, threads=1).report
            except RlacdError as error:
                print(f"{file}: {error}")
                continue
            row = {"cpu": time.process_time() - begun, "allowed": report["search"]["allowed"]}
            searched = [{**asdict(point), "cpu": point.cpu - begun} for point in points]
            print(json.dumps({"file": file, **row, "points": searched}), file=sink, flush=True)


def rules() -> dict[str, Callable[[float, float, float], bool]]:
    """By name: whether to stop, given the trials per part and the work since the last gain, and the work in all."""
    return {
        **{f"bound × {share:g}": lambda _, __, done, share=share: done >= share for share in (0.375, 0.5, 0.75)},
        **{
            f"{share:g} of the bound without a gain": lambda _, work, __, share=share: work >= share
            for share in (0.15, 0.25, 0.5)
        },
        **{f"{n} trials per part without a gain": lambda trials, _, __, n=n: trials >= n for n in (1, 2, 3, 4, 6)},
    }


@app.command()
def table(out: list[Path]) -> None:
    """Print what each rule saves and costs."""
    rows = [json.loads(line) for path in out for line in path.read_text(encoding="utf-8").splitlines()]
    searched = [Searched([Point(**point) for point in row["points"]], row["allowed"], row["cpu"]) for row in rows]
    searched = [own for own in searched if own.points and own.points[0].parts > 1]
    whole = sum(own.points[-1].work > 0.9 * own.allowed for own in searched)
    print(f"{len(searched)} meshes, {whole} of which use more than 0.9 of the bound\n")
    print("| stop | parts | ratio | hull volume | CPU of the search saved | time, mean ratio | of the sums |")
    print("|---|---:|---|---|---:|---:|---:|")
    _line("never", searched, [len(own.points) - 1 for own in searched])
    _line("oracle", searched, [own.last_gain[-1] for own in searched])
    for name, rule in rules().items():
        _line(name, searched, [own.stop(rule) for own in searched])


def _line(name: str, searched: list[Searched], stops: list[int]) -> None:
    here = [own.points[i] for own, i in zip(searched, stops, strict=True)]
    ends, starts = [own.points[-1] for own in searched], [own.points[0] for own in searched]
    parts = np.log([a.parts / b.parts for a, b in zip(here, ends, strict=True)])
    volume = np.log([a.volume / b.volume for a, b in zip(here, ends, strict=True)])
    skipped = np.array([b.cpu - a.cpu for a, b in zip(here, ends, strict=True)])
    searching = sum(b.cpu - a.cpu for a, b in zip(starts, ends, strict=True))
    cpu = np.array([own.cpu for own in searched])
    print(
        f"| {name} | {sum(point.parts for point in here)} | {_interval(parts)} | {np.exp(volume.mean()):.4f} | "
        f"{skipped.sum() / searching:.0%} | {np.exp(np.log1p(-skipped / cpu).mean()):.2f} | "
        f"{1 - skipped.sum() / cpu.sum():.2f} |"
    )


def _interval(logs: NDArray[np.float64]) -> str:
    resampled = np.random.default_rng(0).integers(len(logs), size=(10_000, len(logs)))
    low, high = np.exp(np.quantile(logs[resampled].mean(axis=1), (0.025, 0.975)))
    return f"{np.exp(logs.mean()):.4f} ({low:.4f} to {high:.4f})"


if __name__ == "__main__":
    app()
