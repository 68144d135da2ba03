"""Every mesh of a folder by one method: failures, invalid hulls, broken promises, and the worst meshes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import typer

from benchmarks.cli import check_methods, experiment
from benchmarks.compare import about
from benchmarks.runner import Bench
from benchmarks.store import Row
from benchmarks.tables import Page, Table, failures

app = typer.Typer(add_completion=False)

WORST = 10
TASKS = 100
"""Meshes a process: starting one takes as long as most meshes."""

COLUMNS = {
    "CPU s": "cpu",
    "hulls": "parts",
    "beyond the input (over)": "over",
    "input outside (under)": "under",
    "concavity": "concavity",
    "volume in several hulls": "overlap",
}


@experiment(app, "corpus", lambda method, **_: check_methods(method), TASKS)
def corpus(
    bench: Bench,
    method: Annotated[str, typer.Option(help="As for compare, such as fast:max_vertices=32.")] = "fast",
    setting: Annotated[float | None, typer.Option(help="Its threshold or tolerance; default: its own.")] = None,
) -> Page:
    """Decompose every mesh of a folder, and report failures and what is worst.

    \b
    python -m benchmarks corpus ../shared/meshes/test --out RUN
    """
    rows = bench.run(method, setting)
    page = Page(f"Corpus, {method}", [about(bench)])
    page.add(*summary(rows), "## Failures", failures(rows))
    return page


def summary(rows: Sequence[Row]) -> list[object]:
    """Promises and how many meshes break them, the spread of each number, and the meshes with the largest."""
    good = [row for row in rows if "error" not in row]
    promises = {
        "decomposed": f"{len(good)} of {len(rows)}",
        "hulls": f"{sum(row['parts'] for row in good):,}",
        "invalid hulls": sum(row["invalid"] for row in good),
        "empty hulls": sum(row["empty"] for row in good),
        "parts over the threshold": sum(row["exceeding"] or 0 for row in good),
        "CPU s, all": f"{sum(row['cpu'] for row in good):.0f}",
    }
    blocks: list[object] = [Table(["meshes", str(len(rows))], list(promises.items()))]
    if good:
        values = {name: np.array([row[key] for row in good], dtype=float) for name, key in COLUMNS.items()}
        lines = [
            [name, *(f"{x:.4g}" for x in (np.median(v), v.mean(), np.quantile(v, 0.95), v.max()))]
            for name, v in values.items()
        ]
        blocks.append(Table(["", "median", "mean", "95 %", "most"], lines))
    for name in ("over", "under", "cpu", "concavity"):
        worst = sorted(good, key=lambda row: -row[name])[:WORST]
        cells = [[row["mesh"], f"{row[name]:.4g}", row["input_faces"], row["parts"]] for row in worst]
        blocks.append(Table([f"worst by {name}", name, "triangles", "hulls"], cells))
    return blocks
