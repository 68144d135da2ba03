"""What a release needs agrees: one version, one address, pinned actions, a changelog."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import rlacd

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_version_is_the_same_everywhere() -> None:
    assert re.search(r"^version: (.*)$", text("CITATION.cff"), re.M)[1] == rlacd.__version__  # type: ignore[index]
    assert re.search(r'version: "(.*)"', text("packaging/conda/recipe.yaml"))[1] == rlacd.__version__  # type: ignore[index]
    assert f"## [{rlacd.__version__}]" in text("CHANGELOG.md")
    assert 'dynamic = ["version"]' in text("pyproject.toml")


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


def test_the_module_runs_as_the_command() -> None:
    run = subprocess.run([sys.executable, "-m", "rlacd", "--version"], capture_output=True, text=True, timeout=120)
    assert run.stdout == f"rlacd {rlacd.__version__}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete(shell: str) -> None:
    program = f"import os; os.environ['_RLACD_COMPLETE'] = '{shell}_source'; from rlacd.cli.main import main; main()"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert "rlacd" in run.stdout
    assert "_RLACD_COMPLETE" in run.stdout
