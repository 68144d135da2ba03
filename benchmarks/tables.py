"""Tables as Markdown, pages of them, and ratios of paired measurements with intervals."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.store import Row
from rlacd.io.write import write_file

RESAMPLES = 10_000
"""Resamples of the meshes for an interval; its ends then vary by less than a hundredth of its width."""


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

    def __str__(self) -> str:
        header, *rows = (
            " | ".join(str(cell).replace("|", "\\|") for cell in line) for line in (self.header, *self.lines)
        )
        rule = f"|---|{'---:|' * (len(self.header) - 1)}"
        text = "\n".join([f"| {header} |", rule, *(f"| {row} |" for row in rows)])
        return f"{text}\n\n{self.note}" if self.note else text


@dataclass
class Page:
    """A page of results: paragraphs and tables in Markdown.

    Attributes
    ----------
    title : str
    blocks : list
        Shown by ``str``.
    """

    title: str
    blocks: list[object] = field(default_factory=list)

    def __str__(self) -> str:
        return "\n\n".join(map(str, [f"# {self.title}", *self.blocks])) + "\n"

    def save(self, folder: Path, name: str) -> Path:
        """Write ``NAME.md``; OutputError if the folder cannot be written to."""
        write_file(folder / f"{name}.md", str(self).encode())
        return folder / f"{name}.md"


@dataclass(frozen=True)
class Ratio:
    """Geometric mean of paired ratios, and its 95% interval by resampling the pairs."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float], reference: Sequence[float]) -> Ratio:
        """Of at least one pair of positive numbers."""
        logs = np.log(np.asarray(values, dtype=float) / np.asarray(reference, dtype=float))
        drawn = np.random.default_rng(0).integers(len(logs), size=(RESAMPLES, len(logs)))
        low, high = np.exp(np.quantile(logs[drawn].mean(axis=1), (0.025, 0.975)))
        return cls(float(np.exp(logs.mean())), float(low), float(high))

    def __str__(self) -> str:
        return f"{self.mean:.3f} ({self.low:.3f} to {self.high:.3f})"


def ratio_of(rows: Sequence[Row], reference: Sequence[Row], key: str = "parts") -> str:
    """The ratio of a column to the reference's, over the meshes that both managed."""
    here, there = managed({"here": rows, "there": reference}).values()
    pairs = zip(here, there, strict=True)  # both in the order of the meshes
    values = [(row[key], other[key]) for row, other in pairs]
    return str(Ratio.of(*zip(*values, strict=True))) if values else "–"


def managed(groups: Mapping[str, Sequence[Row]]) -> dict[str, list[Row]]:
    """By label, the rows of the meshes on which every group succeeded; averages are comparable only on these."""
    sets = [{row["mesh"] for row in rows if "error" not in row} for rows in groups.values()]
    shared = set.intersection(*sets) if sets else set()
    return {label: [row for row in rows if row["mesh"] in shared] for label, rows in groups.items()}


def mean(rows: Iterable[Row], key: str) -> float:
    """Mean of a column."""
    return statistics.fmean(row[key] for row in rows)


def failures(rows: Iterable[Row]) -> str:
    """List all failures, one a line; "none" if there are none."""
    found = [f"- {r['mesh']}, {r['method']} {r['setting']:g}: {r['error']}" for r in rows if "error" in r]
    return "\n".join(["## Failures", "", *(found or ["none"])])
