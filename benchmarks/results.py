"""Copy the tables of a run into research/comparison.md, so that each is exactly what a command printed.

    sh benchmarks/paper.sh MESHES LIST TRAINING_MESHES RUN
    python benchmarks/results.py RUN research/comparison.md

The document names the source of each table: the lines between ``<!-- PAGE.md, table N -->`` and ``<!-- end -->`` are
replaced by the N-th table of RUN/PAGE.md. The chart it shows is copied beside it.
"""

from __future__ import annotations

import argparse
import re
import shutil
from pathlib import Path

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("document", type=Path)
    given = parser.parse_args()
    given.document.write_text(fill(given.document.read_text(), given.run))
    for source, name in CHARTS.items():
        shutil.copyfile(given.run / source, given.document.parent / name)


if __name__ == "__main__":
    main()
