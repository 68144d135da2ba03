"""What the search spends its time on: prices of `rlacd.run.work` against measured times, and what each operator gains.

    python benchmarks/search_costs.py MESHES --count 14

Decomposes a fixed sample of `train/` at the default level on one thread. The first table has, for every kernel with a
price, its calls, CPU seconds, the seconds it was priced at, and a fit by nonnegative least squares of the time to the
sizes that its price depends on (constant first; microseconds). The second has trials, CPU seconds and parts saved.
"""

from __future__ import annotations

import argparse
import csv
import random
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

import rlacd
from rlacd import work
from rlacd.criteria.concavity import Concavity, ConcavityScreen
from rlacd.merge import merge
from rlacd.policies import Greedy
from rlacd.search import recut
from rlacd.search.neighbourhood import Neighbourhood
from rlacd.search.operators import OperatorSampler, Trial
from rlacd.solid.component import ClippedPart, Component, Part
from rlacd.solid.hull import Hull

Sizes = tuple[int, ...]

KERNELS: dict[str, tuple[Any, str, Callable[..., Sizes], Callable[..., float]]] = {
    "choosing": (Greedy, "choose", lambda policy, component, threads: (len(component.faces),), work.choosing),
    "cutting": (Component, "cut", lambda part, plane: (part.size,), work.cutting),
    "judging": (Concavity, "is_met", lambda goal, part: (len(part.faces), len(part.hull.faces)), work.judging),
    "joining": (Hull, "around", lambda *hulls: (sum(len(hull.vertices) for hull in hulls),), work.joining),
    "testing": (ConcavityScreen, "feasibility", lambda screen, solid, hull: (len(hull.vertices),), work.testing),
    "screening": (
        ConcavityScreen,
        "feasibilities",
        lambda screen, solid, hulls, pairs, threads: (
            len(pairs),
            sum(len(hulls[i].vertices) for i in pairs.ravel().tolist()),
        ),
        lambda pairs, vertices: pairs * work.screening(0) + work.screening(vertices) - work.screening(0),
    ),
    "probing": (ConcavityScreen, "forbids", lambda screen, solid, hull: (len(hull.vertices),), work.probing),
    "gluing": (Part, "glued", lambda a, b, hull=None: (a.size + b.size,), work.gluing),
    "filling": (
        ClippedPart,
        "__init__",
        lambda part, solid, a, b, hull: (a.size + b.size, len(hull.faces)),
        work.filling,
    ),
    "reuniting": (recut, "reunite", lambda members: (sum(m.size for m in members), len(members)), work.reuniting),
}
"""By the name of its price: where the kernel is, and the sizes of a call."""


def timed(owner: Any, name: str, note: Callable[..., None]) -> None:
    """Replace a function by one that reports its arguments, its result and its CPU seconds."""
    original = getattr(owner, name)

    def replacement(*arguments: Any) -> Any:
        start = time.thread_time()
        result = original(*arguments)
        note(time.thread_time() - start, result, *arguments)
        return result

    setattr(owner, name, staticmethod(replacement) if isinstance(vars(owner).get(name), staticmethod) else replacement)


def measure_kernels() -> dict[str, list[tuple[Sizes, float]]]:
    calls: dict[str, list[tuple[Sizes, float]]] = {name: [] for name in KERNELS}
    for kernel, (owner, name, sizes, _) in KERNELS.items():
        own = calls[kernel]
        timed(owner, name, lambda t, _, *a, own=own, sizes=sizes: own.append((sizes(*a), 1e6 * t)))
    return calls


def measure_trials() -> dict[tuple[str, int], list[tuple[float, int]]]:
    seconds: dict[int, float] = {}
    trials: dict[tuple[str, int], list[tuple[float, int]]] = defaultdict(list)
    timed(Neighbourhood, "_try", lambda t, _, state, trial, clock: seconds.update({id(trial): t}))

    def note(_: float, __: None, sampler: OperatorSampler, trial: Trial, gain: int, units: float) -> None:
        trials[trial.move.name, len(trial.cluster)].append((seconds.pop(id(trial)), gain))

    timed(OperatorSampler, "count", note)
    return trials


def sample(folder: Path, count: int) -> list[Path]:
    """A fixed sample of files of train/ with 200 to 8,000 faces."""
    with (folder / "index.csv").open() as index:
        rows = [row for row in csv.DictReader(index) if row["split"] == "train" and 200 < int(row["faces"]) < 8000]
    files = [folder / row["file"] for row in rows]
    random.Random(5).shuffle(files)
    return files[:count]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--count", type=int, default=14)
    options = parser.parse_args()
    assert merge.ClippedPart is ClippedPart  # patched where it is defined
    calls, trials = measure_kernels(), measure_trials()
    for file in sample(options.meshes, options.count):
        rlacd.decompose(file, threads=1)
    print("| kernel | calls | CPU s | priced | fit |\n|---|--:|--:|--:|---|")
    for kernel, own in calls.items():
        sizes, times = np.array([s for s, _ in own], dtype=float), np.array([t for _, t in own])
        priced = sum(KERNELS[kernel][3](*s) for s, _ in own)
        terms = np.c_[np.ones(len(own)), sizes]
        weight = 1 / np.sqrt(50 + sizes.sum(axis=1))  # longer calls vary more
        fit, _ = nnls(terms * weight[:, None], times * weight)
        print(f"| {kernel} | {len(own)} | {times.sum() / 1e6:.2f} | {priced / 1e6:.2f} | {np.round(fit, 2).tolist()} |")
    print("\n| operator | parts | trials | CPU s | saved | per CPU s |\n|---|--:|--:|--:|--:|--:|")
    for (move, size), made in sorted(trials.items()):
        spent, saved = sum(t for t, _ in made), sum(gain for _, gain in made)
        print(f"| {move.lower()} | {size} | {len(made)} | {spent:.1f} | {saved} | {saved / max(spent, 1e-9):.2f} |")


if __name__ == "__main__":
    main()
