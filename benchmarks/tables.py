"""Tables of results: Markdown as in the paper (mean, max, ± standard deviation), and CSV."""

from __future__ import annotations

import csv
import io
import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from benchmarks.store import Row

COLUMNS = (
    "mesh",
    "method",
    "setting",
    "version",
    "input_faces",
    "threads",
    "parts",
    "faces",
    "vertices",
    "hausdorff",
    "over",
    "under",
    "concavity",
    "exceeding",
    "volume",
    "uncovered",
    "invalid",
    "empty",
    "wall",
    "cpu",
    "peak_mb",
    "error",
)
"""Columns of the CSV file."""


@dataclass(frozen=True)
class Spread:
    """Mean, maximum and standard deviation of a number over the meshes."""

    mean: float
    most: float
    deviation: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of at least one value; the deviation is the sample standard deviation, 0 for one value."""
        return cls(statistics.fmean(values), max(values), statistics.stdev(values) if len(values) > 1 else 0.0)

    def text(self, digits: int) -> str:
        """Format as in the paper: mean (max, ± deviation), with `digits` decimals."""
        return f"{self.mean:.{digits}f} ({self.most:.{digits}f}, ± {self.deviation:.{digits}f})"


def common_meshes(groups: Iterable[Sequence[Row]]) -> set[str]:
    """The meshes on which every group of rows succeeded; averages are comparable only on these."""
    sets = [{row["mesh"] for row in rows if "error" not in row} for rows in groups]
    return set.intersection(*sets) if sets else set()


@dataclass(frozen=True)
class Table:
    """A table with column headers and lines.

    Attributes
    ----------
    header : sequence of str
    lines : sequence of sequences
        Lines with one cell per column; cells are shown by ``str``.
    note : str
        A line shown below the table.
    """

    header: Sequence[str]
    lines: Sequence[Sequence[object]]
    note: str = ""

    def markdown(self) -> str:
        """Format as Markdown; the first column is left-aligned, the others right-aligned."""
        header, *rows = (
            " | ".join(str(cell).replace("|", "\\|") for cell in line) for line in (self.header, *self.lines)
        )
        rule = f"|---|{'---:|' * (len(self.header) - 1)}"
        text = "\n".join([f"| {header} |", rule, *(f"| {row} |" for row in rows)])
        return f"{text}\n\n{self.note}" if self.note else text


def comparison(groups: Sequence[tuple[str, Sequence[Row]]]) -> Table:
    """Compare methods on the meshes that all of them solved, one line each, as in the paper's Table 1.

    Parameters
    ----------
    groups : sequence of (label, rows)
        The first is the reference for the ratio of parts.
    """
    good = _managed(groups)
    first = next(iter(good.values()), [])
    lines = []
    for label, rows in good.items():
        cells = [show(rows) if rows else "–" for show in _COMPARED.values()]
        ratio = "1" if rows is first and rows else ratio_of_parts(rows, first)
        lines.append([label, cells[0], ratio, *cells[1:]])
    parts, *others = _COMPARED
    note = (
        "The meshes that every method managed; mean (max, ± standard deviation); the ratio is a geometric mean over "
        "them, ± its standard error."
    )
    return Table([f"{len(first)} meshes", parts, f"{parts} / first line's", *others], lines, note)


def details(groups: Sequence[tuple[str, Sequence[Row]]]) -> Table:
    """Show the remaining metrics on the meshes that all methods solved, and each method's number of failures."""
    failed = {label: f"{sum('error' in row for row in rows)} of {len(rows)}" for label, rows in groups}
    lines = [
        [label, *(show(rows) if rows else "–" for show in _DETAILS.values()), failed[label]]
        for label, rows in _managed(groups).items()
    ]
    return Table(["the same meshes", *_DETAILS, "failed"], lines)


def _managed(groups: Sequence[tuple[str, Sequence[Row]]]) -> dict[str, list[Row]]:
    shared = common_meshes(rows for _, rows in groups)
    return {label: [row for row in rows if row["mesh"] in shared] for label, rows in groups}


Show: TypeAlias = Callable[[Sequence[Row]], object]
"""Computes a column from the rows of one method."""


def _spread(key: str, digits: int) -> Show:
    return lambda rows: Spread.of([row[key] for row in rows]).text(digits)


def _mean_and_worst(key: str, digits: int) -> Show:
    def show(rows: Sequence[Row]) -> str:
        spread = Spread.of([row[key] for row in rows])
        return f"{spread.mean:.{digits}f}, {spread.most:.{digits}f}"

    return show


def _share(key: str) -> Show:
    return lambda rows: f"{100 * statistics.fmean(row[key] for row in rows):.1f} %"


_COMPARED: Mapping[str, Show] = MappingProxyType(
    {
        "#P": _spread("parts", 1),
        "#F": _spread("faces", 0),
        "D_h": _spread("hausdorff", 3),
        "concavity: mean, worst": _mean_and_worst("concavity", 3),
        "CPU s": _spread("cpu", 2),
    }
)

_DETAILS: Mapping[str, Show] = MappingProxyType(
    {
        "over": _spread("over", 3),
        "under": _spread("under", 3),
        "uncovered": _share("uncovered"),
        "Σ hull / solid, median": lambda rows: f"{statistics.median(row['volume'] for row in rows):.2f}",
        "invalid hulls": lambda rows: sum(row["invalid"] for row in rows),
        "wall s: mean, worst": _mean_and_worst("wall", 2),
        "CPU s: median, sum": lambda rows: (
            f"{statistics.median(row['cpu'] for row in rows):.2f}, {sum(row['cpu'] for row in rows):.0f}"
        ),
        "peak MB": lambda rows: f"{max(row['peak_mb'] for row in rows):.0f}",
    }
)


def ratio_of_parts(rows: Sequence[Row], reference: Sequence[Row]) -> str:
    """Geometric mean over the meshes of the ratio of parts to the reference's, with its standard error."""
    shared = common_meshes([rows, reference])
    parts = {row["mesh"]: row["parts"] for row in rows if row["mesh"] in shared}
    logs = [math.log(parts[row["mesh"]] / row["parts"]) for row in reference if row["mesh"] in shared]
    if not logs:
        return "–"
    mean = math.exp(statistics.fmean(logs))
    error = mean * statistics.stdev(logs) / math.sqrt(len(logs)) if len(logs) > 1 else 0.0
    return f"{mean:.2f} ± {error:.2f}"


def failures(rows: Iterable[Row]) -> str:
    """List all failures in one line; "none" if there are none."""
    found = [f"- {r['mesh']}, {r['method']} {r['setting']:g}: {r['error']}" for r in rows if "error" in r]
    return "\n".join(found) or "none"


def short_names(meshes: Sequence[str]) -> dict[str, str]:
    """Shorten each mesh's path to the shortest name that is unique.

    If all files have the same name, as ShapeNetCore's ``models/model_normalized.obj``, their folders name them.
    """
    paths = {mesh: Path(mesh).with_suffix("").parts for mesh in meshes}
    while len(paths) > 1 and len({path[-1] for path in paths.values()}) == 1 and min(map(len, paths.values())) > 1:
        paths = {mesh: path[:-1] for mesh, path in paths.items()}

    def tail(mesh: str, length: int) -> str:
        return "/".join(paths[mesh][-length:])

    @cache
    def met(length: int) -> Counter[str]:
        return Counter(tail(mesh, length) for mesh in paths)

    def shortest(mesh: str) -> str:
        lengths = range(1, len(paths[mesh]) + 1)
        return next((tail(mesh, n) for n in lengths if met(n)[tail(mesh, n)] == 1), mesh)

    return {mesh: shortest(mesh) for mesh in meshes}


def as_csv(rows: Iterable[Row]) -> str:
    """Every row with all its numbers; failed rows have empty cells."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_plain(row) for row in rows)
    return text.getvalue()


def _plain(row: Row) -> dict[str, Any]:
    return {key: value for key, value in row.items() if value is not None}
