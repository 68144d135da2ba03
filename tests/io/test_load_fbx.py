"""FBX files as input. The positions of real ones are those that Autodesk's own SDK gives, by FBX2glTF 0.9.7."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rlacd
from fuzz.fbx import PIVOTED, Model, Tree, fbx
from rlacd.io.read.load import load_mesh

pytest.importorskip("ufbx", reason="the extra fbx is not installed")

BOX = trimesh.creation.box((2, 4, 6))

QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
"""The sides of `BOX`."""

TURNED = {**PIVOTED, "Lcl Translation": (10, 0, 0), "Lcl Rotation": (0, 0, 90)}

CASE = Model("case", BOX.vertices, QUADS, (1, 0, 0), properties=TURNED)

LID = Model("lid", BOX.vertices, BOX.faces.tolist(), below=0, properties={"Lcl Scaling": (1, 1, -2)})

REAL = Path("/usr/share/assimp/models/FBX")


def read(path: Path, content: bytes) -> dict[str, trimesh.Trimesh]:
    path.write_bytes(content)
    mesh = load_mesh(path)
    parts = [mesh.of_node(index) for index in range(len(mesh.nodes))]
    return {node.name: trimesh.Trimesh(one.vertices, one.faces) for node, one in zip(mesh.nodes, parts, strict=True)}


@pytest.mark.parametrize("text", [False, True])
def test_nodes_stand_where_pivots_and_transforms_of_the_geometry_put_them(tmp_path: Path, text: bool) -> None:
    parts = read(tmp_path / "box.fbx", fbx([CASE, LID], text=text))
    # 10 + 1 to the right, turned about a pivot 2 up; 5 to the front for the geometry of the case alone.
    assert np.allclose(parts["case"].bounds, [[11, 1, 2], [15, 3, 8]])
    assert np.allclose(parts["lid"].bounds, [[11, 1, -6], [15, 3, 6]])
    assert [part.volume for part in parts.values()] == pytest.approx([48, 96])


@pytest.mark.parametrize(("up", "axis"), [(1, "y"), (2, "z")])
def test_the_file_says_what_points_up_and_how_long_its_unit_is(tmp_path: Path, up: int, axis: str) -> None:
    path = tmp_path / "box.fbx"
    path.write_bytes(fbx([replace(LID, below=-1)], up=up, unit=2.54))
    mesh = load_mesh(path)
    assert (mesh.up, mesh.metres) == (axis, pytest.approx(0.0254))
    result = rlacd.decompose(path, unit="file", quality="fast", threads=1)
    assert np.allclose(result.hulls[0].extents, np.array((2, 4, 12)) * 0.0254)


def test_a_file_that_points_up_along_a_negative_axis_is_turned_to_y(tmp_path: Path) -> None:
    content = fbx([replace(LID, below=-1)], text=True, up=2).replace(
        b'"UpAxisSign", "int", "", "A", 1', b'"UpAxisSign", "int", "", "A", -1'
    )
    parts = read(tmp_path / "box.fbx", content)
    assert np.allclose(parts["lid"].extents, (2, 12, 4))
    assert parts["lid"].volume == pytest.approx(96)


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    bone: Tree = ("Deformer", [5, "skin\0\1Deformer", "Skin"], [])
    level: Tree = ("NodeAttribute", [6, "levels\0\1NodeAttribute", "LodGroup"], [])
    key = {"KeyTime": [0], "KeyValueFloat": [0.0], "KeyAttrFlags": [0], "KeyAttrDataFloat": [0.0] * 4}
    keys = [(name, [np.array(values)], []) for name, values in {**key, "KeyAttrRefCount": [1]}.items()]
    curve: Tree = ("AnimationCurve", [7, "\0\1AnimCurve", ""], keys)
    group = Model("group", BOX.vertices[:0], [])
    models = [group, *(Model(f"level_{i}", BOX.vertices, QUADS, below=0) for i in range(3))]
    models.append(Model("ghost", BOX.vertices, QUADS, properties={"Visibility": (0.0,)}))
    content = fbx(models, text=True, more=[bone, level, curve])
    content = content.replace(b'C: "OO", 1000, 100\n', b'C: "OO", 6, 100\n')
    parts = read(tmp_path / "box.fbx", content.replace(b'"Visibility", "Vector3D"', b'"Visibility", "Visibility"'))
    assert list(parts) == ["level_0"]
    assert set(load_mesh(tmp_path / "box.fbx").warnings) == {
        "skinned meshes of box.fbx are read as bound, at their nodes",
        "animations of box.fbx were left out",
        "lower levels of detail were left out: 2",
        "hidden nodes were left out, with those below them: 1",
    }


@pytest.mark.nightly
@pytest.mark.skipif(not REAL.is_dir(), reason="Debian's package assimp-testmodels is not installed")
@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("close_to_identity_transforms.fbx", (-0.08214, -0.06124, -0.06044), (0.14362, 0.15981, 0.16537)),
        ("cubes_with_mirroring_and_pivot.fbx", (-0.06067, -0.14515, -0.06044), (0.14866, 0.15981, 0.26727)),
        ("cubes_with_names.fbx", (-0.06067, -0.14515, -0.06044), (0.14866, 0.05998, 0.26727)),
        ("embedded_ascii/box.FBX", (-0.59989, 0, -0.6), (0.60011, 1.2, 0.6)),
        ("global_settings.fbx", (-20.34863, -21.94934, -19.4473), (36.71699, 35.11629, 37.61832)),
        ("maxPbrMaterial_metalRough.fbx", (-8.34069, 0, -11.65346), (9.48201, 16.78758, 10.31093)),
        ("phong_cube.fbx", (-0.005, -0.005, -0.005), (0.005, 0.005, 0.005)),
        ("spider.fbx", (-92.65524, -42.23381, -106.6912), (57.93622, 37.50396, 86.69119)),
    ],
)
def test_real_files_are_placed_as_autodesks_sdk_places_them(name: str, low: tuple[float], high: tuple[float]) -> None:
    mesh = load_mesh(REAL / name)
    assert mesh.metres is not None
    points = mesh.vertices * mesh.metres
    if mesh.up == "z":
        points = points[:, [0, 2, 1]] * (1, 1, -1)
    assert np.allclose([points.min(axis=0), points.max(axis=0)], [low, high], rtol=1e-5, atol=2e-5)
