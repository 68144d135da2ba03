"""The documentation's table of options, made from where they are stated: ``python -m tests.option_table`` writes it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rlacd.options import Options
from rlacd.options.fields import About
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import OutputOptions
from rlacd.options.robots import RobotOptions

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "options.md"

HEAD = ["| command line, Python | default | values | meaning |", "|---|---|---|---|"]

FLAG = re.compile(r"--[a-z][a-z-]*")

PROGRESS = "| `progress` | – | | a function called between steps; returning `False` stops |"


def options_table() -> str:
    """All options in Markdown, one per row."""
    rows = [*_rows(Options), PROGRESS, *_rows(NavigableSpace), *_rows(OutputOptions), *_rows(RobotOptions)]
    return "\n".join([*HEAD, *rows, ""])


def _rows(options: type[Any]) -> Iterator[str]:
    for field in dataclasses.fields(options):
        known: About = field.metadata["option"]
        typed = ", ".join(f"`{name}`" for name in sorted(known.flags, key=len))
        python = f"<br>`{known.python}`".replace(", ", "`, `") if known.python else ""
        meaning = FLAG.sub(r"`\g<0>`", known.help)
        cells = [typed + python, known.usual or "–", known.kind.values, meaning]
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def written(page: str) -> str:
    """The page with the table in place of the one it has."""
    lines = page.splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("| command line"))
    end = next(i for i in range(begin, len(lines)) if not lines[i].startswith("|"))
    return "\n".join([*lines[:begin], *options_table().splitlines(), *lines[end:], ""])


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
