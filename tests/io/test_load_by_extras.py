"""Formats that extras read: without its extra each is named, and damage is refused in one sentence."""

from __future__ import annotations

import re
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from fuzz.fbx import Model, fbx
from fuzz.seeds import CASES, written_by_extras
from rlacd import NavigableSpace
from rlacd.cli.main import app
from rlacd.errors import EmptyMeshError, MeshFileError, MissingExtraError
from rlacd.io.read import cad
from rlacd.io.read.contents import USUAL
from rlacd.io.read.gltf import read_gltf
from rlacd.io.read.load import load_mesh

BOX = trimesh.creation.box()

WHOLE = fbx([Model("box", BOX.vertices, BOX.faces.tolist())])

USD = ("usda", "usdc", "usdz")
EXTRAS = {"draco": "DracoPy", "fbx": "ufbx", "cad": "cascadio", "usd": "pxr"}
FORMATS = {"glb": "draco", "fbx": "fbx", "step": "cad", "stp": "cad", "igs": "cad"} | dict.fromkeys(USD, "usd")


@pytest.mark.parametrize("ending", ["glb", "fbx", "step", "igs", *USD])
def test_a_format_whose_extra_is_missing_names_it(tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch) -> None:
    extra = FORMATS[ending]
    pytest.importorskip(EXTRAS[extra])
    path = tmp_path / f"box.{ending}"
    path.write_bytes(next(seed.content for kind, seed in written_by_extras(BOX) if kind == ending))
    monkeypatch.setitem(sys.modules, EXTRAS[extra], None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'rlacd\[{extra}\] @ git"):
        load_mesh(path)


@pytest.mark.promise("hostile-files")
@pytest.mark.parametrize(
    ("ending", "content"),
    [
        pytest.param("fbx", b"Kaydara FBX Binary  \0\x1a\0", id="the head of an FBX file"),
        pytest.param("fbx", WHOLE[:-500], id="an FBX file cut off"),
        pytest.param("fbx", fbx([Model("wild", BOX.vertices, [[0, 1, 800]])]), id="an index of FBX"),
        pytest.param("fbx", WHOLE.replace(b"Vertices", b"Verticez"), id="FBX without points"),
        pytest.param("fbx", b"; FBX 6.1.0 project file\n", id="an empty FBX file"),
        pytest.param("step", b"ISO-10303-21;", id="the head of a STEP file"),
        pytest.param("stp", (CASES / "stand.step").read_bytes()[:9000], id="a STEP file cut off"),
        pytest.param("igs", bytes(200) + b"S", id="zeros as IGES"),
        pytest.param("igs", (CASES / "ball_inch.igs").read_bytes()[:4000], id="an IGES file cut off"),
        pytest.param("usda", b"#usda 1.0\n(((", id="USD as text"),
        pytest.param("usdc", b"PXR-USDC" + b"\xff" * 200, id="USD in binary"),
        pytest.param("usdz", b"PK\x03\x04" + bytes(60), id="an archive of USD"),
        pytest.param("obj", WHOLE, id="FBX by another name"),
    ],
)
def test_damage_is_refused_in_one_sentence(tmp_path: Path, ending: str, content: bytes) -> None:
    pytest.importorskip(EXTRAS[FORMATS.get(ending, "fbx")])
    (tmp_path / f"a.{ending}").write_bytes(content)
    says = r"not obj but fbx: rename it to \.fbx" if ending == "obj" else "export"
    with pytest.raises((MeshFileError, EmptyMeshError), match=says) as said:
        load_mesh(tmp_path / f"a.{ending}")
    assert len(str(said.value).splitlines()) == 1


STAND, BALL = CASES / "stand.step", CASES / "ball_inch.igs"
"""A plate of 60 x 40 x 10 mm with two pins on it, and a ball whose file is in inches."""

CAD = pytest.mark.skipif(find_spec("cascadio") is None, reason="the extra cad is not installed")


@CAD
def test_parts_of_an_assembly_are_nodes_in_metres(tmp_path: Path) -> None:
    mesh = load_mesh(shutil.copy(STAND, tmp_path / "stand.STP"))
    assert (mesh.up, mesh.metres, mesh.warnings) == ("z", 1.0, ())
    parts = {node.name: mesh.of_node(index) for index, node in enumerate(mesh.nodes)}
    solids = {name: trimesh.Trimesh(part.vertices, part.faces) for name, part in parts.items()}
    assert sorted(solids) == ["pin_left", "pin_right", "plate"]
    assert np.allclose(solids["plate"].bounds, [[0, 0, -0.01], [0.06, 0.04, 0]], atol=1e-8)
    for name, x in (("pin_left", 0.01), ("pin_right", 0.05)):
        assert np.allclose(solids[name].bounds.mean(axis=0), (x, 0.02, 0.01), atol=USUAL.share * 0.06)
        assert solids[name].volume == pytest.approx(np.pi * 0.005**2 * 0.02, rel=0.01)


def sag(mesh: Any) -> float:
    """How far triangles with corners on the ball lie inside it, by trimesh's closest points."""
    corners = mesh.vertices[mesh.faces]
    nearest = trimesh.triangles.closest_point(corners, np.zeros((len(corners), 3)))
    assert np.allclose(np.linalg.norm(corners, axis=2), 0.03, atol=1e-6)
    return 0.03 - float(np.linalg.norm(nearest, axis=1).min())


@CAD
def test_triangles_keep_to_the_surface_and_inches_are_converted() -> None:
    mesh = load_mesh(BALL)
    assert mesh.metres == 1.0
    assert mesh.deviation == pytest.approx(USUAL.share * 0.06, rel=0.01)
    assert sag(mesh) < mesh.deviation


@CAD
@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        ({"threshold": 0.01}, 0.01 / 20 * 0.06),
        ({"threshold_abs": 2e-4}, 2e-5),
        ({"threshold_abs": 0.2, "scale": 1000.0}, 0.02),
        ({"threshold_abs": 1e-5, "unit": "in"}, 1e-6),
        ({"criterion": NavigableSpace(0.2, 0.01)}, 0.005 / 10 * 0.06),
        ({"threshold": 0.5}, USUAL.share * 0.06),
    ],
    ids=str,
)
@pytest.mark.promise("certified")
def test_triangles_are_nearer_to_a_surface_than_a_tenth_of_the_threshold_and_that_is_said(
    options: dict[str, Any], wanted: float
) -> None:
    result = rlacd.decompose(BALL, quality="fast", threads=1, **options)
    said = result.report.deviation_abs
    size = np.ptp(result.source.vertices, axis=0).max()
    assert said == pytest.approx(wanted, rel=0.01)
    shrunk = trimesh.Trimesh(result.source.vertices * 0.06 / size, result.source.faces, process=False)
    assert sag(shrunk) <= said * 0.06 / size
    assert sum("overrides" in said for said in result.report.warnings) == ("unit" in options)


@CAD
def test_no_file_becomes_more_triangles_than_can_be_handled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound is lower here, in this process: a server of its own would not know."""
    monkeypatch.setattr(cad, "MOST_OF_CAD", 20_000)
    values = {"path": str(BALL), "kind": "iges", "share": 1e-4, "metres": None, "of_nodes": False}
    facts, blobs = cad.triangulate(Path())(values, {"file": BALL.read_bytes()})
    count = sum(len(shape.faces) for _, shape in read_gltf(BALL, blobs["glb"]).geometry)
    assert 15_000 < count < 25_000
    assert facts["sought"] == pytest.approx(6e-6, rel=0.01)
    assert facts["deviation"] > 5 * facts["sought"]


@CAD
def test_the_command_says_how_far_triangles_are_from_the_surface(tmp_path: Path) -> None:
    run = CliRunner().invoke(app, ["decompose", str(STAND), "-o", str(tmp_path / "out.glb"), "--threshold", "1mm"])
    assert "triangles, up to 0.06 mm from the surface in the file" in run.stderr
    assert "triangles lie up to 6e-05 from" in CliRunner().invoke(app, ["info", str(STAND)]).output


@CAD
def test_a_length_needs_no_unit_and_another_than_metres_is_warned_of(tmp_path: Path) -> None:
    words = ["decompose", str(STAND), "-o", str(tmp_path / "out.glb"), "--quality", "fast", "--threshold", "1mm"]
    assert CliRunner().invoke(app, words).exit_code == 0
    run = CliRunner().invoke(app, [*words[:-1], "5%", "--unit", "mm"])
    assert "warning: the unit of stand.step is 1 m, by its format or by what it says; --unit mm overrides" in run.stderr


@CAD
def test_parts_that_lie_in_other_files_are_missed(tmp_path: Path) -> None:
    text, brep = STAND.read_text(), r"ADVANCED_BREP_SHAPE(_REPRESENTATION\('',\(#\d+),#\d+"
    (tmp_path / "one.step").write_text(re.sub(brep, r"SHAPE\1", text, count=1))
    (tmp_path / "all.step").write_text(re.sub(brep, r"SHAPE\1", text))
    assert "left out: 1" in load_mesh(tmp_path / "one.step").warnings[0]
    with pytest.raises(MeshFileError, match="export them all into one"):
        load_mesh(tmp_path / "all.step")
