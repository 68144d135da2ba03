"""STEP and IGES files as input: a plate of 60 x 40 x 10 mm with two pins on it, and a ball whose file is in inches."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.cli.main import app
from rlacd.errors import MeshFileError, MissingExtraError
from rlacd.io.read.cad import DEVIATION
from rlacd.io.read.load import load_mesh
from tests.assets import read_glb

pytest.importorskip("cascadio", reason="the extra cad is not installed")

CASES = Path(__file__).parents[1] / "cases"

STAND, BALL = CASES / "stand.step", CASES / "ball_inch.igs"


def test_parts_of_an_assembly_are_nodes_in_metres(tmp_path: Path) -> None:
    mesh = load_mesh(shutil.copy(STAND, tmp_path / "stand.STP"))
    assert (mesh.up, mesh.metres, mesh.warnings) == ("z", 1.0, ())
    parts = {node.name: mesh.of_node(index) for index, node in enumerate(mesh.nodes)}
    solids = {name: trimesh.Trimesh(part.vertices, part.faces) for name, part in parts.items()}
    assert sorted(solids) == ["pin_left", "pin_right", "plate"]
    assert np.allclose(solids["plate"].bounds, [[0, 0, -0.01], [0.06, 0.04, 0]], atol=1e-8)
    for name, x in (("pin_left", 0.01), ("pin_right", 0.05)):
        assert np.allclose(solids[name].bounds.mean(axis=0), (x, 0.02, 0.01), atol=DEVIATION * 0.06)
        assert solids[name].volume == pytest.approx(np.pi * 0.005**2 * 0.02, rel=0.01)


def test_triangles_keep_to_the_surface_and_inches_are_converted() -> None:
    mesh = load_mesh(BALL)
    assert mesh.metres == 1.0
    of_corners, of_middles = (
        np.linalg.norm(p, axis=1) for p in (mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1))
    )
    assert np.allclose(of_corners, 0.03, atol=1e-6)
    assert 0.03 - of_middles.min() < DEVIATION * 0.06


def test_hulls_lie_below_their_parts_which_keep_their_colours(tmp_path: Path) -> None:
    result = rlacd.decompose(STAND, quality="fast", threads=1, per_node=True)
    header, _, _ = read_glb(result.save(tmp_path / "out.glb", file_format="unreal"))
    nodes = {node["name"]: node for node in header["nodes"]}
    for name in ("plate", "pin_left", "pin_right"):
        assert [header["nodes"][child]["name"] for child in nodes[name]["children"]] == [f"UCX_{name}_00"]
    colours = [one["pbrMetallicRoughness"].get("baseColorFactor") for one in header["materials"]]
    assert [1.0, 0.0, 0.0, 1.0] in colours


def test_a_length_needs_no_unit_and_another_than_metres_is_warned_of(tmp_path: Path) -> None:
    words = ["decompose", str(STAND), "-o", str(tmp_path / "out.glb"), "--quality", "fast", "--threshold", "1mm"]
    assert CliRunner().invoke(app, words).exit_code == 0
    run = CliRunner().invoke(app, [*words[:-1], "5%", "--unit", "mm"])
    assert "warning: the unit of stand.step is 1 m, by its format or by what it says; --unit mm overrides" in run.stderr


def test_parts_that_lie_in_other_files_are_missed(tmp_path: Path) -> None:
    text, brep = STAND.read_text(), r"ADVANCED_BREP_SHAPE(_REPRESENTATION\('',\(#\d+),#\d+"
    (tmp_path / "one.step").write_text(re.sub(brep, r"SHAPE\1", text, count=1))
    (tmp_path / "all.step").write_text(re.sub(brep, r"SHAPE\1", text))
    assert "left out: 1" in load_mesh(tmp_path / "one.step").warnings[0]
    with pytest.raises(MeshFileError, match="export them all into one"):
        load_mesh(tmp_path / "all.step")


@pytest.mark.promise("hostile-files")
@pytest.mark.parametrize(
    ("name", "content"),
    [("a.step", b"ISO-10303-21;"), ("a.stp", STAND.read_bytes()[:9000]), ("a.igs", bytes(200) + b"S")],
)
def test_damaged_files_are_refused_in_one_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshFileError, match="export"):
        load_mesh(tmp_path / name)


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cascadio", None)
    with pytest.raises(MissingExtraError, match=r"rlacd\[cad\]"):
        load_mesh(STAND)
