"""FBX files, read by ufbx (extra ``fbx``) in a process of its own, which a damaged file may crash."""

from __future__ import annotations

import gc
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, ToldNodes, read_apart, served
from rlacd.io.read.contents import HIDDEN, Contents, Triangles, counts_of, damaged
from rlacd.io.read.polygons import triangles_of
from rlacd.pool import Blobs, Values

SERVER = "rlacd.io.read.fbx:read_scene"

_UNREAD = {
    "skin_deformers": "skinned meshes of {} are read as bound, at their nodes",
    "blend_deformers": "blend shapes of {} were left out",
    "cache_deformers": "geometry caches of {} were left out",
    "anim_curves": "animations of {} were left out",
    "nurbs_surfaces": "NURBS surfaces of {} were left out",
    "nurbs_trim_surfaces": "NURBS surfaces of {} were left out",
    "procedural_geometries": "procedural geometries of {} were left out",
}

_KEPT: list[Any] = []
"""What ufbx gave, until the process ends: version 0.0.5 frees elements that it still refers to."""


def read_fbx(path: Path, content: bytes) -> Contents:
    """Read the visible meshes: a node for each, in the coordinates and the unit of the file.

    Raises
    ------
    MeshFileError
        It is damaged, or holds too much.
    MissingExtraError
        The extra ``fbx`` is not installed.
    """
    return read_apart(SERVER, path, "FBX", {"file": content})


@served
def read_scene(values: Values, blobs: Blobs) -> Answered:
    """Read a ``file``: ``INDEX.points`` and ``INDEX.faces`` of every node, and its description."""
    gc.disable()  # it would follow what `_KEPT` is for
    path = Path(values["path"])
    try:
        return _scene(path, blobs["file"])
    except MeshFileError:
        raise
    except Exception as error:  # of ufbx, or of a description that does not fit its arrays
        raise damaged(path, "FBX", str(error)) from error


def _scene(path: Path, content: bytes) -> tuple[Values, dict[str, bytes]]:
    """The meshes in the coordinates of the file, which says what points up and how long its unit is."""
    import ufbx

    # A file may also be left-handed, or point up along a negative axis, which no option can say.
    strict = ufbx.IndexErrorHandling.ABORT_LOADING
    given: dict[str, Any] = {"file_type": ufbx.FileFormat.FBX, "index_error_handling": strict}
    scene = ufbx.load_memory(content, **given)
    axes = np.array(scene.settings.axes)
    if not _is_plain(axes):
        axes = np.array([ufbx.CoordinateAxis(axis) for axis in (0, 2, 4)])  # x right, y up, z to the front
        _KEPT.append(scene)
        scene = ufbx.load_memory(content, **given, target_axes=ufbx.CoordinateAxes(*map(ufbx.CoordinateAxis, axes)))
    _KEPT.append(scene)
    said = dict.fromkeys(text.format(path.name) for name, text in _UNREAD.items() if len(getattr(scene, name)))
    said |= dict.fromkeys(f"{path.name}: {one.description}" for one in scene.metadata.warnings)
    nodes, left_out = _shown(scene)
    said |= dict.fromkeys(counts_of(left_out))
    told = ToldNodes(path)
    for index, (node, mesh) in enumerate(nodes):
        to_world = np.vstack([np.array(node.geometry_to_world).T, (0, 0, 0, 1)])
        told.add((node.name, mesh.name, f"{node.name or 'node'}.{index}"), to_world, _look(node), _triangles(mesh))
    up, metres = "xyz"[axes[1] // 2], float(scene.settings.unit_meters)
    return {"nodes": told.values, "up": up, "metres": metres, "warnings": list(said)}, told.blobs


def _is_plain(axes: np.ndarray[Any, Any]) -> bool:
    """Whether what points right, up and to the front (0 for +x, 1 for -x, ...) is right-handed, and up positive."""
    rows = np.zeros((3, 3))
    if (axes > 5).any() or len({axis // 2 for axis in axes.tolist()}) < 3:
        return False
    rows[np.arange(3), axes // 2] = 1 - 2 * (axes % 2)
    return bool(axes[1] % 2 == 0 and np.linalg.det(rows) > 0)


def _shown(scene: Any) -> tuple[list[tuple[Any, Any]], Counter[str]]:
    """The nodes that place a mesh, with it; and how many were left out, by the reason."""
    import ufbx

    found, gone, left_out = [], set[int](), Counter[str]()
    for node in scene.nodes:  # a parent comes before its children
        mesh, parent, number = node.mesh, node.parent, node.typed_id
        _KEPT.append((node, mesh, parent))
        why = "" if node.visible else HIDDEN
        if not why and parent is not None and parent.attrib_type == ufbx.ElementType.LOD_GROUP:
            _KEPT.append(first := parent.children[0])
            why = "lower levels of detail were left out" if first.typed_id != number else ""
        if parent is not None and parent.typed_id in gone:
            gone.add(number)
        elif why:
            gone.add(number)
            left_out[why] += 1
        elif mesh is not None:
            found.append((node, mesh))
    return found, left_out


def _triangles(mesh: Any) -> Triangles:
    """The points and triangles of a mesh; subdivision surfaces are read as their cages."""
    points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    corners = np.fromiter(mesh.vertex_indices, np.int64, len(mesh.vertex_indices))
    counts = np.array(mesh.faces, dtype=np.int64).reshape(-1, 2)[:, 1]
    return Triangles(points, triangles_of(points, counts, corners))


def _look(node: Any) -> dict[str, list[float]] | None:
    """The colour of a node's first material, as `rlacd.io.read.usd_stage` describes looks."""
    materials = node.materials
    if not len(materials):
        return None
    _KEPT.append(material := materials[0])
    color = material.pbr.base_color
    return {"diffuseColor": list(color.value_vec4)[:3]} if color.has_value else None
