"""The prices of `rlacd.work` against measured times."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

import rlacd
from benchmarks.cli import PATH
from benchmarks.runner import find_meshes
from benchmarks.tables import Table
from rlacd.cli.exit_codes import exit_codes
from rlacd.criteria.concavity import Concavity, DistanceEarlyOut
from rlacd.policies import Greedy
from rlacd.run import work
from rlacd.solid.component import ClippedPart, Component, Part
from rlacd.solid.hull import Hull

Sizes = tuple[int, ...]

KERNELS: dict[str, tuple[Any, str, Callable[..., Sizes], Callable[..., float]]] = {
    "choosing": (Greedy, "choose", lambda policy, component, threads: (len(component.faces),), work.choosing),
    "cutting": (Component, "cut", lambda part, plane: (part.size,), work.cutting),
    "judging": (Concavity, "is_met", lambda goal, part: (len(part.faces), len(part.hull.faces)), work.judging),
    "joining": (Hull, "around", lambda *hulls: (sum(len(hull.vertices) for hull in hulls),), work.joining),
    "testing": (DistanceEarlyOut, "is_feasible", lambda early_out, solid, hull: (len(hull.vertices),), work.testing),
    "screening": (
        DistanceEarlyOut,
        "feasible_volumes",
        lambda early_out, solid, hulls, pairs, threads: (
            sum(len(hulls[i]) for i in pairs.ravel().tolist()),
            len(pairs),
        ),
        work.screening,
    ),
    "gluing": (Part, "glued", lambda a, b, hull=None: (a.size + b.size,), work.gluing),
    "filling": (
        ClippedPart,
        "__init__",
        lambda part, solid, parts, hull: (sum(one.size for one in parts), len(hull.faces)),
        work.filling,
    ),
}
"""By the name of its price: where the kernel is, and the sizes of a call."""


def timed(owner: Any, name: str, note: Callable[..., None]) -> None:
    """Replace a function by one that reports its CPU seconds and its arguments."""
    original = getattr(owner, name)

    def replacement(*arguments: Any) -> Any:
        start = time.thread_time()
        result = original(*arguments)
        note(time.thread_time() - start, *arguments)
        return result

    setattr(owner, name, staticmethod(replacement) if isinstance(vars(owner).get(name), staticmethod) else replacement)


def measure_kernels() -> dict[str, list[tuple[Sizes, float]]]:
    calls: dict[str, list[tuple[Sizes, float]]] = {name: [] for name in KERNELS}
    for kernel, (owner, name, sizes, _) in KERNELS.items():
        own = calls[kernel]
        timed(owner, name, lambda t, *a, own=own, sizes=sizes: own.append((sizes(*a), 1e6 * t)))
    return calls


@click.command()
@click.argument("meshes", type=PATH)
@click.option("--count", default=14, show_default=True, help="Meshes, drawn at random, the same ones each time.")
def app(meshes: Path, count: int) -> None:
    """Decompose meshes at the default level, one thread; compare each kernel's CPU seconds with what it was priced at.

    Fit: nonnegative least squares of a call's microseconds to the sizes that its price depends on, constant first.

    \b
    python -m benchmarks prices ../shared/meshes/train
    """
    from scipy.optimize import nnls  # of the tests' dependencies

    with exit_codes():
        calls = measure_kernels()
        names = find_meshes(meshes)
        random.Random(5).shuffle(names)
        for name in names[:count]:
            rlacd.decompose(meshes / name, threads=1)
        lines = []
        for kernel, own in calls.items():
            if own:
                sizes, times = np.array([s for s, _ in own], dtype=float), np.array([t for _, t in own])
                priced = sum(KERNELS[kernel][3](*s) for s, _ in own)
                terms = np.c_[np.ones(len(own)), sizes]
                weight = 1 / np.sqrt(50 + sizes.sum(axis=1))  # longer calls vary more
                fit, _ = nnls(terms * weight[:, None], times * weight)
                shown = [round(float(x), 2) for x in fit]
                lines.append([kernel, len(own), f"{times.sum() / 1e6:.2f}", f"{priced / 1e6:.2f}", shown])
        click.echo(Table(["kernel", "calls", "CPU s", "priced", "fit, µs"], lines))
