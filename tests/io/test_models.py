"""Models: each is read, and where it is a simulator's own, simulated, by the program it is made for."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from lxml import etree

import rlacd
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError, OutputError
from rlacd.io.write import FORMATS, MODELS, save
from tests.assets import read_glb
from tests.hulls import assert_convex_hull, hull_of, random_hull
from tests.models import (
    FALLS,
    TABLE_VOLUME,
    assert_stands,
    decomposed_table,
    fall_in_bullet,
    fall_in_drake,
    fall_in_mujoco,
    mujoco_model,
    points_of_geom,
)

AWKWARD = 'ein Tisch – 机 & "co" <1>'
"""Blanks, quotes, XML's own marks, and letters of other scripts."""


@pytest.fixture(scope="module")
def wooden() -> Decomposition:
    return decomposed_table()


def renamed(result: Decomposition, name: str, **changes: Any) -> Decomposition:
    parts = {"hulls": result.hulls, "source": result.source, **changes}
    return Decomposition(parts["hulls"], dataclasses.replace(result.report, name=name), parts["source"])


# --- simulators -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fall", "ending"), FALLS)
@pytest.mark.promise("simulators")
def test_a_table_stands_in_every_simulator_whatever_its_name(
    tmp_path: Path, wooden: Decomposition, fall: Any, ending: str
) -> None:
    folder = tmp_path / "ein Ordner – 机"
    folder.mkdir()
    assert_stands(fall(renamed(wooden, AWKWARD).save(folder / f"Tisch 机 50%&#1.{ending}")), wooden)


def test_bullet_reads_the_objects_of_one_mesh_as_hulls(tmp_path: Path, wooden: Decomposition) -> None:
    """Under the table there is room for a ball, which there is not in its one convex hull."""
    bullet = pytest.importorskip("pybullet", reason="the extra sim is not installed")
    path = wooden.save(tmp_path / "table.urdf", one_mesh=True)
    assert path.read_text().count("<collision") == 1
    assert fall_in_bullet(path).speed < 1e-2
    one = renamed(wooden, "one", hulls=[hull_of(wooden.source.vertices)])
    client = bullet.connect(bullet.DIRECT)
    try:
        shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.03, physicsClientId=client)
        ball = bullet.createMultiBody(1, shape, basePosition=[0.2, 0.15, 0.09], physicsClientId=client)
        gaps = []
        for file in (path, one.save(tmp_path / "one.urdf", one_mesh=True)):
            body = bullet.loadURDF(str(file), physicsClientId=client)
            near = bullet.getClosestPoints(body, ball, distance=1.0, physicsClientId=client)
            gaps.append(min(point[8] for point in near))
            bullet.removeBody(body, physicsClientId=client)
        assert gaps[0] > 0.03
        assert gaps[1] < 0
    finally:
        bullet.disconnect(client)


@pytest.mark.parametrize("density", [8.0, 7850.0])
@pytest.mark.promise("mass")
def test_mass_and_inertia_are_those_of_the_solid(tmp_path: Path, wooden: Decomposition, density: float) -> None:
    """Compared with trimesh's integrals over the closed input, which knows nothing of hulls."""
    model = mujoco_model(wooden.save(tmp_path / "table.xml", density=density))
    table = wooden.source.copy()
    table.density = density
    assert model.body_mass[1] == pytest.approx(table.mass, rel=1e-6)
    assert model.body_ipos[1] == pytest.approx(table.center_mass, abs=1e-6)
    assert np.sort(model.body_inertia[1]) == pytest.approx(np.sort(table.principal_inertia_components), rel=1e-5)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_bodies_stand_up_whatever_axis_points_up(tmp_path: Path, wooden: Decomposition, up: str) -> None:
    order = {"x": [2, 0, 1], "y": [1, 2, 0], "z": [0, 1, 2]}[up]  # rows: which of the table's axes becomes x, y, z
    lying = rlacd.decompose((wooden.source.vertices[:, order], wooden.source.faces), threads=1)
    assert_stands(fall_in_mujoco(lying.save(tmp_path / "table.xml", up=up)), lying)
    assert_stands(fall_in_drake(lying.save(tmp_path / "table.sdf", up=up)), lying)


# --- USD and engines --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", MODELS["usd"].endings)
def test_usd_opens_and_its_validators_find_nothing(tmp_path: Path, wooden: Decomposition, ending: str) -> None:
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

    path = renamed(wooden, AWKWARD).save(tmp_path / f"table.{ending}", up="y")
    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    names = {validator.GetMetadata().name for validator in validators}
    assert {"usdPhysicsValidators:ColliderChecker", "usdPhysicsValidators:RigidBodyChecker"} <= names
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []

    body = stage.GetDefaultPrim()
    assert body.HasAPI(UsdPhysics.RigidBodyAPI)
    assert UsdPhysics.MassAPI(body).GetMassAttr().Get() == pytest.approx(TABLE_VOLUME * 1000, rel=1e-6)
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    hulls = [mesh for mesh in meshes if mesh.GetPrim().HasAPI(UsdPhysics.CollisionAPI)]
    assert len(hulls) == len(wooden)
    assert len(meshes) == len(hulls) + 1
    for mesh, hull in zip(hulls, wooden, strict=True):
        assert UsdPhysics.MeshCollisionAPI(mesh).GetApproximationAttr().Get() == "convexHull"
        assert UsdGeom.Imageable(mesh).ComputePurpose() == "guide"
        read = trimesh.Trimesh(
            np.array(mesh.GetPointsAttr().Get(), dtype=np.float64),
            np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3),
            process=False,
        )
        assert_convex_hull(read)
        assert read.volume == pytest.approx(hull.volume, rel=1e-5)


def test_usd_turns_the_inertia_the_right_way(tmp_path: Path) -> None:
    """A lopsided body: rebuilding the tensor from principal axes and moments gives the solid's own."""
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    from pxr import Usd, UsdPhysics

    hull = hull_of(random_hull(5).vertices * [1.0, 2.0, 3.0] + [0.3, 0.2, 0.1])
    path = rlacd.decompose(hull, threads=1).save(tmp_path / "rock.usda", density=1.0)
    stage = Usd.Stage.Open(str(path))
    api = UsdPhysics.MassAPI(stage.GetDefaultPrim())
    turn = api.GetPrincipalAxesAttr().Get()
    quaternion = [turn.GetReal(), *turn.GetImaginary()]
    axes = trimesh.transformations.quaternion_matrix(quaternion)[:3, :3]
    tensor = axes @ np.diag(np.array(api.GetDiagonalInertiaAttr().Get())) @ axes.T
    assert tensor == pytest.approx(np.asarray(hull.moment_inertia), rel=1e-4, abs=1e-4 * hull.moment_inertia.max())
    assert np.array(api.GetCenterOfMassAttr().Get()) == pytest.approx(hull.center_mass, abs=1e-5)


@pytest.mark.parametrize("ending", MODELS["unreal"].endings)
def test_unreal_finds_the_hulls_of_the_mesh_by_name(tmp_path: Path, wooden: Decomposition, ending: str) -> None:
    path = renamed(wooden, "my table").save(tmp_path / f"table.{ending}", file_type="unreal")
    read = trimesh.load_scene(path, process=False, **({"split_objects": True} if ending == "obj" else {}))
    assert sorted(read.geometry) == sorted(["my_table", *(f"UCX_my_table_{i:02d}" for i in range(len(wooden)))])
    assert read.geometry["my_table"].volume == pytest.approx(TABLE_VOLUME, rel=1e-5)
    # An engine would make an asset of the material of every hull.
    if ending == "glb":
        assert [material["name"] for material in read_glb(path)[0]["materials"]] == ["my_table"]
    else:
        assert all(len(line.split()) == 4 for line in path.read_text().splitlines() if line.startswith("v "))
    for index, hull in enumerate(wooden):
        assert_convex_hull(read.geometry[f"UCX_my_table_{index:02d}"])
        assert read.geometry[f"UCX_my_table_{index:02d}"].volume == pytest.approx(hull.volume, rel=1e-5)


# --- what is awkward --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["world", "main", "visual", "collision", "a::b", "__model__", "0", "ground"])
def test_names_that_mean_something_to_simulators_are_no_trap(tmp_path: Path, wooden: Decomposition, name: str) -> None:
    odd = renamed(wooden, name)
    mujoco = fall_in_mujoco(odd.save(tmp_path / "a.xml"), 0.1) if name != "ground" else None
    assert mujoco is None or mujoco.hulls == len(wooden)
    assert fall_in_bullet(odd.save(tmp_path / "a.urdf"), 0.2).hulls == len(wooden)
    for path in (odd.save(tmp_path / "b.sdf"), tmp_path / "a.urdf"):
        rest = fall_in_drake(path, 0.1)
        assert rest.hulls == len(wooden)
        assert rest.mass == pytest.approx(TABLE_VOLUME * 1000, rel=1e-6)


@pytest.mark.parametrize("name", ["\x07bell\nline", "\ud800", "￿", " ", "../../up", "x" * 400])
def test_names_that_xml_or_disks_cannot_hold_are_made_plain(tmp_path: Path, wooden: Decomposition, name: str) -> None:
    for ending in ("xml", "urdf", "sdf"):
        path = renamed(wooden, name).save(tmp_path / f"out.{ending}")
        etree.parse(str(path))
    assert {path.name for path in tmp_path.iterdir()} == {
        f"out{end}" for end in (".xml", ".urdf", ".sdf", "_mjcf", "_urdf", "_sdf")
    }


@pytest.mark.parametrize(("fall", "ending"), FALLS[:2])
def test_thin_tiny_and_far_bodies_load(tmp_path: Path, fall: Any, ending: str) -> None:
    shapes = {
        "flat": trimesh.creation.box((1.0, 1.0, 0.0)),
        "thin": trimesh.creation.box((1.0, 1.0, 1e-4)),
        "tiny": trimesh.creation.box((1e-4, 2e-4, 1e-4)),
        "far": trimesh.creation.box((0.1, 0.1, 0.1), transform=trimesh.transformations.translation_matrix([5e5, 0, 9])),
    }
    for name, shape in shapes.items():
        assert fall(rlacd.decompose(shape, threads=1).save(tmp_path / f"{name}.{ending}"), 0.0).hulls == 1


def test_the_input_is_seen_and_hulls_collide(tmp_path: Path, wooden: Decomposition) -> None:
    """In MuJoCo by groups, which its viewer switches; in URDF, which MuJoCo reads too, and SDF by elements."""
    model = mujoco_model(wooden.save(tmp_path / "table.xml"))
    for group, count, collides in ((2, 1, False), (3, len(wooden), True)):
        members = np.flatnonzero(model.geom_group == group)
        assert len(members) == count
        assert (model.geom_contype[members].astype(bool) == collides).all()
        assert (model.geom_conaffinity[members].astype(bool) == collides).all()
    model = mujoco_model(wooden.save(tmp_path / "table.urdf"))
    assert (model.ngeom, np.count_nonzero(model.geom_contype)) == (len(wooden) + 1, len(wooden))
    root = etree.parse(str(wooden.save(tmp_path / "table.sdf"))).getroot()
    assert len(root.findall(".//visual")) == 1
    assert len(root.findall(".//collision//{http://drake.mit.edu}declare_convex")) == len(wooden)
    assert len(root.findall(".//collision//mesh[@optimization='convex_hull']")) == len(wooden)


def test_far_from_the_origin_a_model_keeps_the_shape_and_the_place(tmp_path: Path) -> None:
    """At 500 km single precision resolves 3 cm; the box is 10 cm wide."""
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    far = trimesh.creation.box((0.1, 0.1, 0.1), transform=trimesh.transformations.translation_matrix([5e5, 0.03, 9]))
    result = rlacd.decompose(far, threads=1)
    model = mujoco_model(result.save(tmp_path / "far.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for geom in range(model.ngeom):
        points = points_of_geom(model, data, geom)
        assert np.ptp(points, axis=0) == pytest.approx([0.1, 0.1, 0.1], abs=1e-6)
        assert points.mean(axis=0) == pytest.approx([5e5, 0.03, 9], abs=1e-6)
    for ending in ("urdf", "sdf"):
        path = result.save(tmp_path / f"far.{ending}")
        for file in (tmp_path / f"far_{ending}").glob("*.obj"):
            read = trimesh.load_mesh(file, process=False)
            assert np.abs(read.vertices).max() < 0.06, "relative to its centre"
        assert "500000" in path.read_text().replace(",", "")


@pytest.mark.parametrize("ending", [*FORMATS, "xml", "urdf", "sdf", "usda"])
def test_same_decomposition_same_bytes(tmp_path: Path, wooden: Decomposition, ending: str) -> None:
    if ending == "usda":
        pytest.importorskip("pxr", reason="the extra usd is not installed")
    folders = []
    for name in "ab":
        (tmp_path / name).mkdir()
        wooden.save(tmp_path / name / f"table.{ending}")
        folders.append({p.relative_to(tmp_path / name): p.read_bytes() for p in (tmp_path / name).rglob("*.*")})
    assert folders[0] == folders[1]


# --- mistakes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "options", "error", "says"),
    [
        ("table.glb", {"file_type": "mjcf"}, OptionError, r"mjcf needs a file whose name ends in \.xml"),
        ("table.stl", {"file_type": "unreal"}, OptionError, r"\.glb or \.obj"),
        ("table/", {"file_type": "godot"}, OptionError, r"\.glb"),
        ("table.xml", {"density": 0.0}, OptionError, "density is 0.0"),
        ("table.xml", {"density": float("nan")}, OptionError, "density"),
        ("table.xml", {"up": "w"}, OptionError, "x, y or z"),
        ("table.xml", {"one_mesh": True}, OptionError, r"one_mesh .* works for \.urdf files only"),
        ("table.blend", {}, OptionError, r"\.xml, \.urdf, \.sdf, \.usd"),
        ("table.mjcf", {}, OptionError, r"for MuJoCo end in \.xml"),
        *((name, {}, OptionError, r"\.glb, \.obj, \.ply, \.stl") for name in ("hulls", "hulls.glb.zip", ".glb")),
        ("nul\0.glb", {}, OutputError, ""),
        ("table/", {"file_type": "fbx"}, OptionError, "unknown format"),
    ],
)
def test_mistakes_are_one_sentence(
    tmp_path: Path, wooden: Decomposition, path: str, options: dict[str, Any], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        save(wooden, f"{tmp_path}/{path}", **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["tab\tle", "ta\x01ble", "ta\udc80ble"])
def test_names_of_files_that_xml_cannot_hold_are_refused(tmp_path: Path, wooden: Decomposition, name: str) -> None:
    for ending in ("xml", "urdf", "sdf"):
        with pytest.raises(OptionError, match="XML cannot hold"):
            wooden.save(tmp_path / f"{name}.{ending}")
    assert list(tmp_path.iterdir()) == []


def test_folders_that_may_not_be_written_to_are_reported_before_any_work(
    tmp_path: Path, wooden: Decomposition, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Told by the operating system's own answer, since tests may run as root, who may write everywhere."""
    (tmp_path / "table_urdf").mkdir()
    access = os.access
    closed = {tmp_path / "table_urdf"}
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) not in closed and access(path, mode))
    with pytest.raises(OutputError, match=r"cannot write into .*table_urdf: you may not"):
        wooden.save(tmp_path / "table.urdf")
    closed.add(tmp_path)
    for ending in ("urdf", "usda", "glb"):
        with pytest.raises(OutputError, match="you may not write to"):
            wooden.save(tmp_path / f"table.{ending}")
    assert [path.name for path in tmp_path.iterdir()] == ["table_urdf"]


@pytest.mark.promise("own-files")
def test_what_others_put_where_the_meshes_go_is_not_replaced(tmp_path: Path, wooden: Decomposition) -> None:
    (tmp_path / "table_mjcf").write_text("mine")
    with pytest.raises(OutputError, match="it is a file, not a folder"):
        wooden.save(tmp_path / "table.xml")
    assert (tmp_path / "table_mjcf").read_text() == "mine"
    (tmp_path / "table_urdf").mkdir()
    theirs = tmp_path / "table_urdf" / "mesh_000.obj"
    theirs.write_text("mine")
    with pytest.raises(OutputError, match=r"mesh_000\.obj: a file of that name is there that rlacd did not write"):
        wooden.save(tmp_path / "table.urdf")
    assert theirs.read_text() == "mine"
    assert not (tmp_path / "table.urdf").exists()


def test_saving_again_replaces_model_and_meshes_and_nothing_else(tmp_path: Path, wooden: Decomposition) -> None:
    wooden.save(tmp_path / "table.urdf")
    (tmp_path / "table_urdf" / "notes.txt").write_text("mine")
    renamed(wooden, "mesh", hulls=wooden.hulls[:1]).save(tmp_path / "table.urdf")
    names = {path.name for path in (tmp_path / "table_urdf").iterdir()}
    assert names == {"mesh_000.obj", "mesh_visual.obj", "mesh_hulls.json", "notes.txt"}
    assert json.loads((tmp_path / "table_urdf" / "mesh_hulls.json").read_text())["files"] == [
        "mesh_visual.obj",
        "mesh_000.obj",
    ]
    assert (tmp_path / "table.urdf").read_text().count("<collision") == 1


def test_a_failing_disk_leaves_the_older_model_with_its_meshes(
    tmp_path: Path, wooden: Decomposition, monkeypatch: pytest.MonkeyPatch
) -> None:
    import rlacd.io.write as formats

    wooden.save(tmp_path / "table.xml")
    before = (tmp_path / "table.xml").read_bytes()

    def full(path: Path, data: bytes) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(formats, "write_file", full)
    with pytest.raises(OutputError, match="full"):
        renamed(wooden, "mesh", hulls=wooden.hulls[:1]).save(tmp_path / "table.xml")
    assert (tmp_path / "table.xml").read_bytes() == before
    assert fall_in_mujoco(tmp_path / "table.xml", 0.0).hulls == len(wooden), "every mesh it names is still there"
