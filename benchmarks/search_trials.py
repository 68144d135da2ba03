"""Which trials of a search save parts, how well that can be told beforehand, and what an order by it would be worth.

    python benchmarks/search_trials.py run MESHES --split train --faces 4000 --first 260 --out trials.jsonl
    python benchmarks/search_trials.py table trials.jsonl

Decomposes meshes on one thread with twice the default's bound on work and twice its patience, and records every trial:
what is known before it is made, its work, whether it was accepted, and the parts it saved.

An order is played on the record: trials are charged their work until a share of the default's bound is spent, and parts
are saved by those that saved some. A trial of parts that the search made comes after the accepted trials among the
eight before them, in every order. So an order can use no trial that the search did not make, and the second trial of a
part may come before the first: what is printed flatters all orders but that of the search itself.

The model is a logistic regression for each operator, and a linear one of the logarithm of the work, fitted to four
fifths of the meshes and used on the others. Intervals: 95 %, by resampling the meshes.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from policies import drawn

import rlacd
from rlacd import _native
from rlacd.errors import RlacdError
from rlacd.search import levels, neighbourhood
from rlacd.search.budget import SearchBudget
from rlacd.search.operators import BATCH, Operator, Trial
from rlacd.search.part_graph import Cluster
from rlacd.search.recut import Exchange
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull

NEAREST = 12
"""Takers whose facets are compared with the giver's corners."""

FAR = 9.0
"""In place of an error or a distance, in thresholds, that does not exist."""

SHARES = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25)
FOLDS = 5
RIDGE = 20.0

Floats = NDArray[np.float64]


class Recorder(neighbourhood.Neighbourhood):
    """A search that appends a row for each trial to `rows`."""

    rows: list[dict[str, Any]]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._made = 0
        self._born: dict[int, int] = dict.fromkeys(self._graph.parts, 0)
        self._tried: Counter[Any] = Counter()
        self._found: dict[int, tuple[bool, int, int]] = {}

    def _try(self, trial: Trial, clock: Any) -> Exchange | None:
        exchange = super()._try(trial, clock)
        self._found[id(trial)] = exchange is not None, exchange.gain if exchange else 0, clock.work.done
        return exchange

    def _make(self, trials: Sequence[Trial], budget: SearchBudget) -> None:
        rows = [self._known(trial) for trial in trials]
        super()._make(trials, budget)
        for trial, row in zip(trials, rows, strict=True):
            accepted, gain, work = self._found.pop(id(trial))
            self.rows.append({**row, "accepted": accepted, "gain": gain, "work": work})
            self._tried.update([trial.cluster, *trial.cluster, *((trial.move, i) for i in trial.cluster)])
        self._made += len(trials)
        for i in self._graph.parts:
            self._born.setdefault(i, self._made)

    def _known(self, trial: Trial) -> dict[str, Any]:
        graph, threshold = self._graph, self._context.criterion.threshold  # type: ignore[attr-defined]
        root = self._context.root
        cluster = [graph.parts[i] for i in trial.cluster]
        around = trial.around if trial.policy is None else graph.around(trial.cluster)
        ranks = {i: k for k, i in enumerate(sorted(graph.parts, key=lambda i: graph.parts[i].hull.volume))}
        boxes = np.array([part.box for part in cluster])
        sides = np.sort(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)) / threshold
        hulls = [part.hull.volume for part in cluster]
        row = {
            "operator": trial.move.name,
            "number": self._made,
            "size": len(cluster),
            "policy": -1 if trial.policy is None else trial.policy,
            "parts": len(graph.parts),
            "around": len(around),
            "price": self._operators.price(trial),
            "rate": self._operators._kinds[trial.move, len(cluster)].rate,
            "faces": sum(part.size for part in cluster),
            "members": sum(len(part.members) for part in cluster),
            "corners": sum(len(part.hull.vertices) for part in cluster),
            "corners_around": sum(len(graph.parts[i].hull.vertices) for i in around),
            "faces_around": sum(graph.parts[i].size for i in around),
            "faces_of_all": root.size,
            "share": sum(hulls) / root.hull.volume,
            "to_mean": max(hulls) / np.mean([part.hull.volume for part in graph.parts.values()]),
            "filled": sum(part.volume for part in cluster) / sum(hulls),
            "least_rank": min(ranks[i] for i in trial.cluster) / len(ranks),
            "greatest_rank": max(ranks[i] for i in trial.cluster) / len(ranks),
            **dict(zip(("shortest", "middle", "longest"), sides.tolist(), strict=True)),
            "age": self._made - max(self._born[i] for i in trial.cluster),
            "age_around": self._made - max((self._born[i] for i in around), default=0),
            "of_first": float(np.mean([self._born[i] == 0 for i in trial.cluster])),
            "tried": sum(self._tried[i] for i in trial.cluster) / len(cluster),
            "tried_so": sum(self._tried[trial.move, i] for i in trial.cluster) / len(cluster),
            "tried_same": self._tried[trial.cluster],
        }
        if trial.policy is None:
            return row | self._of_giving(cluster[0], trial.cluster[0], around, threshold)
        return row | self._of_joining(cluster, trial.cluster, threshold)

    def _of_giving(self, part: Part, which: int, around: Cluster, threshold: float) -> dict[str, Any]:
        """How far the joint hulls with the takers are from the criterion, and the part's corners from their hulls."""
        if not around:
            return {"touching": 0}
        takers = [self._graph.parts[i] for i in around]
        pairs = np.array([[0, k + 1] for k in range(len(takers))], dtype=np.int32)
        joint = _native.joint_hull_volumes([p.hull.vertices for p in (part, *takers)], pairs, 1)
        errors = sorted(self._error([part, taker], v) / threshold for taker, v in zip(takers, joint, strict=True))
        growth = (joint - np.array([taker.hull.volume for taker in takers])) / part.hull.volume
        nearest = np.argsort(growth, kind="stable")[:NEAREST]
        away = np.maximum([_outside(part.hull.vertices, takers[k].hull) for k in nearest], 0) / threshold
        least = away.min(axis=0)
        return {
            "touching": len(self._graph._gaps[which]),
            "error": errors[0],
            "second_error": (*errors, FAR)[1],
            "growth": float(growth.min()),
            "farthest": float(least.max()),
            "mean_distance": float(least.mean()),
            "share_outside": float((least > 0.5).mean()),
            "one_taker": float(away.max(axis=1).min()),
            "larger": float(np.mean([taker.hull.volume > part.hull.volume / 2 for taker in takers])),
        }

    def _of_joining(self, cluster: Sequence[Part], which: Cluster, threshold: float) -> dict[str, Any]:
        """How far the joint hull of a cluster is from the criterion, and those of the pairs in it that touch."""
        joint = Hull.around(*[part.hull for part in cluster]).volume
        gaps = [g / threshold for i in which for j, g in self._graph._gaps[i].items() if j in which and i < j]
        return {
            "joint_error": self._error(cluster, joint) / threshold,
            "joint_filled": sum(part.volume for part in cluster) / joint,
            "least_gap": min(gaps),
            "mean_gap": float(np.mean(gaps)),
            "greatest_gap": max(gaps),
            "pairs": len(gaps),
        }

    def _error(self, parts: Sequence[Part], joint: float) -> float:
        screen = self._context.criterion.screen
        return screen.least_error(sum(screen.filled(part) for part in parts), joint)


def _outside(points: Floats, hull: Hull) -> Floats:
    """How far points [N, 3] are beyond the facet plane that they are farthest beyond; negative inside."""
    a, b, c = (hull.vertices[hull.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals, a = normals[lengths > 1e-14] / lengths[lengths > 1e-14, None], a[lengths > 1e-14]
    distances: Floats = (points @ normals.T - (normals * a).sum(axis=1)).max(axis=1)
    return distances


app = typer.Typer(add_completion=False, help=__doc__)


@app.command()
def run(
    meshes: Path,
    split: str = "train",
    faces: int = 4_000,
    first: Annotated[int | None, typer.Option(help="Only so many of them.")] = None,
    out: Path = Path("trials.jsonl"),
) -> None:
    """Decompose meshes and record the trials of their searches."""
    for name in ("TIMES_FIRST_PASS", "LEAST_WORK", "MOST_WORK", "BOUNDED_PATIENCE"):
        setattr(levels, name, 2 * getattr(levels, name))
    levels.Neighbourhood = Recorder  # type: ignore[misc]
    portfolio, opening = levels._portfolio, [0]

    def recorded(context: Any, parts: Any, rankings: Any, budget: SearchBudget, *limits: float) -> Any:
        starts = portfolio(context, parts, rankings, budget, *limits)
        opening[:] = [budget.work.done]
        return starts

    levels._portfolio = recorded
    known = {json.loads(line)["file"] for line in out.read_text().splitlines()} if out.exists() else set()
    with out.open("a", encoding="utf-8") as sink:
        for file in [file for file in drawn(meshes, split, faces)[:first] if file not in known]:
            Recorder.rows = []
            try:
                search = rlacd.decompose(meshes / file, threads=1).report["search"]
            except RlacdError as error:
                print(f"{file}: {error}")
                continue
            row = {"file": file, "bound": search["allowed"] / 2 - opening[0], "parts": search["portfolio"]}
            print(json.dumps({**row, "trials": Recorder.rows}, default=float), file=sink, flush=True)


class Record:
    """All trials of all meshes: `column(name)` is what is known, or NaN where an operator does not know it."""

    def __init__(self, rows: Sequence[dict[str, Any]]) -> None:
        self.trials = [trial for row in rows for trial in row["trials"]]
        self.starts = np.cumsum([0, *(len(row["trials"]) for row in rows[:-1])])
        self.mesh = np.repeat(np.arange(len(rows)), [len(row["trials"]) for row in rows])
        self.parts = np.array([row["parts"] for row in rows], dtype=float)
        self.bound = np.array([max(row["bound"], 1) for row in rows], dtype=float)
        self.gain, self.work, self.accepted = (self.column(name) for name in ("gain", "work", "accepted"))
        self.operator = np.array([trial["operator"] for trial in self.trials])
        self.waits_for = self._after()

    def column(self, name: str) -> Floats:
        return np.array([trial.get(name, math.nan) for trial in self.trials], dtype=float)

    def _after(self) -> list[list[int]]:
        """For every trial, the earlier ones that may have made its parts, as indices into all."""
        first = self.starts[self.mesh]
        born = (self.column("number") - self.column("age")).astype(int)
        return [
            [i for i in range(first[t] + max(born[t] - BATCH, 0), first[t] + born[t]) if self.accepted[i]]
            for t in range(len(self.trials))
        ]

    def play(self, score: Floats) -> Floats:
        """Parts [shares, meshes] when the trials of the highest score come first."""
        left = np.repeat(self.parts[None], len(SHARES), axis=0)
        for k in range(len(self.parts)):
            order = _in_order(np.flatnonzero(self.mesh == k), score, self.waits_for)
            spent = np.cumsum(self.work[order])
            for row, share in enumerate(SHARES):
                left[row, k] -= self.gain[order][spent <= share * self.bound[k]].sum()
        return left


def _in_order(trials: NDArray[np.int64], score: Floats, waits_for: list[list[int]]) -> list[int]:
    waiting = trials[np.argsort(-score[trials], kind="stable")].tolist()
    done: dict[int, None] = {}
    while waiting:
        k = next(k for k, trial in enumerate(waiting) if all(i in done for i in waits_for[trial]))
        done[waiting.pop(k)] = None
    return list(done)


def _predicted(record: Record) -> tuple[Floats, Floats]:
    """The chance that a trial saves a part, and its work, each by a model that never saw its mesh."""
    outcomes = {"operator", "number", "accepted", "gain", "work"}
    fold = np.random.default_rng(0).permutation(len(record.parts))[record.mesh] % FOLDS
    saves, work = record.gain > 0, np.log(record.work + 300)
    chance, price = np.zeros(len(work)), np.zeros(len(work))
    for move in Operator:
        own = record.operator == move.name
        names = [name for name in record.trials[np.flatnonzero(own)[0]] if name not in outcomes]
        known = np.stack([_spread(np.nan_to_num(record.column(name)[own], nan=FAR)) for name in names], axis=1)
        known = np.hstack([(known - known.mean(axis=0)) / (known.std(axis=0) + 1e-9), np.ones((own.sum(), 1))])
        for k in range(FOLDS):
            fit, use = fold[own] != k, fold[own] == k
            weights = _logistic(known[fit], saves[own][fit])
            chance[np.flatnonzero(own)[use]] = 1 / (1 + np.exp(-known[use] @ weights))
            square = known[fit].T @ known[fit] + RIDGE * np.eye(len(weights))
            weights = np.linalg.solve(square, known[fit].T @ work[own][fit])
            price[np.flatnonzero(own)[use]] = np.exp(known[use] @ weights)
    return chance, price


def _spread(values: Floats) -> Floats:
    """Counts and volumes go over orders of magnitude, shares and errors do not."""
    return np.log(values + 1e-3) if values.min() >= 0 and values.max() > FAR else values


def _logistic(known: Floats, saves: NDArray[np.bool_]) -> Floats:
    """Weights of a logistic regression with a ridge on all but the last, by Newton's method with shortened steps."""
    ridge = np.append(np.full(known.shape[1] - 1, RIDGE), 1e-6)

    def loss(weights: Floats) -> float:
        values = known @ weights
        return float(np.logaddexp(0, values).sum() - values[saves].sum() + ridge @ weights**2 / 2)

    weights = np.zeros(known.shape[1])
    weights[-1] = math.log((saves.sum() + 1) / (len(saves) + 1))
    for _ in range(25):
        chance = 1 / (1 + np.exp(-known @ weights))
        hessian = (known * (chance * (1 - chance))[:, None]).T @ known + np.diag(ridge)
        step = np.linalg.solve(hessian, known.T @ (chance - saves) + ridge * weights)
        while loss(weights - step) > loss(weights) and np.abs(step).max() > 1e-6:
            step /= 2
        weights -= step
    return weights


def _area(saves: NDArray[np.bool_], score: Floats) -> float:
    """The area under the curve of true against false positives."""
    ranks = np.argsort(np.argsort(score)) + 1
    positive = int(saves.sum())
    return float((ranks[saves].sum() - positive * (positive + 1) / 2) / (positive * (len(saves) - positive)))


@app.command()
def table(out: list[Path]) -> None:
    """Print where the work goes, how well gains are predicted, and what each order would be worth."""
    rows = [json.loads(line) for path in out for line in path.read_text(encoding="utf-8").splitlines()]
    record = Record([row for row in rows if row["trials"]])
    chance, price = _predicted(record)
    saves, work = record.gain > 0, record.work
    print(f"{len(record.parts)} meshes\n")
    _heading(
        "operator", "trials", "of the work", "parts saved", "per million units", "of its work saves", "accepted", "area"
    )
    for name, own in [*((m.name.lower(), record.operator == m.name) for m in Operator), ("all", work > -1)]:
        spent, gained = work[own].sum(), record.gain[own].sum()
        print(
            f"| {name} | {own.sum()} | {spent / work.sum():.0%} | {gained:.0f} | {gained / spent * 1e6:.1f} | "
            f"{work[own & saves].sum() / spent:.1%} | {work[own & (record.accepted > 0)].sum() / spent:.0%} | "
            f"{_area(saves[own], chance[own]):.2f} |"
        )
    best = np.argsort(-chance / price)
    best = best[np.cumsum(work[best]) < work.sum() / 10]
    first = np.concatenate([np.cumsum(own) < own.sum() / 10 for own in np.split(work, record.starts[1:])])
    print(
        f"\nThe best tenth of the work by the prediction saves {record.gain[best].sum() / record.gain.sum():.0%}; ",
        end="",
    )
    print(f"the first tenth of each search {record.gain[first].sum() / record.gain.sum():.0%}.\n")
    number, redistributed = record.column("number"), record.operator == Operator.REDISTRIBUTE.name
    by_tries = -10 * record.column("tried_so") - np.minimum(record.column("to_mean"), 9)
    orders = {
        "of the search": -number,
        "random": np.random.default_rng(0).random(len(work)),
        "redistribute by trials of the part, smallest first; then the rest": np.where(redistributed, by_tries, -1e6),
        "predicted chance": chance,
        "predicted chance / predicted work": chance / price,
        "oracle": saves / (work + 1),
    }
    usual = record.play(orders["of the search"])[SHARES.index(1.0)]
    _heading("order", *(f"{share:g} of the bound" for share in SHARES))
    for name, score in orders.items():
        cells = [_interval(np.log(parts / usual)) for parts in record.play(score)]
        print(f"| {name} | " + " | ".join(cells) + " |")


def _heading(*cells: str) -> None:
    print("| " + " | ".join(cells) + " |\n" + "|---" * len(cells) + "|")


def _interval(logs: Floats) -> str:
    resampled = np.random.default_rng(0).integers(len(logs), size=(10_000, len(logs)))
    low, high = np.exp(np.quantile(logs[resampled].mean(axis=1), (0.025, 0.975)))
    return f"{np.exp(logs.mean()):.3f} ({low:.3f} to {high:.3f})"


if __name__ == "__main__":
    app()
