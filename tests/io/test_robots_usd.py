"""USD stages: hulls collide where meshes did, in a layer over the original; mass, unit and everything else stay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd.clear import Body, Surface, at_rest, check
from rlacd.cli.main import app
from rlacd.errors import MeshFileError, OptionError
from rlacd.io.robots.read import read_robot
from rlacd.io.robots.viewed import decompose_viewed
from tests.models import TABLE_VOLUME, inside, table
from tests.moving import fork_and_lug

pytest.importorskip("pxr", reason="the extra usd is not installed")
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation, Vt

from tests.io.test_load_usd import add_mesh

SCALE = (100.0, 200.0, 100.0)


def add_table(stage: Any, path: str) -> Any:
    """A table that collides and lacks a triangle, moved and stretched unequally."""
    shape = table()
    mesh = add_mesh(stage, path, shape.vertices, shape.faces[1:])
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array(shape.bounds, dtype=np.float32)))
    mesh.AddTranslateOp().Set((1, 2, 3))
    mesh.AddScaleOp().Set(SCALE)
    UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr("convexDecomposition")
    return mesh


def write_stage(path: Path, body: str = "/robot") -> Path:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    root = UsdGeom.Xform.Define(stage, "/robot")
    Usd.ModelAPI(root).SetKind("component")
    stage.SetDefaultPrim(root.GetPrim())
    add_table(stage, "/robot/table")
    UsdPhysics.RigidBodyAPI.Apply(stage.GetPrimAtPath(body))
    stage.Save()
    return path


def colliders(stage: Any) -> list[Any]:
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    found = [prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI)]
    return [prim for prim in found if UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get() is not False]


def placed(prim: Any) -> trimesh.Trimesh:
    to_world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T
    mesh = UsdGeom.Mesh(prim)
    points = trimesh.transform_points(np.array(mesh.GetPointsAttr().Get(), dtype=float), to_world)
    return trimesh.Trimesh(points, np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), process=False)


@pytest.mark.parametrize("body", ["/robot", "/robot/table"])
@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_hulls_lie_where_the_mesh_lay_and_nothing_else_changes(tmp_path: Path, body: str, ending: str) -> None:
    source = write_stage(tmp_path / "in.usda", body)
    before = source.read_bytes()
    done = rlacd.rewrite_robot(source, tmp_path / f"out.{ending}", threads=1, quality="fast")
    assert done.warnings == []
    assert source.read_bytes() == before
    stage = Usd.Stage.Open(str(done.path))
    assert list(stage.GetRootLayer().subLayerPaths) == ["./in.usda"]
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert body != "/robot" or findings(stage) == []
    hulls = colliders(stage)
    assert len(hulls) == len(done.links[0].files) > 1
    for hull in hulls:
        assert UsdPhysics.MeshCollisionAPI(hull).GetApproximationAttr().Get() == "convexHull"
        assert UsdGeom.Imageable(hull).ComputePurpose() == "guide"
        assert str(hull.GetPath()).startswith(body)
        assert placed(hull).volume == pytest.approx(placed(hull).convex_hull.volume, rel=1e-4)
    mesh = placed(stage.GetPrimAtPath("/robot/table"))
    together = trimesh.util.concatenate([placed(hull) for hull in hulls])
    assert together.bounds == pytest.approx(mesh.bounds, rel=1e-5)
    assert UsdGeom.Imageable(stage.GetPrimAtPath("/robot/table")).ComputePurpose() == "default"
    mass = UsdPhysics.MassAPI(stage.GetPrimAtPath(body)).GetMassAttr().Get()
    assert mass == pytest.approx(TABLE_VOLUME * np.prod(SCALE) * 0.01**3 * 1000, rel=1e-5)


@pytest.mark.parametrize("keep_input", [False, True])
def test_what_names_a_mesh_as_a_collider_names_its_hulls_and_the_rest_gives_a_warning(
    tmp_path: Path, keep_input: bool
) -> None:
    stage = Usd.Stage.Open(str(write_stage(tmp_path / "in.usda")))
    wall = UsdGeom.Cube.Define(stage, "/robot/wall").GetPrim()
    UsdPhysics.CollisionAPI.Apply(wall)
    pairs = UsdPhysics.FilteredPairsAPI.Apply(wall)
    pairs.CreateFilteredPairsRel().AddTarget("/robot/table")
    group = UsdPhysics.CollisionGroup.Define(stage, "/robot/group")
    group.GetCollidersCollectionAPI().IncludePath("/robot/table")
    rubber = UsdShade.Material.Define(stage, "/robot/rubber")
    UsdPhysics.MaterialAPI.Apply(rubber.GetPrim()).CreateDynamicFrictionAttr(0.9)
    table = stage.GetPrimAtPath("/robot/table")
    UsdShade.MaterialBindingAPI.Apply(table).Bind(rubber, UsdShade.Tokens.weakerThanDescendants, "physics")
    wall.CreateRelationship("mjc:target").AddTarget("/robot/table")
    (tmp_path / "grey.png").write_bytes(b"")
    wall.CreateAttribute("picture", Sdf.ValueTypeNames.Asset).Set("./grey.png")
    stage.Save()
    (tmp_path / "new").mkdir()
    done = rlacd.rewrite_robot(
        tmp_path / "in.usda", tmp_path / "new" / "out.usda", threads=1, quality="fast", keep_input=keep_input
    )
    assert len(done.warnings) == 1 + keep_input
    assert "mjc:target" in done.warnings[0]
    assert "grey.png" in done.warnings[-1] or not keep_input
    if keep_input:
        (tmp_path / "in.usda").unlink()
    stage = Usd.Stage.Open(str(done.path))
    hulls = [prim for prim in colliders(stage) if prim.GetName() != "wall"]
    paths = {hull.GetPath() for hull in hulls}
    assert len(paths) == len(done.links[0].files)
    named = UsdPhysics.FilteredPairsAPI(stage.GetPrimAtPath("/robot/wall")).GetFilteredPairsRel().GetTargets()
    assert paths < set(named)
    members = UsdPhysics.CollisionGroup(stage.GetPrimAtPath("/robot/group")).GetCollidersCollectionAPI()
    assert all(members.ComputeMembershipQuery().IsPathIncluded(path) for path in paths)
    for hull in hulls:
        bound, _ = UsdShade.MaterialBindingAPI(hull).ComputeBoundMaterial("physics")
        assert bound.GetPath() == "/robot/rubber"
    picture = stage.GetPrimAtPath("/robot/wall").GetAttribute("picture").Get()
    assert picture.path == "./grey.png"
    assert Path(picture.resolvedPath) == tmp_path / "grey.png" or keep_input
    assert str(tmp_path) not in done.path.read_text()
    assert [said for said in findings(stage) if "grey.png" not in said] == []


def findings(stage: Any) -> list[str]:
    """What all validators of OpenUSD say."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


@pytest.mark.parametrize("per", ["link", "mesh"])
@pytest.mark.promise("robot-hulls", "robot-mass")
def test_meshes_of_a_rigid_body_become_one_solid_where_they_collide_alike(tmp_path: Path, per: Any) -> None:
    stage = Usd.Stage.Open(str(write_stage(tmp_path / "in.usda")))
    turned = add_table(stage, "/robot/turned")
    turned.AddRotateXYZOp().Set((20, 30, 40))
    moved, scaled, rotated = turned.GetOrderedXformOps()
    turned.SetXformOpOrder([moved, rotated, scaled])
    rubber = UsdShade.Material.Define(stage, "/robot/rubber")
    UsdPhysics.MaterialAPI.Apply(rubber.GetPrim()).CreateDynamicFrictionAttr(0.9)
    pad = add_table(stage, "/robot/pad").GetPrim()
    UsdShade.MaterialBindingAPI.Apply(pad).Bind(rubber, UsdShade.Tokens.weakerThanDescendants, "physics")
    add_table(stage, "/fixed")
    add_table(stage, "/walls")
    wall = UsdGeom.Cube.Define(stage, "/robot/wall").GetPrim()
    UsdPhysics.FilteredPairsAPI.Apply(wall).CreateFilteredPairsRel().AddTarget("/robot/pad")
    group = UsdPhysics.CollisionGroup.Define(stage, "/robot/group")
    for path in ("/robot/table", "/robot/turned"):
        group.GetCollidersCollectionAPI().IncludePath(path)
    group.CreateFilteredGroupsRel()
    stage.Save()
    before = [placed(prim) for prim in colliders(stage)]
    done = rlacd.rewrite_robot(tmp_path / "in.usda", tmp_path / "out.usda", threads=1, quality="fast", per=per)
    robot, *others = done.links
    assert (robot.name, [link.name for link in others]) == ("/robot", ["/fixed", "/walls"])
    assert len(robot.results) == (2 if per == "link" else 3), "rubber stays apart"
    assert {str(path) for path in robot.meshes} == {"/robot/table", "/robot/turned", "/robot/pad"}
    stage = Usd.Stage.Open(str(done.path))
    hulls = [placed(prim) for prim in colliders(stage)]
    assert sum(len(link.files) for link in done.links) == len(hulls)
    for mesh in before:
        assert inside([hull.convex_hull for hull in hulls], mesh.vertices, 0.01).all()
    mass = UsdPhysics.MassAPI(stage.GetPrimAtPath("/robot")).GetMassAttr().Get()
    assert mass == pytest.approx(3 * TABLE_VOLUME * np.prod(SCALE) * 0.01**3 * 1000, rel=1e-5)


def test_a_hollow_mesh_keeps_its_mass(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "in.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    outer, inner = (trimesh.creation.box((side,) * 3) for side in (2, 1.9))
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    prim = add_mesh(stage, "/box", hollow.vertices, hollow.faces).GetPrim()
    UsdPhysics.RigidBodyAPI.Apply(prim)
    UsdPhysics.CollisionAPI.Apply(prim)
    stage.Save()
    done = rlacd.rewrite_robot(tmp_path / "in.usda", tmp_path / "out.usda", threads=1)
    after = Usd.Stage.Open(str(done.path))
    mass = UsdPhysics.MassAPI(after.GetPrimAtPath("/box")).GetMassAttr().Get()
    assert mass == pytest.approx(1000 * hollow.volume, rel=1e-5)
    assert any("1 closed cavity" in warning for warning in done.warnings)


def test_instances_that_collide_are_opened_and_each_gets_the_hulls(tmp_path: Path) -> None:
    write_stage(tmp_path / "part.usda")
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    for x in range(2):
        prim = UsdGeom.Xform.Define(stage, f"/part{x}").GetPrim()
        prim.GetReferences().AddReference("./part.usda")
        prim.SetInstanceable(True)
    stage.Save()
    done = rlacd.rewrite_robot(tmp_path / "scene.usda", tmp_path / "out.usda", threads=1, quality="fast")
    assert any("2 instances" in warning for warning in done.warnings)
    one, other = done.links
    assert one.results == other.results
    assert len(colliders(Usd.Stage.Open(str(done.path)))) == 2 * len(one.files)


def test_the_command_rewrites_a_stage_whose_meshes_collide(tmp_path: Path) -> None:
    source = write_stage(tmp_path / "in.usda")
    for flag in ([], ["--keep-input"]):
        given = ["decompose", str(source), "-o", str(tmp_path / "out.usda"), "--quality", "fast", "--threads", "1"]
        done = CliRunner().invoke(app, given + flag)
        assert done.exit_code == 0, done.output
        assert ("@./in.usda@" in (tmp_path / "out.usda").read_text()) == (not flag)


def test_what_cannot_be_rewritten_is_refused(tmp_path: Path) -> None:
    source = write_stage(tmp_path / "in.usda")
    for place in (source, tmp_path / "out.urdf"):
        with pytest.raises(OptionError):
            rlacd.rewrite_robot(source, place)
    damaged = tmp_path / "damaged.usda"
    damaged.write_text("#usda 1.0\ndef Xform {")
    with pytest.raises(MeshFileError, match="damaged"):
        rlacd.rewrite_robot(damaged, tmp_path / "out.usda")


@pytest.mark.promise("links-clear")
def test_bodies_that_do_not_touch_do_not_as_hulls_and_fixed_meshes_may(tmp_path: Path) -> None:
    """A lug that turns in a fork, which is no rigid body; both are turned, scaled and mirrored."""
    pytest.importorskip("coal", reason="extra clear")
    stage = Usd.Stage.CreateNew(str(tmp_path / "in.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/scene")
    root.AddRotateXYZOp().Set((20, 30, 40))
    root.AddScaleOp().Set((-2, 2, 2))
    for name, shape in fork_and_lug().links.items():
        mesh = add_mesh(stage, f"/scene/{name}", shape.vertices, shape.faces)
        UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    UsdPhysics.RigidBodyAPI.Apply(stage.GetPrimAtPath("/scene/lug"))
    stage.Save()
    done = rlacd.rewrite_robot(tmp_path / "in.usda", tmp_path / "out.usda", threshold=0.06, quality="fast", threads=1)
    (pair,) = done.pairs
    assert (pair.kept_clear, pair.share, pair.loose) == (True, 0, True)
    after = Usd.Stage.Open(str(done.path))
    hulls = [(placed(prim), str(prim.GetPath())) for prim in colliders(after)]
    groups = [[hull.convex_hull for hull, path in hulls if f"/{name}" in path] for name in ("fork", "lug")]
    assert all(groups)
    bodies = [
        Body(name, Surface(own[0].vertices, own[0].faces), [Surface(h.vertices, h.faces) for h in own])
        for name, own in zip("ab", groups, strict=True)
    ]
    assert check(bodies, at_rest("ab")) == {}


@pytest.mark.parametrize("how", ["adjacent", "always,never"])
def test_pairs_of_bodies_that_a_joint_connects_are_filtered_where_asked(tmp_path: Path, how: str) -> None:
    """Of pairs that are looked at only at rest, adjacent ones are known."""
    pytest.importorskip("coal", reason="extra clear")
    source = write_stage(tmp_path / "in.usda")
    stage = Usd.Stage.Open(str(source))
    UsdGeom.Xform.Define(stage, "/arm")
    add_table(stage, "/arm/table")
    add_table(stage, "/floor")
    UsdPhysics.RigidBodyAPI.Apply(stage.GetPrimAtPath("/arm"))
    joint = UsdPhysics.RevoluteJoint.Define(stage, "/hinge")
    joint.CreateBody0Rel().AddTarget("/robot/table")
    joint.CreateBody1Rel().AddTarget("/arm")
    stage.Save()
    done = rlacd.rewrite_robot(source, tmp_path / "out.usda", threads=1, quality="fast", exclude=how)
    shown = decompose_viewed(source, quality="fast", threads=1)
    assert (shown.links, shown.joints) == (["/robot", "/arm", "/floor"], ()), "the page shows a stage as it stands"
    assert [contact[:2] for contact in shown.touching([])] == [(0, 2), (1, 2)], "but for what a joint connects"
    kinds = {(pair.first, pair.second): pair.kind for pair in done.pairs}
    assert kinds[("/robot", "/arm")] == "adjacent"
    assert kinds[("/robot", "/floor")] == kinds[("/arm", "/floor")] == "sometimes"
    after = Usd.Stage.Open(str(done.path))
    filtered = {
        str(prim.GetPath()): [*map(str, UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets())]
        for prim in after.Traverse()
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI)
    }
    assert filtered == ({"/robot": ["/arm"]} if how == "adjacent" else {})
    assert findings(after) == []


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize(
    ("kind", "scale", "is_compared"),
    [
        (UsdGeom.Cube, (2.0, 3.0, 4.0), True),
        (UsdGeom.Sphere, (3.0, 3.0, 3.0), True),
        (UsdGeom.Sphere, (2.0, 3.0, 4.0), True),
        (UsdGeom.Capsule, (3.0, 3.0, 3.0), True),
        (UsdGeom.Capsule, (2.0, 3.0, 4.0), False),
        (UsdGeom.Cylinder, (2.0, 3.0, 4.0), False),
        (UsdGeom.Cylinder, None, True),
        (UsdGeom.Cone, (2.0, 3.0, 4.0), False),
        (UsdGeom.Cone, None, True),
        (UsdGeom.Plane, (1.0, 1.0, 1.0), False),
    ],
)
def test_primitives_of_a_stage_are_where_it_shows_them(
    tmp_path: Path, kind: Any, scale: tuple[float, ...] | None, axis: str, is_compared: bool
) -> None:
    """As OpenUSD's own extents say, turned and scaled, below a body that is turned and scaled too."""
    if kind in (UsdGeom.Cube, UsdGeom.Sphere) and axis != "Z":
        return
    stage = Usd.Stage.Open(str(write_stage(tmp_path / "in.usda")))
    body = UsdGeom.Xform.Define(stage, "/finger")
    body.AddTranslateOp().Set((300.0, -20.0, 10.0))
    body.AddRotateXYZOp().Set((30.0, 40.0, 50.0))
    body.AddScaleOp().Set((5.0, 5.0, 5.0))
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    shape = kind.Define(stage, "/finger/tip")
    if kind not in (UsdGeom.Cube, UsdGeom.Sphere):
        shape.CreateAxisAttr(axis)
    shape.AddTranslateOp().Set((1.0, 2.0, 3.0))
    shape.AddScaleOp().Set(scale or tuple(6.0 if each == axis else 4.0 for each in "XYZ"))
    UsdPhysics.CollisionAPI.Apply(shape.GetPrim())
    stage.Save()
    (finger,) = [each for each in read_robot(tmp_path / "in.usda").bodies if each.name == "/finger"] or [None]
    assert (finger is not None) == is_compared
    if finger is None:
        return
    assert finger.colliders == []
    (tip,) = finger.primitives
    extent = np.array(kind.ComputeExtentFromPlugins(UsdGeom.Boundable(shape), 0), dtype=float)
    to_body = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(shape.GetPrim())).T
    to_body = np.linalg.inv(finger.pose) @ to_body
    corners = trimesh.transform_points(trimesh.bounds.corners(extent), to_body)
    middle = to_body[:3, 3]
    if kind is UsdGeom.Cone:  # which leads from the middle of the box to that of one side, not to its corners
        top = trimesh.transform_points([extent[1] * (np.array([*"XYZ"]) == axis)], to_body)
        assert np.linalg.norm(tip.vertices - top, axis=1).min() == pytest.approx(0, abs=1e-3)
        corners = tip.vertices[(tip.vertices - middle) @ (top[0] - middle) < 0]
        assert np.linalg.norm(corners - (2 * middle - top[0]), axis=1) == pytest.approx(20, abs=0.1)
        return
    assert tip.box == pytest.approx(np.stack([corners.min(axis=0), corners.max(axis=0)]), abs=0.2)


def test_a_primitive_of_a_stage_counts_for_its_size_and_is_checked(tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(write_stage(tmp_path / "in.usda")))
    table = placed(colliders(stage)[0])
    ball = UsdGeom.Sphere.Define(stage, "/ball")
    ball.CreateRadiusAttr(5.0)
    ball.AddTranslateOp().Set(tuple(table.vertices[0].tolist()))
    far = UsdGeom.Cube.Define(stage, "/far")
    far.AddTranslateOp().Set((2000.0, 0.0, 0.0))
    for prim in (ball.GetPrim(), far.GetPrim()):
        UsdPhysics.RigidBodyAPI.Apply(prim)
        UsdPhysics.CollisionAPI.Apply(prim)
    stage.Save()
    done = rlacd.rewrite_robot(tmp_path / "in.usda", tmp_path / "out.usda", threads=1, quality="fast")
    assert done.size == pytest.approx(2001 - table.bounds[0, 0], abs=6)
    assert [link.name for link in done.links] == ["/robot", "/ball", "/far"]
    touching = {(pair.first, pair.second): (pair.contact, pair.meshes) for pair in done.pairs}
    assert touching == {
        ("/robot", "/ball"): ("always", 1.0),
        ("/robot", "/far"): ("never", 0.0),
        ("/ball", "/far"): ("never", 0.0),
    }
