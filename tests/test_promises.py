"""Every promise of the documentation is held by tests; pages, packaging and shells are as they say."""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import trimesh

import rlacd
from fuzz.faults import Fault, command, tree
from rlacd.cli.exit_codes import ExitCode
from rlacd.plain_json import to_json
from rlacd.report import Report
from tests.promises import PAGE, holders, promises, with_tests

ROOT = Path(__file__).resolve().parent.parent
PROMISES = promises(PAGE.read_text(encoding="utf-8"))
HOLDERS = holders()


def test_every_promise_is_held_on_every_push() -> None:
    assert len(PROMISES) > 40
    assert set(HOLDERS) == set(PROMISES), "a promise without a test, or a test of a promise that the page lacks"
    assert {name for name, tests in HOLDERS.items() if not any(test.on_push for test in tests)} == set()


def test_the_page_of_promises_names_their_tests() -> None:
    page = with_tests(PAGE.read_text(encoding="utf-8"))
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    assert {line.count("|") for line in rows} == {4}
    assert all(test.link in page for tests in HOLDERS.values() for test in tests)


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """Three bars that cross."""
    bars = [trimesh.creation.box(size) for size in ((3, 0.4, 0.4), (0.4, 2, 0.4), (0.4, 0.4, 1))]
    trimesh.util.concatenate(bars).export(tmp_path / "bars.stl")
    return tmp_path / "bars.stl"


@pytest.mark.slow
@pytest.mark.promise("no-network")
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
@pytest.mark.promise("clock")
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
    {"threshold_abs": 0.1},
    {"criterion": rlacd.NavigableSpace(radius=0.2, tolerance=0.1)},
    {"primitives": True, "overlap": 0.005},
    {"per_node": True, "avoid": [trimesh.creation.box(bounds=[(9, 9, 9), (10, 10, 10)])]},
]


def rows(page: str) -> list[list[str]]:
    """The names in the first column of the table of a page, row by row."""
    lines = (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines()
    cells = [line.split("|")[1].strip() for line in lines if line.startswith("| ")][1:]
    return [re.findall(r"`([^`]+)`", cell) or [cell] for cell in cells]


def test_reports_fit_their_schema_and_every_key_is_explained() -> None:
    schema = Report.schema()
    judge = jsonschema.Draft202012Validator(schema)
    judge.check_schema(schema)
    found = set[str]()
    for options in REPORTS:
        report = rlacd.decompose(trimesh.Scene(ELL), quality="fast", threads=1, **options).report
        plain = json.loads(to_json(report))
        assert [error.message for error in judge.iter_errors(plain)] == []
        assert plain == report.as_dict()
        found |= plain.keys()
    assert found == schema["properties"].keys()
    assert all(value["description"] for value in inner(schema))


def inner(schema: Any) -> Iterator[Any]:
    """The schema of every key, of those in others too."""
    for key, value in schema.items() if isinstance(schema, dict) else ():
        yield from value.values() if key == "properties" else ()
        for below in value if isinstance(value, list) else [value]:
            yield from inner(below)


@pytest.mark.promise("exit-codes")
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
        assert preset.file_type is None or looks[preset.file_type] in file, name


def test_the_readme_has_the_numbers_of_the_benchmarks() -> None:
    readme, page = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/benchmarks.md"))
    table = re.findall(r"(?:^\|.*\n)+", readme, re.MULTILINE)[0].splitlines()
    assert len(table) == 10
    assert "\n".join(table) in page


BENCHMARKS = re.split(r"^## ", (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]


@pytest.mark.parametrize("text", BENCHMARKS, ids=[text.splitlines()[0] for text in BENCHMARKS])
def test_a_benchmark_names_its_command_and_date(text: str) -> None:
    """The commands are there and have the options that the page gives them."""
    commands = [shlex.split(words) for words in re.findall(r"`python -m (benchmarks\b[^`]+)`", text)]
    assert commands or "`du -m`" in text
    assert re.search(r"measured on\s\d+ \w+ \d{4}", text)
    for _, name, *words in commands:
        command = import_module(f"benchmarks.{name.replace('-', '_')}").app
        options = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= options


@pytest.mark.parametrize(
    ("hidden", "extra", "words"),
    [
        ("ray", "fleet", "batch FOLDER -o OUT --ray local"),
        ("torch", "train", "train FOLDER --run OUT --preset one-mesh"),
    ],
)
@pytest.mark.promise("before-work")
def test_a_command_without_its_extra_names_it(hidden: str, extra: str, words: str, mesh: Path) -> None:
    """In a fresh interpreter, where no earlier import of the library is in the way."""
    folder, out = mesh.parent, mesh.parent / "out"
    arguments = [{"FOLDER": str(folder), "OUT": str(out)}.get(word, word) for word in words.split()]
    code = f"import sys; sys.modules[{hidden!r}] = None; from rlacd.cli.main import main; main()"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == ExitCode.BAD_INPUT
    assert f"pip install 'rlacd[{extra}] @ git+https://github.com/rlacd/rlacd'" in done.stderr
    assert done.stderr.strip().count("\n") == 0
    assert not out.exists()


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_and_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bash runs the script that `--show-completion` prints."""
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    start = "import sys; sys.argv[0] = 'rlacd'; from rlacd.cli.main import main; main()"
    (tmp_path / "rlacd").write_text(f'#!/bin/sh\nexec \'{sys.executable}\' -c "{start}" "$@"\n', encoding="utf-8")
    (tmp_path / "rlacd").chmod(0o755)
    ask = 'COMPREPLY=(); COMP_WORDS=({}); COMP_CWORD={}; _rlacd_completion rlacd; echo "${{COMPREPLY[*]}}"\n'
    script = 'eval "$(rlacd --show-completion bash)"\n' + ask.format("rlacd dec", 1)
    script += ask.format("rlacd decompose --thre", 2)
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=120)
    command, options = done.stdout.splitlines()
    assert command == "decompose"
    assert {"--threshold", "--threads"} <= set(options.split())
    assert all(option.startswith("--thre") for option in options.split())


def test_pages_that_the_source_names_exist() -> None:
    """In comments and docstrings: the pages that a number or a decision rests on."""
    for path in (*ROOT.glob("src/**/*.py"), *ROOT.glob("benchmarks/*"), *ROOT.glob("native/**/*.[ch]pp")):
        if path.is_file():
            for page in re.findall(r"\b(?:docs|research)/[\w/]+\.md\b", path.read_text(encoding="utf-8")):
                assert (ROOT / page).is_file(), f"{path.relative_to(ROOT)} names {page}"


WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_version_is_the_same_everywhere() -> None:
    assert re.search(r"^version: (.*)$", text("CITATION.cff"), re.M)[1] == rlacd.__version__  # type: ignore[index]
    assert re.search(r'version: "(.*)"', text("packaging/conda/recipe.yaml"))[1] == rlacd.__version__  # type: ignore[index]
    assert f"## [{rlacd.__version__}]" in text("CHANGELOG.md")
    assert 'dynamic = ["version"' in text("pyproject.toml")


def test_the_recipe_needs_what_the_package_needs() -> None:
    declared = re.search(r"^dependencies = \[\n(.*?)^\]", text("pyproject.toml"), re.M | re.S)[1]  # type: ignore[index]
    wanted = {re.split(r"[<>=;]", line)[0] for line in re.findall(r'"([^"]+)"', declared)}
    recipe = text("packaging/conda/recipe.yaml").partition("  run:")[2].partition("tests:")[0]
    assert wanted == set(re.findall(r"- (\S+) >=", recipe))


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_actions_are_pinned_and_have_no_rights_they_do_not_need(workflow: Path) -> None:
    content = workflow.read_text(encoding="utf-8")
    for used in re.findall(r"uses: (\S+)", content):
        assert used.startswith("./") or re.fullmatch(r"[\w.-]+/[\w./-]+@[0-9a-f]{40}", used), used
    assert "\npermissions: {}\n" in content, "every job states what it may do"


def test_what_workflows_run_and_the_metadata_name_exists() -> None:
    told = "".join(path.read_text(encoding="utf-8") for path in WORKFLOWS)
    files = set(re.findall(r"tests/[\w/]+\.py", told + text("pyproject.toml")))
    assert len(files) > 5
    assert not [name for name in files if not (ROOT / name).is_file()]
    targets = set(re.findall(r"run: make ([\w-]+)", told))
    assert targets <= set(re.findall(r"^([\w-]+):", text("Makefile"), re.M))
    tested = re.search(r"python: \[(.*)\]", told)[1]  # type: ignore[index]
    assert re.findall(r"Python :: (3\.\d+)", text("pyproject.toml")) == re.findall(r"[\d.]+", tested)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete(shell: str) -> None:
    program = f"import os; os.environ['_RLACD_COMPLETE'] = '{shell}_source'; from rlacd.cli.main import main; main()"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert "rlacd" in run.stdout
    assert "_RLACD_COMPLETE" in run.stdout
