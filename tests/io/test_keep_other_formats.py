"""Inputs that are no glTF files and are kept: converted with all the looks that their parser reads."""

from __future__ import annotations

import io
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.exchange.dae import export_collada

import rlacd
from fuzz.fbx import Model, fbx
from rlacd.io.read.beside import mesh_files
from tests.assets import Json, painted_obj, png, read_glb, view_of
from tests.hulls import assert_convex_hull
from tests.io.hostile.archives import MESH, model, threemf

Image = pytest.importorskip("PIL.Image", reason="the extra view is not installed")


RED, BLUE, PLAIN = [1, 0, 0, 1], [0, 0, 1, 1], [0.456, 0.468, 0.491, 1]
WOOD = None


def kept(path: Path, out: Path, **options: Any) -> tuple[Json, bytes, rlacd.Decomposition]:
    result = rlacd.decompose(path, quality="fast", threads=1, **options)
    header, binary, _ = read_glb(result.save(out, file_type="unreal"))
    return header, binary, result


def pixels(data: bytes) -> Any:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def colors(header: Json, mesh: int = 0) -> list[list[float] | None]:
    """The base colour of each material of a mesh, None where it is a picture or nothing is said."""
    painted = [
        header["materials"][one["material"]] for one in header["meshes"][mesh]["primitives"] if "material" in one
    ]
    looks = [one["pbrMetallicRoughness"] for one in painted]
    return [None if "baseColorTexture" in look else look.get("baseColorFactor") for look in looks]


def test_an_obj_keeps_its_materials_and_its_picture_in_one_node(tmp_path: Path) -> None:
    path = painted_obj(tmp_path)
    header, binary, _ = kept(path, tmp_path / "out.glb")
    assert [node["name"] for node in header["nodes"]] == ["crate", "UCX_crate_00"]
    assert header["nodes"][0]["children"] == [1]
    assert header["scenes"][0]["nodes"] == [0]
    painted = header["meshes"][0]["primitives"]
    assert len(painted) == 2
    assert all("TEXCOORD_0" in primitive["attributes"] for primitive in painted)
    assert colors(header) == [None, [1.0, 0.0, 0.0, 1.0]] or colors(header) == [[1.0, 0.0, 0.0, 1.0], None]
    assert (pixels(view_of(header, binary, header["images"][0]["bufferView"])) == pixels(png())).all()
    read = trimesh.load_scene(tmp_path / "out.glb", process=False)
    crate = [mesh for name, mesh in read.geometry.items() if not name.startswith("UCX_")]
    assert sum(mesh.area for mesh in crate) == pytest.approx(trimesh.creation.box((1, 2, 3)).area)


def two_painted(folder: Path) -> Path:
    """Two objects, and a hull for an engine."""
    return painted_obj(folder, "crate", "lid", "UCX_old")


@pytest.mark.parametrize("name", ["crate.obj", "pair.obj", "arm.dae"])
def test_mjcf_keeps_colours_and_pictures_of_materials(tmp_path: Path, name: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    path = {"crate.obj": painted_obj, "pair.obj": two_painted, "arm.dae": arm}[name](tmp_path)
    result = rlacd.decompose(path, quality="fast", threads=1)
    model = mujoco.MjModel.from_xml_path(str(result.save(tmp_path / "out.xml")))
    tints = sorted(model.mat_rgba.tolist())
    assert tints == sorted([[1, 0, 0, 1], [0, 0, 1, 1] if name == "arm.dae" else [1, 1, 1, 1]])
    assert model.ntex == (name != "arm.dae")
    seen = [geom for geom in range(model.ngeom) if model.geom_matid[geom] >= 0]
    assert len(seen) == 2
    assert all(model.geom_contype[geom] == 0 for geom in seen)


@pytest.mark.parametrize("damage", ["missing", "cut off", "huge", "no materials"])
def test_a_picture_that_cannot_be_read_is_left_out(
    tmp_path: Path, damage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = painted_obj(tmp_path)
    if damage == "missing":
        (tmp_path / "wood.png").unlink()
    elif damage == "cut off":
        (tmp_path / "wood.png").write_bytes(png()[:50])
    elif damage == "huge":
        monkeypatch.setattr("PIL.Image.MAX_IMAGE_PIXELS", 1)
    else:
        (tmp_path / "crate.mtl").unlink()
    with pytest.warns(UserWarning, match="left out"):
        header, _, _ = kept(path, tmp_path / "out.glb")
    assert "images" not in header
    assert [node["name"] for node in header["nodes"]] == ["crate", "UCX_crate_00"]


@pytest.mark.parametrize(
    "named", [r"map_Kd in\wood.png", "map_Kd -s 2 2 1 -clamp on in/wood.png", "map_Kd  in/wood.png"]
)
def test_pictures_and_opacities_of_materials_are_read_as_exporters_write_them(tmp_path: Path, named: str) -> None:
    path = painted_obj(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "wood.png").rename(tmp_path / "in" / "wood.png")
    (tmp_path / "crate.mtl").write_text(f"newmtl wood\n{named}\nnewmtl red\nKd 1 0 0\nTr 0.5\n")
    assert len(mesh_files(path)) == 3
    header, binary, _ = kept(path, tmp_path / "out.glb")
    wood, red = header["materials"][:2]
    assert (pixels(view_of(header, binary, header["images"][0]["bufferView"])) == pixels(png())).all()
    assert wood["pbrMetallicRoughness"].get("baseColorFactor", [1.0] * 4) == [1.0] * 4
    assert red["alphaMode"] == "BLEND"
    assert red["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 0, 0, 0.5], abs=0.01)


def test_a_picture_outside_the_folder_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    path = painted_obj(tmp_path / "in")
    assert sorted(mesh_files(path)) == ["crate.mtl", "crate.obj", "wood.png"], "what is sent along with it"
    (tmp_path / "in" / "wood.png").rename(tmp_path / "wood.png")
    paints = tmp_path / "in" / "crate.mtl"
    paints.write_text(paints.read_text().replace("wood.png", "../wood.png"))
    header, _, _ = kept(path, tmp_path / "out.glb")
    assert "images" not in header
    assert sorted(mesh_files(path)) == ["crate.mtl", "crate.obj"]


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_a_ply_keeps_the_colours_of_its_vertices(tmp_path: Path, encoding: str) -> None:
    box = trimesh.creation.box()
    tints = np.arange(32, dtype=np.uint8).reshape(8, 4) * 8
    tints[:, 3] = 255
    box.visual = trimesh.visual.ColorVisuals(box, vertex_colors=tints)
    path = tmp_path / "box.ply"
    path.write_bytes(box.export(file_type="ply", encoding=encoding, vertex_normal=False))
    header, binary, _ = kept(path, tmp_path / "out.glb")
    attributes = header["meshes"][0]["primitives"][0]["attributes"]
    described = [header["accessors"][attributes[name]] for name in ("POSITION", "COLOR_0")]
    assert [one["componentType"] for one in described] == [5126, 5121]
    points, seen = (view_of(header, binary, one["bufferView"])[one.get("byteOffset", 0) :] for one in described)
    for point, tint in zip(
        np.frombuffer(points, "<f4").reshape(-1, 3), np.frombuffer(seen, "u1").reshape(-1, 4), strict=True
    ):
        assert (tints[np.abs(box.vertices - point).sum(axis=1).argmin()] == tint).all()


def arm(folder: Path) -> Path:
    """A scene as COLLADA, with a node in red and one in blue that is turned and moved."""
    boxes = [trimesh.creation.box((1, 0.2, 0.2)) for _ in range(2)]
    for box, tint in zip(boxes, ([255, 0, 0, 255], [0, 0, 255, 255]), strict=True):
        box.visual.face_colors = tint
    turn = trimesh.transformations.rotation_matrix(0.5, (0, 0, 1))
    turn[0, 3] = 2
    placed = f"<matrix>{' '.join(map(str, turn.ravel().tolist()))}</matrix>"
    text = export_collada(boxes).decode().replace("Y_UP", "Z_UP")
    (folder / "arm.dae").write_text(re.sub(r'(<node[^>]*id="node1"[^>]*>)', rf"\g<1>{placed}", text))
    return folder / "arm.dae"


@pytest.mark.parametrize("name", ["crate.obj", "arm.dae"])
def test_a_converted_file_is_in_the_unit_of_the_hulls(tmp_path: Path, name: str) -> None:
    path = painted_obj(tmp_path) if name == "crate.obj" else arm(tmp_path)
    _, _, result = kept(path, tmp_path / "out.glb", unit="cm", per_node=True)
    read = trimesh.load_scene(tmp_path / "out.glb", process=False)
    own = [node for node in read.graph.nodes_geometry if not node.startswith("UCX_")]
    hulls = [node for node in read.graph.nodes_geometry if node.startswith("UCX_")]
    assert len(hulls) == len(result)
    bounds = np.array([read.geometry[read.graph[n][1]].copy().apply_transform(read.graph[n][0]).bounds for n in own])
    assert np.allclose([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)], result.source.bounds, atol=1e-6)
    for node, hull in zip(sorted(hulls), sorted(result, key=lambda hull: hull.metadata.get("node") or ""), strict=True):
        transform, mesh = read.graph[node]
        placed = read.geometry[mesh].copy().apply_transform(transform)
        assert_convex_hull(placed)
        assert np.allclose(placed.bounds, hull.bounds, atol=1e-6)


def plates(folder: Path) -> Path:
    """Boxes of 3MF: one whose own colour is red, one most of whose triangles are blue, one without a colour."""
    colours = '<basematerials id="1"><base name="a" displaycolor="#FF0000"/></basematerials>'
    colours += '<m:colorgroup xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" id="9">'
    colours += '<m:color color="#00FF00FF"/><m:color color="#0000BC80"/></m:colorgroup>'
    blue = MESH.replace("<triangle ", '<triangle pid="9" p1="1" ').replace(' pid="9" p1="1"', "", 1)
    objects = [("red", 'pid="1" pindex="0"', MESH), ("blue", 'pid="1" pindex="0"', blue), ("plain", "", MESH)]
    items = ""
    for number, (name, own, mesh) in enumerate(objects, start=10):
        colours += f'<object id="{number}" name="{name}" {own}>{mesh}</object>'
        items += f'<item objectid="{number}" transform="1 0 0 0 1 0 0 0 1 {3 * number} 0 0"/>'
    text = model(colours, items)
    (folder / "plates.3mf").write_bytes(threemf(text))
    return folder / "plates.3mf"


def cart(folder: Path) -> Path:
    pytest.importorskip("ufbx", reason="the extra fbx is not installed")
    box = trimesh.creation.box((2, 4, 6))
    shape = (box.vertices, box.faces.tolist())
    models = [Model("case", *shape, RED[:3]), Model("lid", *shape, below=0), Model("UCX_case_00", *shape)]
    (folder / "cart.fbx").write_bytes(fbx(models))
    return folder / "cart.fbx"


def stand(folder: Path) -> Path:
    pytest.importorskip("cascadio", reason="the extra cad is not installed")
    return Path(shutil.copy(Path(__file__).parents[1] / "cases" / "stand.step", folder))


def lamp(folder: Path) -> Path:
    """A foot of brass, a shade whose colour is its own, and a plain one."""
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    from pxr import Sdf, Usd, UsdShade

    from tests.io.test_load_usd import add_box

    stage = Usd.Stage.CreateNew(str(folder / "lamp.usda"))
    foot, shade, _ = (add_box(stage, f"/Lamp/{name}") for name in ("foot", "shade", "plain"))
    shade.CreateDisplayColorAttr([(0.2, 0.4, 0.8)])
    material = UsdShade.Material.Define(stage, "/Lamp/brass")
    shader = UsdShade.Shader.Define(stage, "/Lamp/brass/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    # As exporters do: the colour is an input of the material, to which the shader's is connected.
    tint = material.CreateInput("tint", Sdf.ValueTypeNames.Color3f)
    tint.Set((0.8, 0.6, 0.2))
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(tint)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(1.0)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.25)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(foot.GetPrim()).Bind(material)
    stage.Save()
    return folder / "lamp.usda"


@pytest.mark.parametrize(
    ("write", "looks"),
    [
        (two_painted, {"crate": [WOOD, RED], "lid": [WOOD, RED]}),
        (arm, {"node0": [RED], "node1": [BLUE]}),
        (plates, {"red": [RED], "blue": [[0, 0, 0.5, 0.5]], "plain": [PLAIN]}),  # BC of sRGB is half the light
        (cart, {"case": [RED], "lid": [PLAIN]}),
        (stand, {"plate": [], "pin_left": [RED], "pin_right": [RED]}),
        (lamp, {"foot": [[0.8, 0.6, 0.2, 1]], "shade": [[0.2, 0.4, 0.8, 1]], "plain": [PLAIN]}),
    ],
)
def test_hulls_lie_below_their_nodes_which_keep_their_colours(
    tmp_path: Path, write: Callable[[Path], Path], looks: dict[str, list[Any]]
) -> None:
    header, _, result = kept(write(tmp_path), tmp_path / "out.glb", per_node=True)
    nodes = {node["name"]: node for node in header["nodes"] if "mesh" in node}
    assert sorted(nodes) == sorted([*looks, *(f"UCX_{name}_00" for name in looks)])
    assert {hull.metadata["node"] for hull in result} == set(looks)
    for name, tints in looks.items():
        assert [header["nodes"][child]["name"] for child in nodes[name]["children"]] == [f"UCX_{name}_00"]
        assert colors(header, nodes[name]["mesh"]) == [pytest.approx(tint, abs=0.005) for tint in tints]
    metals = [one["pbrMetallicRoughness"].get("metallicFactor") for one in header["materials"]]
    assert write is stand or metals == [float(write is lamp and number == 0) for number in range(len(metals))]
    assert write is not lamp or header["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 0.25
