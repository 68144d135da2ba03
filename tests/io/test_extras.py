"""Formats that extras read: without its extra each is named, and damage is refused in one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import trimesh

from fuzz.damaged import CASES, written_by_extras
from fuzz.fbx import Model, fbx
from rlacd.errors import EmptyMeshError, MeshFileError, MissingExtraError
from rlacd.io.read.load import load_mesh

BOX = trimesh.creation.box()

WHOLE = fbx([Model("box", BOX.vertices, BOX.faces.tolist())])

MODULES = {"glb": ("draco", "DracoPy"), "fbx": ("fbx", "ufbx"), "step": ("cad", "cascadio"), "igs": ("cad", "cascadio")}
MODULES |= dict.fromkeys(("stp",), MODULES["step"]) | dict.fromkeys(("usda", "usdc", "usdz"), ("usd", "pxr"))


@pytest.mark.parametrize("ending", sorted(MODULES.keys() - {"stp"}))
def test_a_format_whose_extra_is_missing_names_it(tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch) -> None:
    extra, module = MODULES[ending]
    pytest.importorskip(module)
    path = tmp_path / f"box.{ending}"
    path.write_bytes(next(seed.content for kind, seed in written_by_extras(BOX) if kind == ending))
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install 'rlacd\[{extra}\]'"):
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
        pytest.param("usda", b"#usda 1.0\n(((", id="USD as text"),
        pytest.param("usdc", b"PXR-USDC" + b"\xff" * 200, id="USD in binary"),
        pytest.param("usdz", b"PK\x03\x04" + bytes(60), id="an archive of USD"),
        pytest.param("obj", WHOLE, id="FBX by another name"),
    ],
)
def test_damage_is_refused_in_one_sentence(tmp_path: Path, ending: str, content: bytes) -> None:
    pytest.importorskip(MODULES.get(ending, MODULES["fbx"])[1])
    (tmp_path / f"a.{ending}").write_bytes(content)
    says = r"not obj but fbx: rename it to \.fbx" if ending == "obj" else "export"
    with pytest.raises((MeshFileError, EmptyMeshError), match=says) as said:
        load_mesh(tmp_path / f"a.{ending}")
    assert len(str(said.value).splitlines()) == 1
