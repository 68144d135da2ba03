"""Every mesh of a folder by one method: failures, invalid hulls, broken promises, and the worst meshes."""

from __future__ import annotations

from collections.abc import Sequence

import click
import numpy as np

from benchmarks.cli import check_methods, experiment
from benchmarks.compare import about
from benchmarks.runner import Bench
from benchmarks.store import Row
from benchmarks.tables import Page, Table, failures

WORST = 10

REACH = 0.055
"""Hulls that reach farther than this beyond the input are counted: a tenth more than the usual threshold."""

COLUMNS = {
    "CPU s": "cpu",
    "hulls": "parts",
    "beyond the input (over)": "over",
    "input outside (under)": "under",
    "concavity": "concavity",
    "volume in several hulls": "overlap",
}


@experiment(lambda method, **_: check_methods(method), fresh=False)
@click.option("--method", default="fast", show_default=True, help="As for compare, such as fast:max_vertices=32.")
@click.option("--setting", type=float, help="Its threshold or tolerance; default: its own.")
def app(bench: Bench, method: str, setting: float | None) -> Page:
    """Decompose every mesh of a folder, and report failures and what is worst.

    \b
    python -m benchmarks corpus ../shared/meshes/test --out RUN
    """
    rows = bench.run(method, setting)
    return Page(f"Corpus, {method}", [about(bench, {method: rows}), *summary(rows), failures(rows)])


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
        f"reach over {REACH}": sum(row["over"] > REACH for row in good),
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
