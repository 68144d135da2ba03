"""Scenes and meshes of trimesh, from memory or from what another process read, as contents."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.errors import MeshDataError
from rlacd.io.read.contents import Contents, Triangles, require_few
from rlacd.pool import Answer
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.input_mesh import Asset, SourceNode


def geometry_of(source: Any, name: str) -> list[tuple[SourceNode, Triangles]]:
    """All that a scene, mesh or point cloud places; paths are passed over.

    Raises
    ------
    MeshDataError
        Its arrays are none of a mesh, a node has no place, or it places too many triangles.
    """
    shapes = (trimesh.Trimesh, trimesh.PointCloud)
    placed = [(node, shape) for node, shape in _instances(source, name) if isinstance(shape, shapes)]
    require_few(((getattr(shape, "faces", ()), shape.vertices) for _, shape in placed), name)
    return [(node, Triangles(*arrays_of(shape.vertices, getattr(shape, "faces", ())))) for node, shape in placed]


def _instances(source: Any, name: str) -> Iterator[tuple[SourceNode, Any]]:
    """Yield each node and its geometry, once per instance."""
    if not isinstance(source, trimesh.Scene):
        yield SourceNode("mesh", "mesh", np.eye(4)), source
        return
    for node in source.graph.nodes_geometry:
        try:
            transform, shape = source.graph[node]
        except ValueError as error:
            raise MeshDataError(f"the node {node!r:.80} of {name} has no place: export the scene again") from error
        yield SourceNode(str(node), node, np.asarray(transform, dtype=np.float64)), source.geometry[shape]


def arrays_of(vertices: Any, faces: Any) -> tuple[FloatArray, Int64Array]:
    """Check the shapes and dtypes of arrays; quads become two triangles each."""
    try:
        if np.iscomplexobj(vertices) or np.ma.is_masked(vertices) or np.ma.is_masked(faces):
            raise MeshDataError("vertices are complex, or vertices or faces are masked: give plain real arrays")
        v = np.asarray(vertices, dtype=np.float64)
        f = np.asarray(faces)
    except MeshDataError:
        raise
    except (TypeError, ValueError) as error:
        raise MeshDataError("vertices and faces must be rectangular arrays of numbers: [V, 3] and [F, 3]") from error
    v = v.reshape(-1, 3) if v.size == 0 else v
    f = f.reshape(-1, 3).astype(np.int64) if f.size == 0 else f
    if v.ndim != 2 or v.shape[1] != 3:
        raise MeshDataError(f"vertices have shape {list(v.shape)}, not [V, 3]: give one row of x, y, z per vertex")
    if f.ndim != 2 or f.shape[1] not in (3, 4):
        raise MeshDataError(f"faces have shape {list(f.shape)}, not [F, 3]: triangulate the polygons first")
    if not np.issubdtype(f.dtype, np.integer):
        raise MeshDataError(f"faces are {f.dtype}, not integers: give indices into the vertices, counted from 0")
    f = f.astype(np.int64)
    return v, (np.concatenate([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]) if f.shape[1] == 4 else f)


def contents_of(answer: Answer, path: Path) -> Contents:
    """What a reader in a process of its own tells of a file (`rlacd.io.read.apart.ToldNodes`)."""
    scene = trimesh.Scene()
    for index, node in enumerate(answer.values["nodes"]):
        points = np.frombuffer(answer.blobs[f"{index}.points"]).reshape(-1, 3).copy()
        faces = np.frombuffer(answer.blobs[f"{index}.faces"], dtype=np.int64).reshape(-1, 3).copy()
        mesh = trimesh.Trimesh(points, faces, process=False)
        if node["look"]:
            mesh.visual = trimesh.visual.TextureVisuals(material=_material(node["look"]))
        transform = np.reshape(node["transform"], (4, 4))
        scene.add_geometry(mesh, node_name=node["name"], geom_name=node["name"], transform=transform)
    kept = len(scene.geometry) > 1 or any(one.visual.defined for one in scene.geometry.values())
    asset = Asset(scene, extension=path.suffix[1:].lower()) if kept else None
    said = answer.values
    return Contents(geometry_of(scene, path.name), said.get("warnings", ()), said["up"], said["metres"], asset)


def _material(look: dict[str, list[float]]) -> Any:
    """A material of trimesh; UsdPreviewSurface gives colours as glTF does, in linear light."""
    opacity = look.get("opacity", [1.0])[0]
    return trimesh.visual.material.PBRMaterial(
        baseColorFactor=np.clip([*look.get("diffuseColor", [0.18] * 3), opacity], 0.0, 1.0),
        metallicFactor=float(np.clip(look.get("metallic", [0.0])[0], 0.0, 1.0)),
        roughnessFactor=float(np.clip(look.get("roughness", [0.5])[0], 0.0, 1.0)),
        emissiveFactor=np.clip(look.get("emissiveColor", [0.0] * 3), 0.0, 1.0),
        alphaMode="BLEND" if opacity < 1.0 else "OPAQUE",
    )
