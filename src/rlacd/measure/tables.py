"""Tables of results: Markdown as in the paper (mean, max, ± standard deviation), and CSV."""

from __future__ import annotations

import csv
import io
import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rlacd.measure.store import Row

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
"""Of the CSV file."""


@dataclass(frozen=True)
class Spread:
    """Mean, largest and standard deviation of a number over the meshes."""

    mean: float
    most: float
    deviation: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of at least one value; the deviation is the sample's, 0 of one value."""
        return cls(statistics.fmean(values), max(values), statistics.stdev(values) if len(values) > 1 else 0.0)

    def text(self, digits: int) -> str:
        """Write it as in the paper: mean (max, ± deviation), so many digits after the point."""
        return f"{self.mean:.{digits}f} ({self.most:.{digits}f}, ± {self.deviation:.{digits}f})"


def common_meshes(groups: Iterable[Sequence[Row]]) -> set[str]:
    """The meshes on which every group of rows succeeded: only those can be averaged side by side."""
    sets = [{row["mesh"] for row in rows if "error" not in row} for rows in groups]
    return set.intersection(*sets) if sets else set()


@dataclass(frozen=True)
class Table:
    """A table: what its columns are called, and its lines.

    Attributes
    ----------
    header : sequence of str
    lines : sequence of sequences
        As many cells as the header has; each is shown as ``str`` gives it.
    note : str
        A line below.
    """

    header: Sequence[str]
    lines: Sequence[Sequence[object]]
    note: str = ""

    def markdown(self) -> str:
        """Set it in Markdown; the first column is left-aligned, the others right."""
        header, *rows = (
            " | ".join(str(cell).replace("|", "\\|") for cell in line) for line in (self.header, *self.lines)
        )
        rule = f"|---|{'---:|' * (len(self.header) - 1)}"
        text = "\n".join([f"| {header} |", rule, *(f"| {row} |" for row in rows)])
        return f"{text}\n\n{self.note}" if self.note else text


def comparison(groups: Sequence[tuple[str, Sequence[Row]]]) -> Table:
    """Compare methods on the meshes that all of them managed: a line each, as in the paper's Table 1, and failures.

    Parameters
    ----------
    groups : sequence of (label, rows)
    """
    shared = common_meshes(rows for _, rows in groups)
    lines = []
    for label, rows in groups:
        good = [row for row in rows if row["mesh"] in shared]
        failed = sum("error" in row for row in rows)
        cells = [show(good) if good else "–" for show in _SHOWN.values()]
        lines.append([label, *cells, f"{failed} of {len(rows)}"])
    note = f"{len(shared)} meshes that every method managed; mean (max, ± standard deviation)."
    return Table(["method", *_SHOWN, "failed"], lines, note)


def _spread(key: str, digits: int) -> Callable[[Sequence[Row]], str]:
    return lambda rows: Spread.of([row[key] for row in rows]).text(digits)


_SHOWN: Mapping[str, Callable[[Sequence[Row]], object]] = MappingProxyType(
    {
        "#P": _spread("parts", 1),
        "#F": _spread("faces", 0),
        "D_h": _spread("hausdorff", 3),
        "over": _spread("over", 3),
        "under": _spread("under", 3),
        "concavity": _spread("concavity", 3),
        "Σ hull / solid": _spread("volume", 2),
        "uncovered": lambda rows: f"{100 * statistics.fmean(row['uncovered'] for row in rows):.1f} %",
        "invalid hulls": lambda rows: sum(row["invalid"] for row in rows),
        "CPU s": _spread("cpu", 2),
        "wall s": _spread("wall", 2),
        "peak MB": lambda rows: f"{max(row['peak_mb'] for row in rows):.0f}",
    }
)
"""Columns of a comparison: what each says of the rows of one method."""


def ratio_of_parts(rows: Sequence[Row], reference: Sequence[Row]) -> str:
    """Geometric mean over the meshes of parts over the reference's, with its standard error."""
    shared = common_meshes([rows, reference])
    parts = {row["mesh"]: row["parts"] for row in rows if row["mesh"] in shared}
    logs = [math.log(parts[row["mesh"]] / row["parts"]) for row in reference if row["mesh"] in shared]
    if not logs:
        return "–"
    mean = math.exp(statistics.fmean(logs))
    error = mean * statistics.stdev(logs) / math.sqrt(len(logs)) if len(logs) > 1 else 0.0
    return f"{mean:.3f} ± {error:.3f}"


def failures(rows: Iterable[Row]) -> str:
    """One line for everything that went wrong; "none" otherwise."""
    found = [f"- {r['mesh']}, {r['method']} {r['setting']:g}: {r['error']}" for r in rows if "error" in r]
    return "\n".join(found) or "none"


def as_csv(rows: Iterable[Row]) -> str:
    """Every row with all its numbers; an error leaves them empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_plain(row) for row in rows)
    return text.getvalue()


def _plain(row: Row) -> dict[str, Any]:
    return {key: value for key, value in row.items() if value is not None}
