"""The result object: what it says about itself and where it lets itself be written."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
import trimesh

from rlacd.decomposition import Decomposition
from rlacd.errors import OutputError
from tests.hulls import random_hull

SOURCE = trimesh.creation.box()


def result(count: int = 2, **report: object) -> Decomposition:
    hulls = [random_hull(seed) for seed in range(count)]
    return Decomposition(hulls, {"name": "cup", "complete": True, "concavity": {"max": 0.0312}, **report}, SOURCE)


def test_it_is_a_collection_of_hulls() -> None:
    cup = result(3)
    assert len(cup) == 3
    assert list(cup) == cup.hulls


def test_it_describes_itself_in_one_line() -> None:
    cup = result(2)
    faces = sum(len(hull.faces) for hull in cup)
    assert repr(cup) == f"<Decomposition: 2 hulls of cup, {faces} faces, max concavity 0.0312>"
    assert "1 hull of" in repr(result(1))
    assert "stopped by timeout" in repr(result(2, complete=False, stopped_by="timeout"))
    assert repr(Decomposition([], {}, SOURCE)) == "<Decomposition: 0 hulls of mesh, 0 faces>"


def test_it_cannot_be_changed_and_is_compared_by_identity() -> None:
    cup = result()
    with pytest.raises(dataclasses.FrozenInstanceError):
        cup.hulls = []  # type: ignore[misc]
    assert cup == cup
    assert cup != result()
    assert len({cup, result()}) == 2


def test_it_saves_to_a_file_and_to_a_folder_named_after_the_mesh(tmp_path: Path) -> None:
    cup = result(2)
    assert cup.save(tmp_path / "cup.glb") == tmp_path / "cup.glb"
    assert len(trimesh.load_scene(tmp_path / "cup.glb").geometry) == 2
    folder = cup.save(f"{tmp_path}/parts/", file_format="ply")
    assert sorted(path.name for path in folder.glob("*.ply")) == ["cup_000.ply", "cup_001.ply"]
    with pytest.raises(OutputError):
        cup.save(tmp_path / "cup.doc")
