"""Primitives: fitted around parts, tested as strictly as hulls, and read as primitives by the programs they are for."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

import rlacd
from rlacd.errors import OptionError
from rlacd.extras.finish.primitives import fit_primitives, smallest_ball
from rlacd.options.names import PRIMITIVE_KINDS, PrimitiveKind
from rlacd.solid.hull import Hull
from tests.hulls import assert_convex_hull
from tests.models import TABLE_VOLUME, mujoco_model, table
from tests.shapes import point_to_triangles

Array = npt.NDArray[np.float64]

DIRECTIONS: Array = trimesh.creation.icosphere(subdivisions=2).vertices

SIZES: dict[PrimitiveKind, tuple[float, ...]] = {
    "sphere": (0.4,),
    "capsule": (0.2, 0.7),
    "box": (0.3, 0.5, 0.9),
    "cylinder": (0.3, 0.8),
}


def pose(seed: int) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    return trimesh.transformations.random_rotation_matrix(random.random(3))[:3, :3], random.uniform(-1, 1, 3)


def support(kind: str, size: tuple[float, ...], axes: Array, centre: Array) -> Array:
    """How far a primitive reaches in `DIRECTIONS`, by its textbook support function."""
    own = DIRECTIONS @ axes
    if kind == "box":
        reach = np.abs(own) @ np.array(size) / 2
    else:
        radius, length = (*size, 0.0)[:2]
        around = np.hypot(own[:, 0], own[:, 1]) if kind == "cylinder" else 1.0
        reach = radius * around + length / 2 * np.abs(own[:, 2])
    return np.asarray(DIRECTIONS @ centre + reach)


def support_of(primitive: rlacd.Primitive) -> Array:
    return support(primitive.kind, primitive.size, primitive.axes, primitive.centre)


def depth(primitive: rlacd.Primitive, points: Array) -> Array:
    """At least 0 for points inside; written apart from the code that is tested."""
    x, y, z = ((points - primitive.centre) @ primitive.axes).T
    if primitive.kind == "box":
        a, b, c = primitive.size
        return np.minimum.reduce([a / 2 - abs(x), b / 2 - abs(y), c / 2 - abs(z)])
    radius, length = (*primitive.size, 0.0)[:2]
    if primitive.kind == "cylinder":
        return np.minimum(radius - np.hypot(x, y), length / 2 - abs(z))
    return np.asarray(radius - np.sqrt(x**2 + y**2 + np.clip(abs(z) - length / 2, 0, None) ** 2))


def mesh_of(kind: str, size: tuple[float, ...], axes: Array, centre: Array) -> trimesh.Trimesh:
    """A primitive as trimesh makes it."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = axes, centre
    return {
        "box": lambda: trimesh.creation.box(size, place),
        "sphere": lambda: trimesh.creation.icosphere(4, size[0]).apply_transform(place),
        "cylinder": lambda: trimesh.creation.cylinder(*size, sections=48, transform=place),
        "capsule": lambda: trimesh.creation.capsule(size[1], size[0], count=(64, 32), transform=place),
    }[kind]()


def solid(kind: PrimitiveKind, seed: int = 1) -> trimesh.Trimesh:
    return mesh_of(kind, SIZES[kind], *pose(seed)).convex_hull


def samples_on(primitive: rlacd.Primitive, count: int = 400) -> Array:
    mesh = mesh_of(primitive.kind, primitive.size, primitive.axes, primitive.centre)
    return np.asarray(mesh.sample(count, seed=0))


# --- fits -------------------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.integers(2, 3), st.integers(1, 40))
def test_the_smallest_ball_touches_points_that_hold_it(seed: int, dimensions: int, count: int) -> None:
    """It contains all points, and its centre is in the hull of those on its surface: then no smaller ball exists."""
    points = np.random.default_rng(seed).normal(size=(count, dimensions)).round(1)
    centre, radius = smallest_ball(points)
    distances = np.linalg.norm(points - centre, axis=1)
    assert distances.max() <= radius * (1 + 1e-9) + 1e-15
    touching = points[distances >= radius * (1 - 1e-7)]
    from scipy.optimize import nnls

    _, residual = nnls(np.vstack([(touching - centre).T, np.ones(len(touching))]), [*np.zeros(dimensions), 1.0])
    assert residual < 1e-5


@pytest.mark.parametrize("kind", PRIMITIVE_KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_a_primitive_of_any_pose_is_found_again(kind: PrimitiveKind, seed: int) -> None:
    hull = Hull.of(np.array(solid(kind, seed).vertices))
    (fitted,) = fit_primitives(hull, [kind])
    assert fitted.kind == kind
    assert fitted.beyond(hull.vertices) < 1e-9
    assert fitted.volume == pytest.approx(rlacd.Primitive(kind, np.zeros(3), np.eye(3), SIZES[kind]).volume, rel=0.02)


@given(st.integers(0, 2**32 - 1))
@pytest.mark.promise("primitives")
def test_fits_and_their_polyhedra_contain_any_hull(seed: int) -> None:
    random = np.random.default_rng(seed)
    hull = Hull.of(random.normal(size=(random.integers(4, 60), 3)) * random.choice([1e-3, 0.1, 1.0], 3))
    fits = fit_primitives(hull)
    assert [fit.kind for fit in fits].count("sphere") == 1
    for fit in fits:
        grown = fit.grown(fit.beyond(hull.vertices) + 1e-9)
        assert depth(grown, hull.vertices).min() >= 0
        reach = support_of(grown)
        for corners in grown.polyhedra():
            slack = (corners @ DIRECTIONS.T).max(axis=0) - reach
            assert slack.min() > -1e-9
            assert slack.max() < 0.08 * max(grown.size)


# --- decompositions ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PRIMITIVE_KINDS)
@pytest.mark.promise("primitives")
def test_a_solid_that_is_a_primitive_becomes_it(kind: PrimitiveKind) -> None:
    mesh = solid(kind)
    result = rlacd.decompose(mesh, primitives=True, quality="fast", threads=1)
    (found,) = result.primitives
    assert found.kind == kind
    assert result.report.primitives == {**dict.fromkeys((*PRIMITIVE_KINDS, "hull"), 0), kind: 1}
    assert found.volume == pytest.approx(mesh.volume, rel=0.02)
    assert depth(found, mesh.vertices).min() >= 0
    assert f"1 as {kind}" in repr(result)


def test_a_table_is_five_boxes_of_the_right_size() -> None:
    result = rlacd.decompose(table(), primitives=True, threads=1)
    boxes = primitives_of(result)
    assert [box.kind for box in boxes] == ["box"] * 5
    assert sorted(max(boxes, key=lambda box: box.volume).size) == pytest.approx([0.02, 0.3, 0.4], abs=1e-6)
    assert result.report.mass.volume_abs == pytest.approx(TABLE_VOLUME, rel=1e-9)
    plain = rlacd.decompose(table(), threads=1)
    assert plain.primitives == [None] * len(plain)
    assert plain.report.primitives is None


def test_what_a_cut_at_an_angle_left_out_of_a_box_is_solid_so_that_it_may_be_a_box() -> None:
    """Two beams of an L are cut along the mitre; the other beam fills what each lacks."""
    bounds = [((0, 0, 0), (2, 0.4, 0.4)), ((0, 0, 0), (0.4, 0.4, 2))]
    ell = trimesh.util.concatenate([trimesh.creation.box(bounds=each) for each in bounds])
    hulls = rlacd.decompose(ell, quality="fast", threads=1)
    assert sum(hull.volume for hull in hulls) == pytest.approx(0.576, rel=1e-6), "the cut no longer shares the corner"
    result = rlacd.decompose(ell, primitives=True, quality="fast", threads=1)
    for box, extents in zip(primitives_of(result), (bounds[0][1], bounds[1][1]), strict=True):
        assert sorted(box.size) == pytest.approx(sorted(extents), abs=1e-6)
    assert_true(result)
    assert result.report.hausdorff.added < 5e-3


def assert_true(result: rlacd.Decomposition, threshold: float = 0.05) -> None:
    """Every hull contains its primitive, the primitives cover the input, and reach no farther than the threshold."""
    scale = result.report.scale
    for hull, primitive in zip(result, result.primitives, strict=True):
        assert_convex_hull(hull)
        if primitive is not None:
            assert ((hull.vertices @ DIRECTIONS.T).max(axis=0) - support_of(primitive)).min() * scale > -1e-8
    assert result.report.concavity.max <= threshold
    assert result.report.hausdorff.added <= threshold + 5e-3
    surface, _ = trimesh.sample.sample_surface(result.source, 3000, seed=0)
    inside = np.zeros(len(surface), dtype=bool)
    for hull, primitive in zip(result, result.primitives, strict=True):
        if primitive is not None:
            inside |= depth(primitive, surface) * scale >= -1e-7
        else:
            planes = hull.face_normals, np.einsum("fi,fi->f", hull.face_normals, hull.triangles[:, 0])
            inside |= ((surface @ planes[0].T - planes[1]) * scale <= 1e-6).all(axis=1)
    assert inside.mean() > 0.999 - result.report.hausdorff.missed * 100
    for primitive in result.primitives:
        if primitive is not None:
            _, distances, _ = trimesh.proximity.closest_point(result.source, samples_on(primitive, 60))
            on_border = distances * scale
            assert np.median(on_border) <= threshold + 5e-3


@pytest.mark.slow
def test_primitives_of_real_meshes_cover_them_within_the_threshold(corpus: Path) -> None:
    names = ("raw/chair_ivar_0668.obj", "test/vhacd/hornbug.ply", "test/vhacd/beshon.ply")
    shapes = 0
    for name in names:
        result = rlacd.decompose(corpus / name, primitives=True, quality="fast", threads=1)
        shapes += sum(each is not None for each in result.primitives)
        assert_true(result)
    assert shapes > 10


def test_limits_hold_for_the_polyhedra_too() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    result = rlacd.decompose(ball, primitives=True, max_vertices=64, threshold=0.2, quality="fast", threads=1)
    assert [each.kind for each in result.primitives if each is not None] == ["sphere"]
    assert len(result[0].vertices) == 42
    low = rlacd.decompose(table(), primitives=["box", "cylinder"], max_vertices=8, quality="fast", threads=1)
    assert max(len(hull.vertices) for hull in low) <= 8
    assert {each.kind for each in low.primitives if each is not None} == {"box"}


def test_only_the_kinds_named_are_used() -> None:
    for kinds in (["box"], "box", ("box", "sphere"), " box , sphere "):
        result = rlacd.decompose(solid("cylinder"), primitives=kinds, threshold=0.5, quality="fast", threads=1)  # type: ignore[arg-type]
        assert all(each is None or each.kind in ("box", "sphere") for each in result.primitives)
    assert result.report.options["primitives"] == ["sphere", "box"]


@pytest.mark.parametrize("wrong", ["ball", ["box", "cone"], "", 3, [3], {"box": 1}])
def test_what_is_no_primitive_is_refused_in_one_sentence(wrong: Any) -> None:
    with pytest.raises(
        OptionError, match=r"primitives is .*; it has to be all \(True\), or some of sphere, capsule, box"
    ):
        rlacd.decompose(table(), primitives=wrong)


def stool() -> trimesh.Trimesh:
    """A round seat on three slanted, round legs."""
    parts = [trimesh.creation.cylinder(0.5, 0.1, sections=48).apply_translation([0, 0, 0.9])]
    for turn in 2 * np.pi / 3 * np.arange(3):
        foot, top = (np.array([r * math.cos(turn), r * math.sin(turn), z]) for r, z in ((0.45, 0.0), (0.3, 0.9)))
        parts.append(trimesh.creation.cylinder(0.05, segment=[foot, top], sections=32))
    return trimesh.util.concatenate(parts)


def test_primitives_leave_navigable_space_free(tmp_path: Path) -> None:
    """The true shapes touch no ball in MuJoCo, but would touch larger ones."""
    space = rlacd.NavigableSpace(radius=0.12, tolerance=0.04)
    result = rlacd.decompose(stool(), criterion=space, primitives=True, quality="fast", threads=1)
    found, balls = primitives_of(result), result.balls
    assert "cylinder" in {each.kind for each in found}
    mujoco = pytest.importorskip("mujoco", reason="the extra sim is not installed")
    path = result.save(tmp_path / "stool.xml")
    for wider, touched in ((-1e-5, False), (0.04, True)):
        spec = mujoco.MjSpec.from_file(str(path))
        for centre, radius in zip(balls.centres, balls.radii + wider, strict=True):
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=centre.tolist(), size=[radius, 0, 0])
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert bool((data.contact.dist < 0).any()) == touched


def test_primitives_of_navigable_space_stay_near_the_convex_hull() -> None:
    """No ball stands beside a convex solid, so that a cylinder around half a ball, 0.4 off at its rim, blocks none."""
    dome = trimesh.creation.icosphere(subdivisions=3).slice_plane([0, 0, 0], [0, 0, 1], cap=True)
    drum = trimesh.creation.cylinder(1.0, 1.0, sections=24)
    for mesh, kinds in ((dome, set[str]()), (drum, {"cylinder"})):
        space = rlacd.NavigableSpace(radius=0.4, tolerance=0.04)
        result = rlacd.decompose(mesh, criterion=space, primitives=True, quality="fast", threads=1)
        assert len(result.balls) == 0
        assert {each.kind for each in primitives_of(result)} == kinds
        for each in primitives_of(result):
            away = point_to_triangles(samples_on(each), np.asarray(mesh.vertices), np.asarray(mesh.faces))
            assert away.max() <= 0.04


# --- programs that read them ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shapes() -> rlacd.Decomposition:
    """One of each kind, turned, side by side, and a tetrahedron, which is none of them."""
    meshes = [solid(kind, seed).apply_translation([2.2 * seed, 0, 0]) for seed, kind in enumerate(PRIMITIVE_KINDS)]
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    meshes.append(trimesh.convex.convex_hull(corners).apply_translation([9.0, 0, 0]))
    joined = trimesh.util.concatenate(meshes)
    result = rlacd.decompose(joined, primitives=True, threshold=0.01, quality="fast", threads=1)
    kinds = [None if each is None else each.kind for each in result.primitives]
    assert set(kinds) == {*PRIMITIVE_KINDS, None}, kinds
    assert len(kinds) == 5
    return result


def primitives_of(result: rlacd.Decomposition) -> list[rlacd.Primitive]:
    return [each for each in result.primitives if each is not None]


Read = tuple[str, tuple[float, ...], Array, Array] | None
"""Kind, size, axes and centre of a shape, None for what is a mesh."""


def in_mujoco(shapes: rlacd.Decomposition, folder: Path) -> list[Read]:
    model = mujoco_model(shapes.save(folder / "shapes.xml"))
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    volume = sum(abs(body.volume) for body in shapes.source.split())
    assert model.body_mass[1] == pytest.approx(1000 * volume, rel=1e-6)
    found: list[Read] = []
    for geom in np.flatnonzero(model.geom_contype):
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        half, place = model.geom_size[geom], (data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])
        size = tuple(2 * half) if kind == "box" else (half[0], 2 * half[1])[: 1 if kind == "sphere" else 2]
        found.append(None if kind == "mesh" else (kind, size, *place))
    return found


def in_bullet(shapes: rlacd.Decomposition, folder: Path) -> list[Read]:
    bullet = pytest.importorskip("pybullet", reason="the extra sim is not installed")
    client = bullet.connect(bullet.DIRECT)
    try:
        body = bullet.loadURDF(
            str(shapes.save(folder / "shapes.urdf")),
            flags=bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
        shapes_of_body = bullet.getCollisionShapeData(body, -1, physicsClientId=client)
        centre, turn = bullet.getDynamicsInfo(body, -1, physicsClientId=client)[3:5]
    finally:
        bullet.disconnect(client)
    kinds = {bullet.GEOM_BOX: "box", bullet.GEOM_SPHERE: "sphere", bullet.GEOM_CYLINDER: "cylinder"}
    found: list[Read] = []
    for _, _, shape, size, _, place, own_turn in shapes_of_body:
        kind = kinds.get(shape)
        given = {"box": tuple(size), "sphere": (size[0],), "cylinder": (size[1], size[0])}.get(str(kind))
        axes = axes_of(turn) @ axes_of(own_turn)
        found.append(None if kind is None else (kind, given, axes, np.array(centre) + axes_of(turn) @ place))
    return found


def axes_of(turn: tuple[float, ...]) -> Array:
    return np.asarray(trimesh.transformations.quaternion_matrix([turn[3], *turn[:3]])[:3, :3])


def in_drake(shapes: rlacd.Decomposition, folder: Path) -> list[Read]:
    pytest.importorskip("pydrake", reason="drake is not installed")
    from pydrake.geometry import Role
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    plant, scene = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    (instance,) = Parser(plant).AddModels(str(shapes.save(folder / "shapes.sdf")))
    (index,) = plant.GetBodyIndices(instance)
    inspector, found = scene.model_inspector(), []
    named = {inspector.GetName(i): i for i in plant.GetCollisionGeometriesForBody(plant.get_body(index))}
    for name in sorted(named):
        assert inspector.GetProperties(named[name], Role.kProximity) is not None
        shape, place = inspector.GetShape(named[name]), inspector.GetPoseInFrame(named[name])
        kind = type(shape).__name__.lower()
        size = tuple(shape.size()) if kind == "box" else ()
        if kind in ("sphere", "capsule", "cylinder"):
            size = (shape.radius(), *([] if kind == "sphere" else [shape.length()]))
        found.append((kind, size, place.rotation().matrix(), place.translation()) if size else None)
    return found


def in_usd(shapes: rlacd.Decomposition, folder: Path) -> list[Read]:
    pytest.importorskip("pxr", reason="the extra usd is not installed")
    from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

    stage = Usd.Stage.Open(str(shapes.save(folder / "shapes.usda")))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []
    found: list[Read] = []
    for prim in (prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)):
        assert UsdGeom.Imageable(prim).ComputePurpose() == "guide"
        world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0.0))  # rows from the left
        lengths = np.linalg.norm(world[:3, :3], axis=1)
        kind, place = prim.GetTypeName().lower(), ((world[:3, :3] / lengths[:, None]).T, world[3, :3])
        value = {name: prim.GetAttribute(name).Get() for name in ("size", "radius", "height", "axis")}
        assert value["axis"] in (None, "Z")
        round_size = tuple(value[name] for name in ("radius", "height") if value[name] is not None)
        size = tuple(lengths * value["size"]) if kind == "cube" else round_size
        found.append(None if kind == "mesh" else ("box" if kind == "cube" else kind, size, *place))
    return found


@pytest.mark.parametrize(("read", "error"), [(in_mujoco, 1e-9), (in_bullet, 1e-5), (in_drake, 1e-9), (in_usd, 1e-9)])
def test_programs_have_the_same_shapes(tmp_path: Path, shapes: rlacd.Decomposition, read: Any, error: float) -> None:
    for found, primitive in zip(read(shapes, tmp_path), shapes.primitives, strict=True):
        if primitive is None or (read is in_bullet and primitive.kind == "capsule"):  # URDF proper has no capsules
            assert found is None
        else:
            assert found[0] == primitive.kind
            assert support(*found) == pytest.approx(support_of(primitive), abs=error)


def test_unreal_finds_primitives_by_name(tmp_path: Path, shapes: rlacd.Decomposition) -> None:
    path = shapes.save(tmp_path / "shapes.glb", file_type="unreal")
    read = trimesh.load_scene(path, process=False)
    prefixes = {"box": "UBX", "sphere": "USP", "capsule": "UCP", "cylinder": "UCX", None: "UCX"}
    for index, (hull, primitive) in enumerate(zip(shapes, shapes.primitives, strict=True)):
        name = f"{prefixes[None if primitive is None else primitive.kind]}_mesh_{index:02d}"
        assert read.geometry[name].volume == pytest.approx(hull.volume, rel=1e-5)


def test_formats_without_primitives_hold_the_meshes(tmp_path: Path, shapes: rlacd.Decomposition) -> None:
    for name in ("shapes.glb", "shapes.obj", "folder/"):
        shapes.save(str(tmp_path) + f"/{name}")
    assert len(list((tmp_path / "folder").glob("*.obj"))) == len(shapes)
    read = trimesh.load_scene(tmp_path / "shapes.glb", process=False)
    assert [read.geometry[f"hull_{i:03d}"].volume for i in range(len(shapes))] == pytest.approx(
        [hull.volume for hull in shapes], rel=1e-5
    )
    one = etree.parse(str(shapes.save(tmp_path / "shapes.urdf", one_mesh=True)))
    assert len(one.findall(".//collision")) == 1


@given(st.integers(0, 2**32 - 1))
def test_angles_and_quaternions_give_the_axes_back(seed: int) -> None:
    axes, centre = pose(seed)
    tilted = trimesh.transformations.euler_matrix(0.3, math.pi / 2, 0.2)[:3, :3]
    for rotation in (axes, tilted, np.eye(3)):
        primitive = rlacd.Primitive("box", centre, rotation, (1.0, 2.0, 3.0))
        roll, pitch, yaw = primitive.roll_pitch_yaw
        assert trimesh.transformations.euler_matrix(roll, pitch, yaw, "sxyz")[:3, :3] == pytest.approx(
            rotation, abs=1e-7
        )
        assert trimesh.transformations.quaternion_matrix(primitive.quaternion)[:3, :3] == pytest.approx(
            rotation, abs=1e-9
        )
