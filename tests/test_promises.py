"""The list of promises: each names tests that exist; and the promises that have no other place."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest
import trimesh

from fuzz.faults import Fault, command, tree

ROOT = Path(__file__).resolve().parent.parent
TEST = re.compile(r"`(tests/\w+\.py)::(\w+)`")


def promises() -> dict[str, str]:
    """The text of every promise by its name."""
    text = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
    found = re.findall(r"^- \*\*([\w-]+)\*\*: (.*?)(?=^- \*\*|^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert len(found) == len(dict(found)), "a name stands twice"
    assert len(found) == text.count("\n- "), "an item is not of the form '- **name**: sentence'"
    return dict(found)


@cache
def runs_on_push(path: str) -> dict[str, bool]:
    """The tests of a file, and whether each is run on every push."""
    module = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    found: dict[str, bool] = {}

    def look(body: list[ast.stmt], pushed: bool) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                on_push = pushed and not any("mark.nightly" in ast.unparse(mark) for mark in node.decorator_list)
                if isinstance(node, ast.ClassDef):
                    look(node.body, on_push)
                elif node.name.startswith("test_"):
                    found[node.name] = on_push

    look(module.body, "pytestmark = pytest.mark.nightly" not in map(ast.unparse, module.body))
    return found


@pytest.mark.parametrize("name", promises())
def test_a_promise_names_tests_that_exist(name: str) -> None:
    named = TEST.findall(promises()[name])
    assert named, "no test holds it"
    assert promises()[name].count("::") == len(named), "a test is not written as `tests/test_x.py::test_y`"
    missing = [
        f"{path}::{test}" for path, test in named if not (ROOT / path).is_file() or test not in runs_on_push(path)
    ]
    assert missing == []
    assert any(runs_on_push(path)[test] for path, test in named), "no test holds it on every push"


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """Three bars that cross."""
    bars = [trimesh.creation.box(size) for size in ((3, 0.4, 0.4), (0.4, 2, 0.4), (0.4, 0.4, 1))]
    trimesh.util.concatenate(bars).export(tmp_path / "bars.stl")
    return tmp_path / "bars.stl"


@pytest.mark.slow
def test_no_network_no_display_no_gpu(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection to any address would end the process, whatever library asks for it."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    words = ["decompose", str(mesh), "-o", str(mesh.with_name("out.glb")), "--report", str(mesh.with_name("out.html"))]
    run = command(words, Fault("no network", (0,), {"FAULT_NETWORK": "1"}))
    assert run.code == 0, run.said
    assert {"out.glb", "out.html"} <= set(tree(mesh.parent))


@pytest.mark.slow
@pytest.mark.parametrize("jump", ["0,-100000000", "20,100000000"])
def test_a_clock_that_jumps_changes_no_bytes(jump: str, mesh: Path) -> None:
    words = ["decompose", str(mesh), "--quality", "best", "--search-steps", "5", "--timeout", "300", "-o"]
    assert command([*words, str(mesh.with_name("calm.glb"))]).code == 0
    run = command([*words, str(mesh.with_name("jumpy.glb"))], Fault("clock jumps", (0,), {"FAULT_CLOCK": jump}))
    assert run.code == 0, run.said
    assert mesh.with_name("jumpy.glb").read_bytes() == mesh.with_name("calm.glb").read_bytes()


@pytest.mark.slow
def test_the_faults_are_real(mesh: Path) -> None:
    """What the tests above rely on: each fault is seen by the command."""
    words = ["decompose", str(mesh), "--quiet", "-o", str(mesh.with_name("out.obj"))]
    assert command(words, Fault("full disk", (), {"FAULT_DISK": "50"})).code == 3
    assert command(words, Fault("killed while writing", (), {"FAULT_CHANGE": "1,9"})).code == -9
    assert not mesh.with_name("out.obj").exists()


def test_the_source_is_python_3_10() -> None:
    for path in (ROOT / "src").rglob("*.py"):
        ast.parse(path.read_text(encoding="utf-8"), path.name, feature_version=(3, 10))
