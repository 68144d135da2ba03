"""STEP and IGES files as input: a plate of 60 x 40 x 10 mm with two pins on it, and a ball whose file is in inches."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from rlacd.cli.main import app
from rlacd.errors import MeshFileError
from rlacd.io.read.cad import DEVIATION
from rlacd.io.read.load import load_mesh

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
