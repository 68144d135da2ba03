"""What the site is made from at each build: figures, commands' help, a schema, the promises, the notebook, a mesh."""

from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


FIGURE = re.compile(r"\{\{ (.+?)(?::([^:}]*))? \}\}")
"""``{{ EXPRESSION:FORMAT }}`` of constants of the package by their modules, or ``{{ results.NAME }}``."""

RESULTS = ROOT / "docs" / "results.json"
"""Figures that a run of some meshes gives; `tests/test_figures.py` measures them again every night."""


def with_figures(markdown: str) -> str:
    """Put figures in the place of what names them."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))

    def constant(found: re.Match[str]) -> str:
        return repr(attrgetter(found[2])(import_module(f"rlacd.{found[1]}")))

    def figure(found: re.Match[str]) -> str:
        if found[1].startswith("results."):
            return str(results[found[1].removeprefix("results.")]["value"])
        expression = re.sub(r"\b([a-z_]+(?:\.[a-z_]+)*)\.(_?[A-Z][A-Z_]*(?:\.[a-z]+)*)\b", constant, found[1])
        return format(eval(expression, {"__builtins__": {}}), found[2] or "")

    return FIGURE.sub(figure, markdown)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put figures, the README's table, the notebook, the commands and the promises' tests where pages ask for them."""
    markdown = with_figures(markdown)
    if page.file.src_uri == "index.md":
        readme = (ROOT / "README.md").read_text(encoding="utf-8")
        return markdown.replace("<!-- table -->", re.findall(r"(?:^\|.*\n)+", readme, re.MULTILINE)[0])
    if page.file.src_uri == "quickstart.md":
        return markdown.replace("<!-- notebook -->", _notebook(ROOT / "examples" / "quickstart.ipynb"))
    if page.file.src_uri == "reference/commands.md":
        return markdown.replace("<!-- commands -->", _commands())
    if page.file.src_uri == "promises.md":
        sys.path.insert(0, str(ROOT))
        from tests.promises import with_tests

        return with_tests(markdown)
    return markdown


def on_files(files: Any, config: Any) -> Any:
    """Put the JSON schema of a report beside the page about it."""
    from mkdocs.structure.files import File

    from rlacd.plain_json import to_json
    from rlacd.report import Report

    files.append(File.generated(config, "reference/report.schema.json", content=to_json(Report.schema())))
    return files


def on_post_build(config: Any) -> None:
    """Decompose the sample, and put its report beside the gallery: a page of its own that turns."""
    sys.path.insert(0, str(ROOT / "examples"))
    from sample import sample

    import rlacd

    mesh = Path(config.site_dir) / "gallery" / "chair.glb"
    sample().export(mesh)
    rlacd.decompose(mesh).save_report(mesh.with_suffix(".html"), up="y")


def _notebook(path: Path) -> str:
    """The text, the code and what it gave."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            if "text" in output:
                parts.append(f"```text\n{''.join(output['text'])}```")
            else:
                png = "".join(output["data"]["image/png"].split())
                parts.append(f'<img src="data:image/png;base64,{png}" alt="What the cell draws">')
    return "\n\n".join(parts)


def _commands() -> str:
    import click

    from rlacd.cli.main import COMMANDS, app

    parts = []
    for name in COMMANDS:
        path, command = ("rlacd", name), app.get_command(click.Context(app), name)
        assert command is not None
        lines = [f"## {' '.join(path)}", "", _plain(command.help or "").partition("Examples")[0].strip(), ""]
        arguments = [p for p in command.params if p.param_type_name == "argument"]
        usage = " ".join([*path, *(f"{p.metavar or p.name.upper()}" for p in arguments), "[OPTIONS]"])
        lines += ["```sh", usage, "```", "", "| option | meaning |", "|---|---|"]
        for parameter in command.params:
            if parameter.param_type_name == "argument" or {"--help", "--help-all"} & {*parameter.opts}:
                continue
            names = ", ".join(f"`{name}`" for name in [*parameter.opts, *parameter.secondary_opts])
            meaning = re.sub(r"--[a-z][a-z-]*", r"`\g<0>`", _plain(parameter.help or ""))
            lines.append(f"| {names} | {meaning.replace('|', chr(92) + '|')} |")
        parts.append("\n".join([*lines, ""]))
    return "\n".join(parts)


def _plain(text: str) -> str:
    """Help on one line a paragraph."""
    return re.sub(r"\s+", " ", text.replace("\b", "")).replace("<", "&lt;").strip()
