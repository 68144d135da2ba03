"""The list of promises: each names tests that exist; and the promises that have no other place."""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import trimesh
import typer

import rlacd
from fuzz.faults import Fault, command, tree
from rlacd.cli.exit_codes import ExitCode
from rlacd.cli.main import app

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


ELL = [trimesh.creation.box((2, 0.4, 0.4)), trimesh.creation.box((0.4, 0.4, 2))]
REPORTS: list[dict[str, Any]] = [
    {},
    {"criterion": "volume"},
    {"criterion": rlacd.NavigableSpace(radius=0.1, tolerance=0.05)},
    {"primitives": True, "overlap": 0.01},
    {"per_node": True},
]


def rows(page: str) -> list[list[str]]:
    """The names in the first column of the table of a page, row by row."""
    lines = (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines()
    cells = [line.split("|")[1].strip() for line in lines if line.startswith("| ")][1:]
    return [re.findall(r"`([^`]+)`", cell) or [cell] for cell in cells]


def test_the_reference_names_every_key_of_a_report_and_no_other() -> None:
    documented = set()
    for names in rows("reference/report.md"):
        documented |= {names[0].partition(".")[0] + name if name.startswith(".") else name for name in names}
    found = set()
    for options in REPORTS:
        report = rlacd.decompose(trimesh.Scene(ELL), quality="fast", threads=1, **options).report
        for key, value in report.items():
            parts = {f"{key}.{part}" for part in value if not part.endswith("_m")} if isinstance(value, dict) else set()
            found |= parts if any(name.startswith(f"{key}.") for name in documented) else {key}
    assert found == documented


def test_the_reference_names_every_exit_code() -> None:
    assert [int(code) for (code,) in rows("reference/exit_codes.md")] == sorted(ExitCode)


def test_extras_are_those_that_the_project_has() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    section = text.split("[project.optional-dependencies]")[1].split("\n[")[0]
    extras = set(re.findall(r"^(\w+) = \[", section, re.MULTILINE))
    named = {name for row in rows("start.md") for name in re.findall(r"^rlacd\[(\w+)\]$", row[0])}
    assert named == extras
    sources = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    assert set(re.findall(r"rlacd\[(\w+)\]", sources)) <= extras


def section(page: str, title: str) -> str:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return text.split(f"\n## {title}\n")[1].split("\n## ")[0]


def test_presets_are_those_of_the_table() -> None:
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in section("formats.md", "Presets").splitlines()]
    table = {cells[0].strip("`"): cells[1:4] for cells in rows if cells and cells[0].startswith("`")}
    assert list(table) == list(rlacd.PRESETS)
    for name, (vertices, faces, file) in table.items():
        preset = rlacd.PRESETS[name]
        assert [vertices, faces] == [str(limit or "–") for limit in (preset.max_vertices, preset.max_faces)], name
        assert re.findall(r"`(\.\w+)`", file) == [preset.ending], name
        looks = {"unreal": "`UCX_`", "godot": "`-convcolonly`"}
        assert preset.file_format is None or looks[preset.file_format] in file, name


def test_the_readme_has_the_numbers_of_the_benchmarks() -> None:
    readme, page = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/benchmarks.md"))
    table = [line for line in readme.splitlines() if line.startswith("|")]
    assert len(table) == 9
    assert "\n".join(table) in page


BENCHMARKS = re.split(r"^## ", (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]


@pytest.mark.parametrize("text", BENCHMARKS, ids=[text.splitlines()[0] for text in BENCHMARKS])
def test_a_benchmark_names_its_command_date_and_commit(text: str) -> None:
    """The commands are there and have the options that the page gives them."""
    commands = [shlex.split(words) for words in re.findall(r"`((?:rlacd|python|du) [^`]+)`", text)]
    assert commands
    assert re.search(r"\d November 2026", text)
    assert re.search(r"\b[0-9a-f]{7}\b", text)
    for program, *words in commands:
        at: Any
        if words[:2] == ["-m", "benchmarks"]:
            at = typer.main.get_command(import_module(f"benchmarks.{words[2].replace('-', '_')}").app)
            words = words[3:]
        elif program == "rlacd" and len(words) > 1:
            at = typer.main.get_command(app)
        elif program == "python":
            known = ROOT.joinpath(*words[1].split(".")).with_suffix(".py").read_text(encoding="utf-8")
            assert [word for word in words if word.startswith("--") and f'"{word}"' not in known] == []
            continue
        else:
            continue
        while isinstance(at, typer.core.TyperGroup):
            _, at, words = at.resolve_command(typer.Context(at), words)
        options = {option for parameter in at.params for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= options


@pytest.mark.parametrize(
    ("hidden", "extra", "words"),
    [
        ("ray", "fleet", "batch FOLDER -o OUT --ray local"),
        ("fsspec", "fleet", "batch FOLDER -o memory://out"),
        ("torch", "train", "train FOLDER --run OUT --preset quick"),
    ],
)
def test_a_command_without_its_extra_names_it(hidden: str, extra: str, words: str, mesh: Path) -> None:
    """In a fresh interpreter, where no earlier import of the library is in the way."""
    folder, out = mesh.parent, mesh.parent / "out"
    arguments = [{"FOLDER": str(folder), "OUT": str(out)}.get(word, word) for word in words.split()]
    code = f"import sys; sys.modules[{hidden!r}] = None; from rlacd.cli.main import main; main()"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == ExitCode.BAD_INPUT
    assert f"pip install 'rlacd[{extra}]'" in done.stderr
    assert done.stderr.strip().count("\n") == 0
    assert not out.exists()


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_and_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bash runs the script that `--show-completion` prints."""
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    start = "import sys; sys.argv[0] = 'rlacd'; from rlacd.cli.main import main; main()"
    (tmp_path / "rlacd").write_text(f'#!/bin/sh\nexec \'{sys.executable}\' -c "{start}" "$@"\n', encoding="utf-8")
    (tmp_path / "rlacd").chmod(0o755)
    ask = 'COMP_WORDS=({}); COMP_CWORD={}; _rlacd_completion rlacd; echo "${{COMPREPLY[*]}}"\n'
    script = 'eval "$(rlacd --show-completion bash)"\n' + ask.format("rlacd dec", 1)
    script += ask.format("rlacd decompose --thre", 2)
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=120)
    command, options = done.stdout.splitlines()
    assert command == "decompose"
    assert {"--threshold", "--threads"} <= set(options.split())
    assert all(option.startswith("--thre") for option in options.split())
