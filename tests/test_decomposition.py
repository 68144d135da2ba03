"""The result object: what it says about itself and where it lets itself be written."""

from __future__ import annotations

import dataclasses
import shutil
import webbrowser
from pathlib import Path

import pytest
import trimesh

from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from tests.hulls import random_hull

SOURCE = trimesh.creation.box()


def result(count: int = 2, **report: object) -> Decomposition:
    hulls = [random_hull(seed) for seed in range(count)]
    return Decomposition(hulls, {"name": "cup", "complete": True, "concavity": {"max": 0.0312}, **report}, SOURCE)


def test_hulls_are_got_by_index_and_slice() -> None:
    cup = result(3)
    assert len(cup) == 3
    assert list(cup) == cup.hulls
    assert cup[0] is cup.hulls[0]
    assert cup[-1] is cup.hulls[2]
    assert cup[1:] == cup.hulls[1:]
    with pytest.raises(IndexError):
        cup[3]


def test_the_scene_has_a_node_per_hull_in_colours() -> None:
    cup = result(3)
    scene = cup.scene()
    assert list(scene.geometry) == list(scene.graph.nodes_geometry) == ["hull_000", "hull_001", "hull_002"]
    for hull, geometry in zip(cup, scene.geometry.values(), strict=True):
        assert (geometry.vertices == hull.vertices).all()
        assert (geometry.faces == hull.faces).all()
    assert len({tuple(geometry.visual.face_colors[0]) for geometry in scene.geometry.values()}) == 3


@pytest.fixture(scope="module")
def real() -> Decomposition:
    return decompose(SOURCE, quality="fast")


def test_a_notebook_shows_the_view_in_a_frame(real: Decomposition) -> None:
    page = real._repr_html_()
    assert page.startswith('<iframe srcdoc="')
    assert page.count('"') == 4, "the page is one attribute"
    assert "&lt;script" in page


@pytest.mark.slow
def test_show_opens_a_page_in_the_browser(real: Decomposition, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = real.show(up="y")
    assert opened == [page.as_uri()]
    assert page.read_text(encoding="utf-8").startswith("<!")
    shutil.rmtree(page.parent)


def test_it_describes_itself_in_one_line() -> None:
    cup = result(2)
    faces = sum(len(hull.faces) for hull in cup)
    assert repr(cup) == f"<Decomposition: 2 hulls of cup, {faces} triangles, max concavity 0.0312>"
    assert "1 hull of" in repr(result(1))
    assert "stopped early by timeout" in repr(result(2, complete=False, stopped_by="timeout"))
    assert repr(Decomposition([], {}, SOURCE)) == "<Decomposition: 0 hulls of mesh, 0 triangles>"


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
    with pytest.raises(OptionError):
        cup.save(tmp_path / "cup.doc")
