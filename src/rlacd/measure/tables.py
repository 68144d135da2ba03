"""Tables of results: Markdown as in the paper (mean, max, ± standard deviation), and CSV."""

from __future__ import annotations

import csv
import io
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
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

    def text(self, spell: Callable[[float], str]) -> str:
        """Write it as in the paper: mean (max, ± deviation)."""
        return f"{spell(self.mean)} ({spell(self.most)}, ± {spell(self.deviation)})"


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
    header = [
        "method",
        "#P",
        "#F",
        "D_h",
        "over",
        "under",
        "concavity",
        "Σ hull / solid",
        "uncovered",
        "invalid hulls",
        "CPU s",
        "wall s",
        "peak MB",
        "failed",
    ]
    lines = []
    for label, rows in groups:
        good = [row for row in rows if row["mesh"] in shared]
        failed = sum("error" in row for row in rows)
        if not good:
            lines.append([label, *["–"] * (len(header) - 2), f"{failed} of {len(rows)}"])
            continue
        column = {key: Spread.of([row[key] for row in good]) for key in _AVERAGED}
        lines.append(
            [
                label,
                column["parts"].text(one_digit),
                column["faces"].text(whole),
                *(column[key].text(three_digits) for key in ("hausdorff", "over", "under", "concavity")),
                column["volume"].text(two_digits),
                f"{100 * column['uncovered'].mean:.1f} %",
                sum(row["invalid"] for row in good),
                column["cpu"].text(two_digits),
                column["wall"].text(two_digits),
                whole(column["peak_mb"].most),
                f"{failed} of {len(rows)}",
            ]
        )
    return Table(header, lines, f"{len(shared)} meshes that every method managed; mean (max, ± standard deviation).")


_AVERAGED = (
    "parts",
    "faces",
    "hausdorff",
    "over",
    "under",
    "concavity",
    "volume",
    "uncovered",
    "cpu",
    "wall",
    "peak_mb",
)


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


def whole(x: float) -> str:
    """No digits after the point."""
    return f"{x:.0f}"


def one_digit(x: float) -> str:
    """One digit after the point."""
    return f"{x:.1f}"


def two_digits(x: float) -> str:
    """Two digits after the point."""
    return f"{x:.2f}"


def three_digits(x: float) -> str:
    """Three digits after the point."""
    return f"{x:.3f}"
