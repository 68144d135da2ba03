"""What the README shows: the sample is what it says, and the table names every option there is."""

from __future__ import annotations

import importlib.util
import inspect
from pathlib import Path
from types import ModuleType

import pytest
import typer

import rlacd
from rlacd.cli import app

ROOT = Path(__file__).resolve().parent.parent


def sample_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("sample", ROOT / "examples" / "sample.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_sample_is_two_closed_bodies_of_a_few_thousand_triangles() -> None:
    scene = sample_script().sample()
    assert set(scene.geometry) == {"chair", "jug"}
    assert all(mesh.is_watertight and mesh.body_count == 1 for mesh in scene.geometry.values())
    assert scene.geometry["chair"].euler_number == 2 - 2 * 7, "a chair with seven windows to see through"
    assert scene.geometry["jug"].euler_number == 0, "a jug with one handle"
    assert 2000 < sum(len(mesh.faces) for mesh in scene.geometry.values()) < 6000
    height = scene.extents[1]
    assert height == pytest.approx(0.9, abs=0.02), "metres, y up"


def test_the_sample_is_the_same_every_time() -> None:
    script = sample_script()
    assert script.sample().export(file_type="glb") == script.sample().export(file_type="glb")


def test_the_readme_names_every_option() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    command = typer.main.get_command(app).commands["decompose"]  # type: ignore[attr-defined]
    options = {name for parameter in command.params for name in parameter.opts if name.startswith("--")}
    missing = {
        name for name in options - {"--help", "--quiet"} if f"{name}`" not in readme and f"{name}/" not in readme
    }
    assert missing == set()
    arguments = set(inspect.signature(rlacd.decompose).parameters) - {"mesh"}
    assert {name for name in arguments if f"`{name}`" not in readme} == set()


def test_the_command_offers_every_argument_of_the_function() -> None:
    command = typer.main.get_command(app).commands["decompose"]  # type: ignore[attr-defined]
    offered = {parameter.name for parameter in command.params}
    assert set(inspect.signature(rlacd.decompose).parameters) - {"progress"} <= offered
