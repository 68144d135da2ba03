"""Tables as Markdown, pages of them, and ratios of paired measurements with intervals; tables put into documents."""

from __future__ import annotations

import re
import shutil
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import typer

from benchmarks.store import Row
from rlacd.io.write import write_file

app = typer.Typer(add_completion=False)

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
    """A page of results: paragraphs and tables in Markdown, with charts beside it.

    Attributes
    ----------
    title : str
    blocks : list
        Shown by ``str``.
    charts : dict of str to bytes
        File name to content.
    """

    title: str
    blocks: list[object] = field(default_factory=list)
    charts: dict[str, bytes] = field(default_factory=dict)

    def add(self, *blocks: object) -> None:
        """Append blocks."""
        self.blocks += blocks

    def chart(self, name: str, content: bytes, caption: str) -> None:
        """Append a chart."""
        self.charts[name] = content
        self.add(f"![{caption}]({name})")

    def __str__(self) -> str:
        return "\n\n".join(map(str, [f"# {self.title}", *self.blocks])) + "\n"

    def save(self, folder: Path, name: str) -> Path:
        """Write ``NAME.md`` and the charts; OutputError if the folder cannot be written to."""
        for file_name, content in {**self.charts, f"{name}.md": str(self).encode()}.items():
            write_file(folder / file_name, content)
        return folder / f"{name}.md"


@dataclass(frozen=True)
class Ratio:
    """Geometric mean of paired ratios, and its 95 % interval by resampling the pairs."""

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
    shared = common_meshes([rows, reference])
    here, there = ({row["mesh"]: row[key] for row in some if row["mesh"] in shared} for some in (rows, reference))
    return str(Ratio.of([here[mesh] for mesh in there], list(there.values()))) if shared else "–"


def common_meshes(groups: Iterable[Sequence[Row]]) -> set[str]:
    """The meshes on which every group of rows succeeded; averages are comparable only on these."""
    sets = [{row["mesh"] for row in rows if "error" not in row} for rows in groups]
    return set.intersection(*sets) if sets else set()


def managed(groups: Mapping[str, Sequence[Row]]) -> dict[str, list[Row]]:
    """By label, the rows of the meshes that all groups managed."""
    shared = common_meshes(groups.values())
    return {label: [row for row in rows if row["mesh"] in shared] for label, rows in groups.items()}


def mean(rows: Iterable[Row], key: str) -> float:
    """Mean of a column."""
    return statistics.fmean(row[key] for row in rows)


def failures(rows: Iterable[Row]) -> str:
    """List all failures, one a line; "none" if there are none."""
    found = [f"- {r['mesh']}, {r['method']} {r['setting']:g}: {r['error']}" for r in rows if "error" in r]
    return "\n".join(found) or "none"


PLACE = re.compile(r"(<!-- (?P<page>\S+\.md), table (?P<number>\d+) -->\n).*?(<!-- end -->)", re.DOTALL)
CHARTS = {"quick/curves.svg": "parts_against_error.svg"}
"""Charts, from their name in a run's folder to their name in the document."""

TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def fill(document: str, run: Path) -> str:
    """Replace the tables of a document by those in a run's pages."""

    def table(place: re.Match[str]) -> str:
        page, number = run / place["page"], int(place["number"])
        if not page.is_file():
            raise SystemExit(f"{page} is not there; run its command first.")
        tables = TABLE.findall(page.read_text())
        if number > len(tables):
            raise SystemExit(f"{page} has {len(tables)} tables, not {number}.")
        return f"{place[1]}\n{tables[number - 1]}\n{place[4]}"

    return PLACE.sub(table, document)


@app.command()
def tables(run: Path, document: Path) -> None:
    """Replace the tables of a document by those of a run's pages, so that each is exactly what a command printed.

    The document names the source of each table: the lines between ``<!-- PAGE.md, table N -->`` and ``<!-- end -->``
    are replaced by the N-th table of RUN/PAGE.md. The chart it shows is copied beside it.

    \b
    python -m benchmarks tables RUN research/comparison.md
    """
    document.write_text(fill(document.read_text(), run))
    for source, name in CHARTS.items():
        shutil.copyfile(run / source, document.parent / name)
