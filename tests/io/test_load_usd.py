"""USD files as input, against what OpenUSD itself says of them."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from rlacd.errors import MeshFileError
from rlacd.fit import Unit
from rlacd.io.read.load import load_mesh
from rlacd.io.robots.usd import read_stage

Usd = pytest.importorskip("pxr.Usd", reason="the extra usd is not installed")
from pxr import Gf, Sdf, UsdGeom, UsdPhysics, UsdUtils, Vt  # noqa: E402

from rlacd.io.read.usd_stage import check_files  # noqa: E402

BOX = trimesh.creation.box()


def add_mesh(stage: Any, path: str, points: Any, polygons: Any) -> Any:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr([len(polygon) for polygon in polygons])
    mesh.CreateFaceVertexIndicesAttr([int(corner) for polygon in polygons for corner in polygon])
    return mesh


def add_box(stage: Any, path: str, size: tuple[float, float, float] = (1, 1, 1)) -> Any:
    box = trimesh.creation.box(size)
    return add_mesh(stage, path, box.vertices, box.faces)


def cupboard(path: Path) -> Path:
    """A box, turned and moved below its parent, with a quad on it, and things that are not rendered."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    top = UsdGeom.Xform.Define(stage, "/Cupboard")
    top.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    top.AddRotateZOp().Set(90.0)
    add_box(stage, "/Cupboard/box", (2, 4, 6)).AddTranslateOp().Set(Gf.Vec3d(10, 0, 0))
    quad = add_mesh(stage, "/Cupboard/door", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [range(4)])
    quad.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    UsdGeom.Xform.Define(stage, "/Cupboard/hidden").CreateVisibilityAttr(UsdGeom.Tokens.invisible)
    add_box(stage, "/Cupboard/hidden/box")
    for purpose in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy):
        add_box(stage, f"/Cupboard/{purpose}").CreatePurposeAttr(purpose)
    add_box(stage, "/Cupboard/later").CreateVisibilityAttr().Set(UsdGeom.Tokens.invisible, 1.0)
    UsdGeom.Plane.Define(stage, "/Cupboard/floor")
    stage.Save()
    return path


@pytest.mark.parametrize("ending", ["usd", "usda", "usdc", "usdz"])
def test_what_is_rendered_is_read_where_it_stands(tmp_path: Path, ending: str) -> None:
    path = cupboard(tmp_path / f"cupboard.{ending if ending != 'usdz' else 'usdc'}")
    if ending == "usdz":
        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(path)), str(tmp_path / "cupboard.usdz"))
        path = tmp_path / "cupboard.usdz"
    mesh = load_mesh(path)
    assert [node.name for node in mesh.nodes] == ["box", "door"]
    assert set(mesh.warnings) == {
        "hidden nodes were left out, with those below them: 2",
        "guides and proxies were left out: 2",
        "shapes other than meshes and plain primitives were left out: 1",
    }
    assert (mesh.up, mesh.metres, mesh.unit) == ("y", 0.01, Unit("cm", 1.0))
    assert len(mesh.faces) == 12 + 2
    box = mesh.of_node(0).vertices
    assert np.allclose([box.min(axis=0), box.max(axis=0)], [[1 - 2, 2 + 9, 0], [1 + 2, 2 + 11, 6]], atol=1e-6)
    solid = trimesh.Trimesh(box, mesh.of_node(0).faces)
    assert solid.volume == pytest.approx(48)
    door = trimesh.Trimesh(mesh.of_node(1).vertices, mesh.of_node(1).faces, process=False)
    assert np.allclose(door.face_normals, (0, 0, -1))


@pytest.mark.parametrize("axis", "XYZ")
def test_primitives_are_read_as_meshes(tmp_path: Path, axis: str) -> None:
    path = tmp_path / "shapes.usda"
    stage = Usd.Stage.CreateNew(str(path))
    for index, kind in enumerate(("Cube", "Sphere", "Cylinder", "Capsule", "Cone")):
        shape = getattr(UsdGeom, kind).Define(stage, f"/{kind}")
        if kind in ("Cylinder", "Capsule", "Cone"):
            shape.CreateAxisAttr(axis)
            shape.CreateHeightAttr(3.0)
            shape.CreateRadiusAttr(0.5)
        shape.AddTranslateOp().Set(Gf.Vec3d(10.0 * index, 0, 0))
    stage.Save()
    mesh = load_mesh(path)
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    for index, node in enumerate(mesh.nodes):
        bounds = cache.ComputeWorldBound(stage.GetPrimAtPath(f"/{node.name}")).ComputeAlignedRange()
        points = mesh.of_node(index).vertices
        assert np.allclose([points.min(axis=0), points.max(axis=0)], [bounds.GetMin(), bounds.GetMax()], atol=0.01)
        assert trimesh.Trimesh(points, mesh.of_node(index).faces).is_volume


def test_instances_are_read_each_where_it_stands(tmp_path: Path) -> None:
    add = Usd.Stage.CreateNew(str(tmp_path / "wheel.usda"))
    add_box(add, "/Wheel/tyre")
    add.SetDefaultPrim(add.GetPrimAtPath("/Wheel"))
    add.Save()
    stage = Usd.Stage.CreateNew(str(tmp_path / "cart.usda"))
    for index in range(3):
        place = UsdGeom.Xform.Define(stage, f"/wheel_{index}")
        place.GetPrim().GetReferences().AddReference("./wheel.usda")
        place.GetPrim().SetInstanceable(True)
        place.AddTranslateOp().Set(Gf.Vec3d(5.0 * index, 0, 0))
    stage.Save()
    mesh = load_mesh(tmp_path / "cart.usda")
    assert len(mesh.nodes) == 3
    assert np.allclose(np.ptp(mesh.vertices, axis=0), (11, 1, 1))


CLIPS = '(clips = {{ dictionary default = {{ {} string primPath = "/Cupboard/box" }} }})'
"""Of values that change, which OpenUSD reads from other files."""


@pytest.mark.parametrize(
    "naming",
    [
        *("(prepend references = @../secret.usda@)", "(prepend references = @{folder}/secret.usda@)"),
        "(prepend payload = @./nowhere.usda@)",
        *(CLIPS.format(f"asset[] assetPaths = [@{name}@]\n") for name in ("../secret.usda", "nowhere.usda")),
        CLIPS.format('string templateAssetPath = "../secret.#.usda"\n'),
    ],
)
def test_files_outside_the_folder_or_missing_are_named_and_never_opened(tmp_path: Path, naming: str) -> None:
    for name in ("secret.usda", "secret.1.usda"):
        cupboard(tmp_path / "cupboard.usda").rename(tmp_path / name)
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "cart.usda"
    path.write_text(f'#usda 1.0\ndef Mesh "A" {naming.replace("{folder}", str(tmp_path))} {{ }}\n')
    for read in (load_mesh, read_stage, check_files):
        with pytest.raises(MeshFileError, match=r"outside its folder|cannot be opened|by a template"):
            read(path)
    assert not [layer for layer in Sdf.Layer.GetLoadedLayers() if "secret" in layer.identifier]


@pytest.mark.parametrize("changes", [{1604: 137, 1628: 56}, {107: 90, 241: 56, 431: 188}])
def test_a_file_that_crashes_openusd_is_refused_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[int, int]
) -> None:
    """OpenUSD writes a report of its crash into TMPDIR as it is when it is loaded."""
    path = cupboard(tmp_path / "cupboard.usdc")
    content = bytearray(path.read_bytes())
    for at, byte in changes.items():
        content[at] = byte  # usd-core 26.11 ends the process
    path.write_bytes(bytes(content))
    left = tmp_path / "left"
    left.mkdir()
    monkeypatch.setenv("TMPDIR", str(left))
    monkeypatch.setattr(tempfile, "tempdir", None)
    for read in (load_mesh, read_stage):
        with pytest.raises(MeshFileError, match=r"cupboard\.usdc.*export it again"):
            read(path)
    assert list(left.iterdir()) == []


def test_faces_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for number, (counts, corners) in enumerate([([3], [0, 1]), ([-3, 6], [0, 1, 2]), ([3], [0, 1, 9])]):
        stage = Usd.Stage.CreateNew(str(tmp_path / f"{number}.usda"))
        mesh = add_mesh(stage, "/m", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [corners])
        mesh.GetFaceVertexCountsAttr().Set(counts)
        stage.Save()
        with pytest.raises(MeshFileError, match="export it again"):
            load_mesh(tmp_path / f"{number}.usda")


def test_faces_that_are_holes_are_left_out(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "box.usda"))
    mesh = add_mesh(stage, "/box", BOX.vertices, [*BOX.faces, range(3)])
    mesh.CreateHoleIndicesAttr([12, 0])
    UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    stage.Save()
    (body,) = read_stage(tmp_path / "box.usda").bodies
    for faces in (load_mesh(tmp_path / "box.usda").faces, body.mesh().faces):
        assert np.array_equal(faces, BOX.faces[1:])
    mesh.GetHoleIndicesAttr().Set([13])
    stage.Save()
    with pytest.raises(MeshFileError, match="holes at /box"):
        load_mesh(tmp_path / "box.usda")
