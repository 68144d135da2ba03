"""The Blender add-on in a real Blender, as its Python module: `pip install bpy`."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.shapes import elbow

bpy = pytest.importorskip("bpy", reason="bpy, Blender as a Python module, is not installed")

FOLDER = Path(__file__).resolve().parents[1] / "integrations" / "blender"
ROUNDED = 2e-6  # Blender's float32, for things of size 2


@pytest.fixture(scope="module", autouse=True)
def addon() -> Iterator[None]:
    sys.path.insert(0, str(FOLDER))
    module = importlib.import_module("rlacd_hulls")
    module.register()
    yield
    module.unregister()
    sys.path.remove(str(FOLDER))


@pytest.fixture(autouse=True)
def empty_scene() -> None:
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing, do_unlink=True)
    for collection in list(bpy.data.collections):
        bpy.data.collections.remove(collection)


def place(mesh: trimesh.Trimesh, name: str = "elbow") -> Any:
    """Put a mesh into the scene and select it alone."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    for other in bpy.context.scene.objects:
        other.select_set(other == thing)
    bpy.context.view_layer.objects.active = thing
    bpy.context.view_layer.update()
    return thing


def hulls_of(thing: Any) -> list[Any]:
    return sorted((child for child in thing.children if "rlacd_hull_of" in child), key=lambda child: child.name)


def in_world(thing: Any) -> trimesh.Trimesh:
    bpy.context.view_layer.update()
    matrix = np.array(thing.matrix_world)
    corners = np.array([vertex.co[:] for vertex in thing.data.vertices]) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.array([polygon.vertices[:] for polygon in thing.data.polygons])
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    return trimesh.Trimesh(corners, faces, process=False)


def assert_convex(hull: trimesh.Trimesh) -> None:
    assert hull.is_watertight
    assert hull.volume > 0
    heights = (
        np.einsum("fk,vk->fv", hull.face_normals, hull.vertices)
        - np.einsum("fk,fk->f", hull.face_normals, hull.triangles[:, 0])[:, None]
    )
    assert heights.max() < ROUNDED


def assert_covered(thing: Any) -> None:
    """Every vertex of the mesh lies in a hull."""
    points = in_world(thing).vertices
    inside = np.zeros(len(points), dtype=bool)
    for child in hulls_of(thing):
        hull = in_world(child)
        heights = points @ hull.face_normals.T - np.einsum("fk,fk->f", hull.face_normals, hull.triangles[:, 0])
        inside |= (heights < ROUNDED).all(axis=1)
    assert inside.all()


def run(**options: Any) -> set[str]:
    return bpy.ops.object.rlacd_convex_hulls(**options)


def test_an_elbow_gets_two_hulls_as_children() -> None:
    thing = place(elbow(1.5))
    assert run() == {"FINISHED"}
    hulls = hulls_of(thing)
    assert [hull.name for hull in hulls] == ["elbow_hull_000", "elbow_hull_001"]
    assert bpy.data.collections["elbow hulls"].objects[:] == hulls
    assert len({tuple(hull.color) for hull in hulls}) == 2
    for hull in hulls:
        assert_convex(in_world(hull))
    assert_covered(thing)


@pytest.mark.parametrize("scale", [(1, 1, 1), (0.5, 2, 3), (-1, 1, 2)])
def test_hulls_follow_an_object_that_is_turned_scaled_or_mirrored(scale: tuple[float, float, float]) -> None:
    thing = place(elbow(1.5))
    thing.location, thing.rotation_euler, thing.scale = (3, -2, 1), (0.3, 0.7, -1.1), scale
    bpy.context.view_layer.update()
    run()
    assert len(hulls_of(thing)) == 2
    for hull in hulls_of(thing):
        assert_convex(in_world(hull))
    assert_covered(thing)
    thing.location.x += 10
    assert_covered(thing)


def test_options_reach_the_decomposition_and_a_second_run_replaces_the_first() -> None:
    thing = place(elbow(1.5))
    run()
    run(threshold=1.9)
    assert [hull.name for hull in hulls_of(thing)] == ["elbow_hull_000"]
    assert len(bpy.data.collections) == 1
    run(threshold=0.02, max_hulls=1, max_vertices=8, quality="balanced")
    (hull,) = hulls_of(thing)
    assert len(hull.data.vertices) <= 8
    assert_covered(thing)
    run(criterion="navigable", radius=0.05, tolerance=0.02)
    assert_covered(thing)


def test_modifiers_count_unless_switched_off() -> None:
    thing = place(trimesh.creation.box())
    array = thing.modifiers.new("row", "ARRAY")
    array.count, array.relative_offset_displace = 3, (2.0, 0.0, 0.0)
    run()
    assert len(hulls_of(thing)) == 3
    run(modifiers=False)
    assert len(hulls_of(thing)) == 1


def test_every_selected_mesh_is_done_and_hulls_are_never_decomposed_again() -> None:
    one, two = place(elbow(1.5), "één"), place(elbow(1.5), "two two")
    one.select_set(True)
    run()
    for thing in (one, two):
        for hull in hulls_of(thing):
            hull.select_set(True)
    run()
    assert [len(hulls_of(thing)) for thing in (one, two)] == [2, 2]
    assert not any(hulls_of(hull) for thing in (one, two) for hull in hulls_of(thing))


def test_what_cannot_be_done_is_one_sentence() -> None:
    place(trimesh.Trimesh(np.empty((0, 3)), np.empty((0, 3), dtype=int), process=False), "nothing")
    with pytest.raises(RuntimeError, match="nothing: "):
        run()
    bpy.ops.object.select_all(action="DESELECT")
    assert not bpy.ops.object.rlacd_convex_hulls.poll()


def test_a_missing_rlacd_is_reported_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    place(elbow(1.5))
    monkeypatch.setitem(sys.modules, "rlacd.errors", None)
    with pytest.raises(RuntimeError, match=r"rlacd is missing in Blender's Python: run .* -m pip install rlacd"):
        run()


def test_the_sidebar_holds_the_same_options() -> None:
    settings = bpy.context.scene.rlacd
    operator = bpy.ops.object.rlacd_convex_hulls.get_rna_type().properties
    for name in type(settings).__annotations__:
        assert name in operator
        assert getattr(settings, name) == operator[name].default
