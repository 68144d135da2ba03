"""The recipes of docs/guides/simulators.md run as written, each in an environment that has its simulator."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.engines.engines import PATIENCE, python_with
from tests.models import table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guides" / "simulators.md"
SECTIONS = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
RECIPES = {
    section.split("\n")[0]: found[0]
    for section in SECTIONS
    if (found := re.findall(r"```python\n(.*?)```", section, re.DOTALL))
}
QUICK = ("MuJoCo, MJX, MuJoCo Warp", "Drake", "PyBullet")
"""Of simulators in the project's own environment."""


def test_every_simulator_in_python_has_a_recipe() -> None:
    assert set(QUICK) < set(RECIPES)
    assert len(RECIPES) == 7


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.nightly) for name in RECIPES]
)
def test_a_recipe_runs_as_written(name: str, tmp_path: Path) -> None:
    (package,) = re.findall(r"\Aimport (\w+)", RECIPES[name])
    table().export(tmp_path / "chair.glb")
    words = [python_with(package, "rlacd"), "-c", RECIPES[name]]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
