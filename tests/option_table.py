"""The documentation's table of options and the public signatures, made from where they are stated.

``python -m tests.option_table`` writes both.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rlacd.decompose_mesh import decompose
from rlacd.io.robots import rewrite_robot
from rlacd.options import Options
from rlacd.options.fields import About
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import OutputOptions
from rlacd.options.ranges import RUN
from rlacd.options.robots import RobotOptions

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "options.md"

HEAD = ["| command line, Python | default | values | meaning |", "|---|---|---|---|"]

BEGIN, END = '<div class="options" markdown>', "</div>"

FLAG = re.compile(r"--[a-z][a-z-]*")

PROGRESS = "| `progress` | – | | a function called between steps; returning `False` stops |"


def options_table() -> str:
    """All options in Markdown: a table under each heading of the command's help, a row an option, with an anchor."""
    panels: dict[str, list[str]] = {}
    for options in (Options, NavigableSpace, OutputOptions, RobotOptions):
        for panel, row in _rows(options):
            panels.setdefault(panel, []).append(row)
    panels[RUN].append(PROGRESS)
    return "\n".join(line for panel, rows in panels.items() for line in (f"### {panel}", "", *HEAD, *rows, ""))


def _rows(options: type[Any]) -> Iterator[tuple[str, str]]:
    """The rows of options, each with its heading."""
    for field in dataclasses.fields(options):
        known: About = field.metadata["option"]
        typed = ", ".join(f"`{name}`" for name in sorted(known.flags, key=len))
        python = f"<br>`{known.python}`".replace(", ", "`, `") if known.python else ""
        meaning = FLAG.sub(r"`\g<0>`", known.help)
        cells = [f'<a id="option-{field.name}"></a>{typed}{python}', known.usual or "–", known.kind.values, meaning]
        yield str(known.panel), "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def written(page: str) -> str:
    """The page with the table in place of the one it has."""
    lines = page.splitlines()
    begin, end = lines.index(BEGIN) + 2, lines.index(END)
    return "\n".join([*lines[:begin], options_table(), *lines[end:], ""])


STUB = Path(__file__).parents[1] / "src" / "rlacd" / "__init__.pyi"


def signatures() -> str:
    """The public functions with every option, for editors and type checkers; None is the same as leaving one out."""
    return "\n".join(map(_signature, (decompose, rewrite_robot)))


def _signature(function: Callable[..., Any]) -> str:
    lines, stars = [f"def {function.__name__}("], False
    for name, parameter in inspect.signature(function).parameters.items():
        kind, is_option = (
            str(parameter.annotation).replace("'", '"'),
            hasattr(Options, name) or hasattr(RobotOptions, name),
        )
        kind += " | None" if is_option and not kind.endswith("None") else ""
        default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}".replace("'", '"')
        lines += ["    *,"] if parameter.kind is parameter.KEYWORD_ONLY and not stars else []
        stars = parameter.kind is parameter.KEYWORD_ONLY
        lines.append(f"    {name}: {kind}{default},")
    said = textwrap.indent(f'"""{inspect.cleandoc(function.__doc__ or "")}\n"""', "    ")
    made = inspect.signature(function).return_annotation
    return "\n".join([*lines, f") -> {made}:", *(line.rstrip() for line in said.splitlines()), ""])


if __name__ == "__main__":
    stub = STUB.read_text(encoding="utf-8").partition("def decompose(")[0]
    STUB.write_text(stub + signatures(), encoding="utf-8")
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
