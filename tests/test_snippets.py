"""The documentation works as written: its Python runs, page by page, on small files; its commands have such options."""

from __future__ import annotations

import re
import shlex
import sys
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.cli.main import app
from rlacd.compat import coacd
from rlacd.view import viewer

ROOT = Path(__file__).resolve().parent.parent
SNIPPET = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHELL = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BEFORE = re.compile(r"^.*# before.*\n", re.MULTILINE)
"""What a reader is told to replace, which needs the other tool."""

PAGES_OF_TEXT = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

PAGES = {
    str(page.relative_to(ROOT)): found
    for page in PAGES_OF_TEXT
    if page.name != "simulators.md" and (found := SNIPPET.findall(page.read_text(encoding="utf-8")))
}
"""But for the recipes for simulators: tests/engines/test_recipes.py."""

COMMAND = re.compile(r"^ *(?:rlacd|python -m) ([a-z].*)$", re.MULTILINE)
COMMANDS = sorted(
    {
        line
        for page in PAGES_OF_TEXT
        for block in SHELL.findall(page.read_text(encoding="utf-8"))
        for line in COMMAND.findall(block)
        if not line.startswith(("fuzz", "tests", "pip"))
    }
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name; nothing waits for Ctrl-C, or changes other packages for later tests."""
    post = trimesh.creation.box((1, 1, 3))
    seat = trimesh.creation.box((3, 1, 1), trimesh.transformations.translation_matrix((1, 0, -1)))
    ell = trimesh.boolean.union([post, seat])
    for name in ("chair.glb", "house.glb", "link.obj", "block.stl"):
        ell.export(tmp_path / name)
    (tmp_path / "robot.urdf").write_text(
        '<robot name="r"><link name="l"><collision><geometry><mesh filename="link.obj"/></geometry></collision></link>'
        "</robot>"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(viewer.ViewServer, "wait", lambda self: None)
    monkeypatch.setitem(sys.modules, "coacd", coacd)
    monkeypatch.setattr(trimesh.decomposition, "convex_decomposition", trimesh.decomposition.convex_decomposition)
    return tmp_path


def test_the_readme_and_the_first_pages_have_snippets() -> None:
    assert {"README.md", "docs/index.md", "docs/start.md", "docs/coming_from.md", "docs/policies.md"} <= set(PAGES)


@pytest.mark.parametrize("page", PAGES)
def test_snippets_run_as_written(folder: Path, page: str) -> None:
    mesh = trimesh.load_mesh(folder / "link.obj")
    known: dict[str, Any] = {"rlacd": rlacd, "np": np, "mesh": mesh}
    known |= {"vertices": mesh.vertices, "points": mesh.vertices, "faces": mesh.faces}
    for snippet in PAGES[page]:
        exec(compile(BEFORE.sub("", snippet), page, "exec"), known)


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_have_the_options_that_pages_use(line: str) -> None:
    words = list(
        takewhile(lambda word: word not in {"|", ">", "&&", ";"}, shlex.split(line.replace("SEED", "1"), comments=True))
    )
    at: Any = app
    if words[0] == "benchmarks.learned.compare":
        assert import_module(words[0]).parser().parse_args(words[1:]).policies
        return
    if words[0] == "benchmarks":
        _, name, *words = words
        at = import_module(f"benchmarks.{name.replace('-', '_')}").app
    while hasattr(at, "resolve_command"):
        _, at, words = at.resolve_command(at.context_class(at), words)
    at.make_context("rlacd", words)
