"""Parts that policies leave on the same meshes, before and after merging, compared with controls.

    python benchmarks/policies.py run MESHES --split test --out parts.jsonl
    python benchmarks/policies.py table parts.jsonl --base greedy-150 --base random-10+12

Every policy cuts the same repaired solids on one thread until each part meets the criterion. Parts are counted three
times: *raw*, after cutting; *NavACD's*, after uniting pairs that touch, as NavACD does; *merged*, after also uniting
pairs across what lies between them, as `rlacd.decompose` does. Ratios are geometric means over the meshes, with a 95 %
interval by resampling the meshes. Copies of a policy with 24 or 26 planes per axis show what chance alone does.

Files with more than `--faces` faces and solids that need no cut are left out, the others taken in a fixed random order.
Finished runs are not repeated.
"""

from __future__ import annotations

import csv
import json
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rlacd.clock import Clock
from rlacd.criteria import Concavity, Criterion, NavigableSpace
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.meshes import shuffled
from rlacd.merge import merge_parts
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import Greedy, Policy, make_policy
from rlacd.policies.shortlist import RandomShortlist
from rlacd.repair.repair import repair
from rlacd.solid.component import Component
from rlacd.solid.solid import Solid
from rlacd.workers import Workers

COUNTS = {"raw": "raw", "touching": "NavACD's merging", "merged": "merged"}

MOST = 1000
"""Parts at which cutting stops: the counts are then too small, not too large."""

Result = dict[str, dict[str, float]]


def hull_sum(per_axis: int, edges: int) -> Callable[[float], Policy]:
    """The paper's greedy over `per_axis` planes along each of six axes, and those of concave edges."""
    return lambda scale: Greedy("hull-sum", sweeps=SweepCache(per_axis, edges))


def named(name: str) -> Callable[[float], Policy]:
    if Path(name, "options.json").exists():
        from rlacd.learn.q_network import load_policy

        return lambda scale: load_policy(Path(name))
    return lambda scale: make_policy(name, SweepCache(), scale)


ARMS: dict[str, Callable[[float], Policy]] = {
    "greedy-150": named("greedy-hull-sum"),
    "greedy-150, 24 an axis": hull_sum(24, 0),
    "greedy-150, 26 an axis": hull_sum(26, 0),
    "greedy-162": named("greedy-hull-sum+edges"),
    "greedy-162, 24 an axis": hull_sum(24, 4),
    "greedy-162, 26 an axis": hull_sum(26, 4),
    "random-10+12": named("random-10+edges"),
    "random-10+12, second draw": lambda scale: RandomShortlist(10, seed=1),
    "random-1+12": named("random-1+edges"),
    "random-10": named("random-10"),
    "navacd": named("navacd"),
    "excess-norm+12 (`greedy`)": named("greedy"),
}
"""What is compared: name to a function from the criterion's length to a policy."""


def drawn(folder: Path, split: str, faces: int) -> list[str]:
    """The files of a split with at most `faces` faces, in a fixed random order."""
    with (folder / "index.csv").open() as index:
        files = {row["file"]: int(row["faces"]) for row in csv.DictReader(index) if row["split"] == split}
    return shuffled([file for file, number in files.items() if number <= faces], seed=0)


def solid_of(path: Path, turned: bool) -> Solid:
    """A file's solid, turned at random if asked for."""
    mesh = load_mesh(path)
    if turned:
        vertices = Rotation.random(random_state=zlib.crc32(path.name.encode())).apply(np.asarray(mesh.vertices))
        mesh = load_mesh((vertices, mesh.faces))
    return repair(mesh, threads=1)


def count(root: Component, policy: Policy, criterion: Criterion) -> dict[str, float]:
    """Parts in the three ways of `COUNTS`; CPU seconds of cutting and of cutting and merging."""
    start = time.process_time()
    with Workers(1) as workers:
        clock = Clock()
        done = cut_and_merge(CutTree(root, policy, workers), criterion, workers, clock, merge=False, most=MOST)
        cut = time.process_time()
        touching = merge_parts(done.pieces, done.criterion, workers, clock)
        merged = merge_parts(touching, done.criterion, workers, clock, solid=root)
    counts = {"raw": len(done.pieces), "touching": len(touching), "merged": len(merged)}
    return {**counts, "unmet": len(done.unmet), "cut_cpu": cut - start, "cpu": time.process_time() - start}


app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    meshes: Path,
    split: str = "test",
    faces: int = 12_000,
    listed: Annotated[Path | None, typer.Option("--list", help="Files in place of a split's.")] = None,
    first: Annotated[int | None, typer.Option(help="Only the first of them.")] = None,
    arms: Annotated[
        list[str] | None, typer.Option("--arm", help="A key of ARMS, a policy's name, or a training run.")
    ] = None,
    threshold: float = 0.05,
    space: Annotated[bool, typer.Option(help="Navigable space (5 %, 1 %) in place of concavity.")] = False,
    turned: bool = False,
    out: Path = Path("policies.jsonl"),
) -> None:
    """Run policies on meshes."""
    policies = {name: ARMS.get(name) or named(name) for name in arms or ARMS}
    known = read(out)
    files = listed.read_text().split() if listed else drawn(meshes, split, faces)
    with out.open("a", encoding="utf-8") as sink:
        for file in files[:first]:
            missing = {name: policy for name, policy in policies.items() if name not in known.get(file, {})}
            if not missing:
                continue
            try:
                solid = solid_of(meshes / file, turned)
                root = Component(solid.shape)
                goal: Criterion = NavigableSpace(0.05, 0.01).prepare(solid, 1) if space else Concavity(threshold)
                if goal.is_met(root):
                    continue  # nothing to cut: every policy has the same parts
            except (RlacdError, ValueError) as error:
                print(f"{file}: {error}")
                continue
            scale = threshold if not space else goal.overhang
            for name, policy in missing.items():
                counted = count(Component(solid.shape), policy(scale), goal)
                print(json.dumps({"file": file, "arm": name, **counted}), file=sink, flush=True)


def read(out: Path) -> dict[str, Result]:
    """Results by mesh and arm."""
    results: dict[str, Result] = {}
    for row in map(json.loads, out.read_text(encoding="utf-8").splitlines() if out.exists() else ()):
        results.setdefault(row.pop("file"), {})[row.pop("arm")] = row
    return results


@app.command()
def table(
    out: list[Path],
    base: Annotated[list[str] | None, typer.Option(help="What ratios are to; default: the first arm.")] = None,
    arms: Annotated[list[str] | None, typer.Option("--arm", help="Default: all of the first mesh.")] = None,
) -> None:
    """Print counts and ratios over the meshes that every arm has finished."""
    results: dict[str, Result] = {}
    for path in out:
        for file, rows in read(path).items():
            results.setdefault(file, {}).update(rows)
    arms = arms or list(next(iter(results.values())))
    whole = [rows for rows in results.values() if all(arm in rows for arm in arms)]
    values = {arm: np.array([[rows[arm][key] for key in (*COUNTS, "cpu")] for rows in whole]) for arm in arms}
    resampled = np.random.default_rng(0).integers(len(whole), size=(10_000, len(whole)))
    print(f"| {len(whole)} meshes | {', '.join(COUNTS.values())} parts in all | CPU s |\n|---|---|---|")
    for arm, measured in values.items():
        *counts, cpu = measured.sum(axis=0)
        print(f"| {arm} | {', '.join(f'{count:.0f}' for count in counts)} | {cpu:.0f} |")
    for reference in base or arms[:1]:
        print(f"\n| to {reference} | {' | '.join(COUNTS.values())} | fewer, more merged | deviation of one mesh |")
        print("|---" * (len(COUNTS) + 3) + "|")
        for arm in arms:
            if arm != reference:
                logs = np.log(values[arm][:, :-1] / values[reference][:, :-1])
                cells = [_with_interval(column, resampled) for column in logs.T]
                merged = logs[:, -1]
                cells += [f"{(merged < 0).sum()}, {(merged > 0).sum()}", f"{merged.std():.3f}"]
                print(f"| {arm} | {' | '.join(cells)} |")


def _with_interval(logs: NDArray[np.float64], resampled: NDArray[np.int64]) -> str:
    low, high = np.exp(np.quantile(logs[resampled].mean(axis=1), (0.025, 0.975)))
    return f"{np.exp(logs.mean()):.3f} ({low:.3f} to {high:.3f})"


if __name__ == "__main__":
    app()
