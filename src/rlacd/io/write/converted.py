"""An input that is no glTF file, converted to one by trimesh, with all that trimesh carries of its looks."""

from __future__ import annotations

import io
import re
from typing import Any, TypeAlias

import numpy as np
import trimesh

from rlacd.io.read.contents import Triangles
from rlacd.io.read.gltf import split
from rlacd.io.read.looks import BETWEEN, looks_of
from rlacd.io.write.encode import VISUAL_COLOR
from rlacd.io.write.glb import ROUGHNESS
from rlacd.io.write.model import Look, Painted
from rlacd.io.write.palette import linear_from_srgb
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.input_mesh import InputMesh, SourceNode


def converted(mesh: InputMesh, name: str) -> tuple[dict[str, Any], bytes | None]:
    """Convert the input's scene to GLB, in the unit of the hulls: its JSON, and what follows.

    A file with one mesh becomes one node called `name`, whatever number of materials the mesh has.

    Parameters
    ----------
    mesh : InputMesh
        Its asset is no glTF file.
    name : str
        For a mesh without a scene.
    """
    assert mesh.asset is not None
    header, rest = split(bytes(_scene(mesh, name).export(file_type="glb")))
    if mesh.asset.extension:
        _tell_materials(header)
    if mesh.asset.path is not None:
        _join(header, name if len(mesh.nodes) + len(mesh.left_out) < 2 else None)
    return header, rest


def nodes_of(mesh: InputMesh, name: str) -> tuple[SourceNode, ...]:
    """The nodes of the input as `converted` names and places them."""
    assert mesh.asset is not None
    if not mesh.nodes:
        return (SourceNode(name, name, np.eye(4)),)
    renamed = mesh.asset.path is not None and len(mesh.nodes) + len(mesh.left_out) == 1
    nodes = []
    for node in mesh.nodes:
        transform = node.transform.copy()
        transform[:3, 3] *= mesh.factor
        nodes.append(SourceNode(name if renamed else node.name, name if renamed else node.key, transform))
    return tuple(nodes)


def _scene(mesh: InputMesh, name: str) -> trimesh.Scene:
    """The scene in the unit of the hulls; the triangles alone if looks cannot be read."""
    asset = mesh.asset
    assert asset is not None
    content: Any = asset.content
    if asset.path is not None:
        content = looks_of(asset.path, content, asset.extension)
    if content is None or (isinstance(content, trimesh.Scene) and not content.geometry):
        return trimesh.Scene({name: trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)})
    scene = content if isinstance(content, trimesh.Scene) else trimesh.Scene({name: content})
    return scene if mesh.factor == 1.0 else _scaled(scene, mesh.factor)


_Shape: TypeAlias = tuple[FloatArray, Int64Array, FloatArray | None]
"""Vertices, faces, and where the vertices are in a picture."""


def painted_parts(mesh: InputMesh | None) -> list[Painted]:
    """The input by materials, in the unit of the hulls; nothing if it has none, or is a glTF file."""
    if mesh is None or mesh.asset is None or mesh.asset.is_gltf:
        return []
    scene, gone = _scene(mesh, "mesh"), {node.key for node in mesh.left_out}
    groups: dict[Any, list[_Shape]] = {}
    materials: dict[Any, Any] = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        shape = scene.geometry[name]
        material = getattr(shape.visual, "material", None)
        if str(node).partition(BETWEEN)[0] in gone or not hasattr(shape, "faces"):
            continue
        picture = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        uv = None if picture is None else shape.visual.uv
        key = getattr(material, "name", None), id(picture), None if material is None else tuple(material.main_color)
        turned = shape.faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else shape.faces
        groups.setdefault(key, []).append((shape.vertices @ transform[:3, :3].T + transform[:3, 3], turned, uv))
        materials[key] = material, picture
    if not any(material is not None for material, _ in materials.values()):
        return []
    return [_part(index, parts, *materials[key]) for index, (key, parts) in enumerate(groups.items())]


def _part(index: int, parts: list[_Shape], material: Any, picture: Any) -> Painted:
    points, faces, textures = zip(*parts, strict=True)
    first = np.cumsum([0, *map(len, points)])
    mesh = Triangles(np.concatenate(points), np.concatenate([f + at for f, at in zip(faces, first, strict=False)]))
    texture = None if any(uv is None for uv in textures) else np.concatenate(textures)
    png = io.BytesIO()
    if texture is not None:
        picture.convert("RGBA" if "A" in picture.getbands() else "RGB").save(png, "PNG")
    color = np.array([*VISUAL_COLOR, 255] if material is None else material.main_color) / 255
    name = re.sub(r"\W+", "_", getattr(material, "name", None) or "")[:50]
    return Painted(f"{index}_{name}".strip("_"), mesh, texture, Look(color.round(3).tolist(), png.getvalue() or None))


def _scaled(scene: trimesh.Scene, factor: float) -> trimesh.Scene:
    """A copy with shapes and distances multiplied: a scale in the transforms would upset bodies in Godot."""
    larger = scene.copy()
    for geometry in larger.geometry.values():
        geometry.apply_scale(factor)
    transforms = larger.graph.transforms
    for pair, edge in list(transforms.edge_data.items()):
        if "matrix" in edge:
            matrix = np.array(edge["matrix"], dtype=np.float64)
            matrix[:3, 3] *= factor
            larger.graph.update(frame_from=pair[0], frame_to=pair[1], matrix=matrix)
    return larger


def _tell_materials(header: dict[str, Any]) -> None:
    """No other format knows metals, which glTF takes everything for that says nothing; what has no colour is grey."""
    materials: list[dict[str, Any]] = header.setdefault("materials", [])
    for material in materials:
        material.setdefault("pbrMetallicRoughness", {}).setdefault("metallicFactor", 0.0)
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            if "material" in primitive:
                continue
            colored = "COLOR_0" in primitive["attributes"]
            color = np.ones(3) if colored else linear_from_srgb(VISUAL_COLOR)
            plain = {"baseColorFactor": [*color.tolist(), 1.0], "metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
            described = {"pbrMetallicRoughness": plain}
            if described not in materials:
                materials.append(described)
            primitive["material"] = materials.index(described)
    if not materials:
        del header["materials"]


def _join(header: dict[str, Any], name: str | None) -> None:
    """Make one node of the materials of each node of the file, which are nodes of their own in a scene of looks.

    It gets the name of the file's node, or `name` if there is only one.
    """
    groups: dict[str, list[dict[str, Any]]] = {}
    for node in header["nodes"]:
        if "mesh" in node:
            groups.setdefault(name or node["name"].partition(BETWEEN)[0], []).append(node)
    parts = [
        [part for node in group for part in header["meshes"][node["mesh"]]["primitives"]] for group in groups.values()
    ]
    header["nodes"] = [{**group[0], "name": called, "mesh": i} for i, (called, group) in enumerate(groups.items())]
    header["meshes"] = [{"name": called, "primitives": some} for called, some in zip(groups, parts, strict=True)]
    header["scenes"][0]["nodes"] = list(range(len(groups)))
