"""The input's own scene with hulls added under the nodes they belong to: glTF in, glTF out, nothing lost.

The JSON of a glTF file is edited and its binary chunk appended to; no index that it holds changes. So nodes,
transforms, materials, textures, skins, animations, extensions and whatever else is unknown here stay as they are; only
hulls for an engine, which were not decomposed, give way to the new ones. Files that it refers to are put into it, so
that the binary file stands alone. Anything else is converted first.
"""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import trimesh

from rlacd.io.read.beside import DATA, IMAGES, FolderFiles
from rlacd.io.read.contents import Triangles
from rlacd.io.read.gltf import split
from rlacd.io.write.converted import converted, nodes_of
from rlacd.io.write.glb import GltfFile, Placed
from rlacd.io.write.palette import hull_colors, linear_from_srgb
from rlacd.io.write.single_precision import required_hull
from rlacd.result import Result
from rlacd.solid.arrays import FloatArray
from rlacd.solid.input_mesh import InputMesh

if TYPE_CHECKING:
    from rlacd.extras.primitive import Primitive

Named: TypeAlias = "Callable[[str, int, Primitive | None], str]"
"""The name of a hull, from that of its node or mesh, its number there, and the primitive that it stands for."""

_MIME = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp", ".ktx2": "image/ktx2"}


def encode_kept(result: Result, named: Named, *, colored: bool) -> bytes:
    """Write the input as GLB, with each hull as a child of the node it belongs to.

    A hull's node is named after that node, and its mesh after the mesh there: some importers look at the one, some at
    the other.

    Parameters
    ----------
    result : Result
        Of an input that has an asset.
    named : callable
        Names a hull after its node, or its mesh after that of the node.
    colored : bool
        Give every hull a material of its own; otherwise it has none.

    Raises
    ------
    OutputError
        A hull is too thin for single precision.
    """
    mesh = result.input
    assert mesh is not None
    assert mesh.asset is not None
    scene = _Scene(mesh, result.name)
    is_gltf = mesh.asset.is_gltf
    nodes = mesh.nodes if is_gltf else nodes_of(mesh, result.name)
    factor = mesh.factor if is_gltf else 1.0  # a glTF file stays in its own unit
    of_nodes: Counter[str] = Counter()
    of_meshes: Counter[str] = Counter()
    primitives = result.primitives
    colors = linear_from_srgb(hull_colors(len(result)))
    for index, (hull, color) in enumerate(zip(result.hulls, colors, strict=True)):
        node = nodes[int(hull.metadata.get("node_index", 0))]
        at = scene.index_of(node.key)
        mesh_name = scene.mesh_name(at) or node.name
        # Engines move a node whose mesh follows a skeleton away from below its hulls.
        is_skinned = at is not None and "skin" in scene.header["nodes"][at]
        inverse = None if is_skinned else _inverse(node.transform)
        primitive = primitives[index] if inverse is None or _keeps_shape(inverse) else None
        placed = _local(hull, factor, inverse, named(node.name, of_nodes[node.name], primitive))
        called = named(mesh_name, of_meshes[mesh_name], primitive)
        of_nodes[node.name] += 1
        of_meshes[mesh_name] += 1
        scene.add(placed._replace(color=color), called, None if inverse is None else at, colored)
    return scene.encoded()


def _local(hull: trimesh.Trimesh, factor: float, inverse: FloatArray | None, name: str) -> Placed:
    """A hull in the coordinates of its node, or in those of the scene if there is no way into its node's."""
    points, faces = np.asarray(hull.vertices) / factor, np.asarray(hull.faces)
    if inverse is not None:
        points = points @ inverse[:3, :3].T + inverse[:3, 3]
        if np.linalg.det(inverse[:3, :3]) < 0:
            faces = faces[:, ::-1]
    return Placed(name, *required_hull(Triangles(points, faces), name, "as GLB"), np.zeros(3))


def _inverse(transform: FloatArray) -> FloatArray | None:
    """The way into a node's coordinates; None if the node flattens what is in it."""
    if not np.isfinite(transform).all() or np.linalg.cond(transform[:3, :3]) > 1e6:
        return None
    return np.asarray(np.linalg.inv(transform))


def _keeps_shape(transform: FloatArray) -> bool:
    """Whether a transform stretches all directions alike."""
    product = transform[:3, :3].T @ transform[:3, :3]
    return bool(np.allclose(product, product[0, 0] * np.eye(3), rtol=0, atol=1e-6 * product[0, 0]))


class _Scene(GltfFile):
    """The input as a glTF file."""

    def __init__(self, mesh: InputMesh, name: str) -> None:
        asset = mesh.asset
        assert asset is not None
        self._by_name = not asset.is_gltf
        super().__init__(*(split(asset.content) if asset.is_gltf else converted(mesh, name)))
        self._take_in(FolderFiles(asset.path.parent, DATA | IMAGES) if asset.is_gltf and asset.path else None)
        self._nodes = {node.get("name"): index for index, node in enumerate(self.header.get("nodes", []))}
        self._take_off([at for node in mesh.left_out if (at := self.index_of(node.key)) is not None])

    def index_of(self, key: int | str) -> int | None:
        """The index of a source node."""
        return self._nodes.get(key) if self._by_name else int(key)

    def mesh_name(self, index: int | None) -> str:
        """The name of the mesh that a node places; empty if it has none."""
        mesh = None if index is None else self.header["nodes"][index].get("mesh")
        name = "" if mesh is None else self.header["meshes"][mesh].get("name", "")
        return name if isinstance(name, str) else ""

    def _take_off(self, off: Sequence[int]) -> None:
        """Take the meshes off nodes, and the nodes off the scene unless there is something below them.

        They stay in their lists, nameless, so that all other indices stay too.
        """
        nodes, meshes = self.header.get("nodes", []), self.header.get("meshes", [])
        unplaced = {nodes[index].get("mesh") for index in off}
        for index in off:
            for of_mesh in ("mesh", "skin", "weights", "name"):
                nodes[index].pop(of_mesh, None)
        for mesh in unplaced - {None, *(node.get("mesh") for node in nodes)}:
            meshes[mesh].pop("name", None)
        ends = {index for index in off if not nodes[index].get("children")}
        holders = [(node, "children") for node in nodes]
        holders += [(scene, "nodes") for scene in self.header.get("scenes", [])]
        for holder, below in holders:
            if not ends.isdisjoint(holder.get(below, ())):
                holder[below] = [index for index in holder[below] if index not in ends]
                if not holder[below]:
                    del holder[below]  # no list is empty in glTF

    def _take_in(self, files: FolderFiles | None) -> None:
        """Put the files that buffers and images name into this one; those that are missing stay named."""
        for index, buffer in enumerate(self.header.get("buffers", [])):
            data = _read(files, buffer.get("uri"))
            if index == 0 and self.binary is None and (data is not None or _is_data(buffer.get("uri"))):
                data = base64.b64decode(buffer["uri"].partition(",")[2]) if data is None else data
                del buffer["uri"]
                self.binary = data + bytes(-len(data) % 4)
            elif data is not None:
                buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode("ascii")
        for image in self.header.get("images", []):
            uri = image.get("uri")
            data = _read(files, uri)
            if data is not None:
                image["bufferView"] = self.append(data)
                image.setdefault("mimeType", _MIME.get(Path(uri).suffix.lower(), "image/png"))
                del image["uri"]


def _read(files: FolderFiles | None, uri: Any) -> bytes | None:
    if files is None or not isinstance(uri, str) or _is_data(uri):
        return None
    try:
        return files.get(uri)
    except FileNotFoundError:
        return None


def _is_data(uri: Any) -> bool:
    return isinstance(uri, str) and uri.startswith("data:")
