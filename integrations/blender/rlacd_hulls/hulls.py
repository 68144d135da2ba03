"""From a Blender object to arrays, and from hulls to Blender objects.

The mesh is decomposed as it stands in the world, so that an object's scale counts; its hulls are carried back into its
own space and become its children, so that they follow it. An affine map keeps them convex.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

if TYPE_CHECKING:
    import trimesh

    from rlacd import Decomposition

MARK = "rlacd_hull_of"
"""Custom property of a hull: the name of what it was made of."""


def is_input(thing: bpy.types.Object) -> bool:
    """Whether an object is a mesh and no hull of an earlier run."""
    return thing.type == "MESH" and MARK not in thing


def decompose(
    thing: bpy.types.Object, context: bpy.types.Context, modifiers: bool, options: dict[str, object]
) -> Decomposition:
    """Run `rlacd.decompose` on an object, in world space."""
    import rlacd

    vertices, faces = triangles(thing, context, modifiers)
    return rlacd.decompose((vertices, faces), **options)


def triangles(thing: bpy.types.Object, context: bpy.types.Context, modifiers: bool) -> tuple[np.ndarray, np.ndarray]:
    """Vertices float64 [V, 3] in world space and triangles int32 [F, 3] of an object."""
    seen = thing.evaluated_get(context.evaluated_depsgraph_get()) if modifiers else thing
    mesh = seen.to_mesh()
    try:
        mesh.calc_loop_triangles()
        vertices = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        faces = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.vertices.foreach_get("co", vertices)
        mesh.loop_triangles.foreach_get("vertices", faces)
    finally:
        seen.to_mesh_clear()
    to_world = np.array(thing.matrix_world, dtype=np.float64)
    there = vertices.reshape(-1, 3).astype(np.float64) @ to_world[:3, :3].T + to_world[:3, 3]
    faces = faces.reshape(-1, 3)
    if np.linalg.det(to_world[:3, :3]) < 0:  # a mirrored object is seen inside out
        faces = faces[:, ::-1]
    return np.ascontiguousarray(there), np.ascontiguousarray(faces)


def replace(thing: bpy.types.Object, result: Decomposition) -> list[bpy.types.Object]:
    """Put the hulls into a collection of their own, as children of the object; drop those of an earlier run."""
    _drop_earlier(thing)
    collection = bpy.data.collections.new(f"{thing.name} hulls")
    home = thing.users_collection[0] if thing.users_collection else bpy.context.scene.collection
    home.children.link(collection)
    return [_add(thing, collection, index, hull) for index, hull in enumerate(result)]


def _add(
    thing: bpy.types.Object, collection: bpy.types.Collection, index: int, hull: trimesh.Trimesh
) -> bpy.types.Object:
    from rlacd.io.write.palette import hull_colors, linear_from_srgb

    name = f"{thing.name}_hull_{index:03d}"
    to_object = np.linalg.inv(np.array(thing.matrix_world, dtype=np.float64))
    here = np.asarray(hull.vertices) @ to_object[:3, :3].T + to_object[:3, 3]
    faces = np.asarray(hull.faces)
    if np.linalg.det(to_object[:3, :3]) < 0:
        faces = faces[:, ::-1]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(here.tolist(), [], faces.tolist())
    mesh.update()
    body = bpy.data.objects.new(name, mesh)
    body[MARK] = thing.name
    body.color = (*linear_from_srgb(hull_colors(index + 1)[index]).tolist(), 1.0)  # seen with Shading > Color > Object
    body.parent = thing
    collection.objects.link(body)
    return body


def _drop_earlier(thing: bpy.types.Object) -> None:
    for body in [child for child in thing.children if MARK in child]:
        holders = list(body.users_collection)
        mesh = body.data
        bpy.data.objects.remove(body, do_unlink=True)
        if mesh.users == 0:
            bpy.data.meshes.remove(mesh)
        for collection in holders:
            if not collection.all_objects and collection.name.endswith(" hulls"):
                bpy.data.collections.remove(collection)
