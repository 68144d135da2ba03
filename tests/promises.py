"""The promises of docs/promises.md, and the tests that hold them: those marked ``@pytest.mark.promise("name")``."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "promises.md"
SOURCE = "https://github.com/rlacd/rlacd/blob/main/"

ROW = re.compile(r"^\| `([\w-]+)` \| (.+) \|$", re.MULTILINE)
MARK, NIGHTLY = "pytest.mark.promise", "pytest.mark.nightly"


@dataclass(frozen=True)
class Holder:
    """A test that holds a promise: its file below the root, its name, and whether it runs on every push."""

    path: str
    name: str
    on_push: bool

    @property
    def link(self) -> str:
        """The test's name as the sentence that it is, leading to its file."""
        return f"[{self.name.removeprefix('test_').replace('_', ' ')}]({SOURCE}{self.path})"


def promises(page: str) -> dict[str, str]:
    """The sentence of every promise of a page, by its name."""
    found: list[tuple[str, str]] = ROW.findall(page)
    if len(found) != len(dict(found)):
        raise ValueError("a promise stands twice")
    return dict(found)


def holders() -> dict[str, list[Holder]]:
    """The tests that hold each promise, by its name, in the order of their files."""
    found: dict[str, list[Holder]] = defaultdict(list)
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        module = ast.parse(path.read_text(encoding="utf-8"))
        for test, on_push in _tests(module.body, f"pytestmark = {NIGHTLY}" not in map(ast.unparse, module.body)):
            for mark in test.decorator_list:
                if isinstance(mark, ast.Call) and ast.unparse(mark.func) == MARK:
                    for name in map(ast.literal_eval, mark.args):
                        found[name].append(Holder(path.relative_to(ROOT).as_posix(), test.name, on_push))
    return dict(found)


def _tests(body: list[ast.stmt], on_push: bool) -> Iterator[tuple[ast.FunctionDef, bool]]:
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            pushed = on_push and not any(NIGHTLY in ast.unparse(mark) for mark in node.decorator_list)
            if isinstance(node, ast.ClassDef):
                yield from _tests(node.body, pushed)
            elif node.name.startswith("test_"):
                yield node, pushed


def with_tests(page: str) -> str:
    """The page with a column that names the tests of every promise."""
    held = holders()
    page = ROW.sub(lambda row: f"{row[0]} {' · '.join(test.link for test in held[row[1]])} |", page)
    return page.replace("| what holds |\n|---|---|", "| what holds | tests |\n|---|---|---|")
