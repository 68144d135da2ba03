"""glTF 2.0: the triangles that a file's scene shows, and the nodes that place them."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.beside import FolderFiles
from rlacd.io.read.contents import HIDDEN, MOST_PLACES, Contents, Triangles, counts_of
from rlacd.io.read.draco import DRACO, decode_draco
from rlacd.io.read.gltf_arrays import Arrays, Json, item
from rlacd.io.read.open_file import JSON_CHUNK, MAGIC
from rlacd.io.read.polygons import fan_triangles, strip_triangles
from rlacd.solid.arrays import FloatArray, Int64Array, dots, heights
from rlacd.solid.input_mesh import Asset, SourceNode

INSTANCES, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"

READ = re.compile(
    r"(KHR|EXT|MSFT)_(materials|texture|lights|xmp|animation)_\w+|KHR_(mesh_quantization|xmp|draco_mesh_compression)"
    rf"|EXT_(mesh_features|instance_features|structural_metadata)|VRM\w*|{INSTANCES}|{VISIBILITY}"
)
"""Extensions that leave the triangles as they are, or that are read."""

POINTS, LINES, SURFACES = (0,), (1, 2, 3), (TRIANGLES := 4, STRIP := 5, FAN := 6)
"""Modes of primitives."""


def read_gltf(path: Path, content: bytes) -> Contents:
    """Read a glTF file.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    content : bytes
        Its content, JSON or binary (GLB).

    Raises
    ------
    MeshFileError
        It has more than is reasonable, or requires what is not read.
    ValueError, LookupError, TypeError, ...
        It is damaged, or declares more than it holds.
    MissingExtraError
        It is compressed with Draco, and the extra ``draco`` is not installed.
    FileNotFoundError
        A file that a buffer names is not in the folder.
    """
    if content.startswith(MAGIC + b"\1"):
        raise _other_version(path)
    header, rest = split(content)
    primitives = _checked(path, header)
    arrays = Arrays(header, rest, len(content), FolderFiles(path.parent).get)
    required = DRACO in header.get("extensionsRequired", [])
    if not decode_draco(path, primitives, required, arrays) and required:
        raise _unread(path, DRACO)
    with np.errstate(all="ignore"):  # what is not finite is left out, with a warning
        geometry, warnings = _Scene(header, arrays).read()
    return Contents(geometry, warnings, "y", 1.0, Asset(content, path, "gltf"))


def split(content: bytes) -> tuple[Json, bytes | None]:
    """Split a file into its JSON and, if it is binary, the bytes that follow. Raises ValueError if it is damaged."""
    text, rest = content, None
    if content.startswith(MAGIC):
        if len(content) < 20 or content[16:20] != JSON_CHUNK:
            raise ValueError("it does not begin with JSON")
        length, chunk = struct.unpack_from("<II", content, 8)
        if max(length, 20 + chunk) > len(content):
            raise ValueError(f"its header declares {length} bytes")
        text, rest = content[20 : 20 + chunk], content[20 + chunk :]
    try:
        header = json.loads(text.decode())
    except RecursionError as error:
        raise ValueError("its JSON nests too deeply") from error
    if not isinstance(header, dict):
        raise ValueError("its JSON is no object")
    return header, rest


def _checked(path: Path, header: Json) -> list[Json]:
    """Refuse another version, extensions that are not read, and more than is reasonable; returns all primitives."""
    if str(header.get("asset", {}).get("version", 2)).split(".")[0] != "2":
        raise _other_version(path)
    for name in header.get("extensionsRequired", []):
        if READ.fullmatch(str(name)) is None:
            raise _unread(path, name)
    nodes = header.get("nodes", [])
    primitives = [primitive for mesh in header.get("meshes", []) for primitive in mesh["primitives"]]
    edges = sum(len(node.get("children", [])) for node in nodes)
    edges += sum(len(scene.get("nodes", [])) for scene in header.get("scenes", []))
    counts = {"nodes": len(nodes), "references to nodes": edges, "primitives": len(primitives)}
    for what, count in counts.items():
        if count > MOST_PLACES:
            raise MeshFileError(f"{path} has {count} {what}, more than {MOST_PLACES}: join its meshes first")
    return primitives


def _other_version(path: Path) -> MeshFileError:
    return MeshFileError(f"{path} is of another version than glTF 2.0, which alone is read: export it so")


def _unread(path: Path, extension: str) -> MeshFileError:
    how = "export it without it, or, if it is a compression, run  npx @gltf-transform/cli copy IN.glb OUT.glb"
    return MeshFileError(f"{path} requires the extension {extension!r:.60}, which is not read: {how}")


class _Scene:
    """The nodes of a file, as its scene places them."""

    def __init__(self, header: Json, arrays: Arrays) -> None:
        self._header, self._arrays = header, arrays
        self._nodes: list[Json] = header.get("nodes", [])
        self._meshes: list[Json] = header.get("meshes", [])
        surfaces = ([p for p in mesh["primitives"] if p.get("mode", TRIANGLES) in SURFACES] for mesh in self._meshes)
        self._jointed = [all("JOINTS_0" in part["attributes"] for part in parts) for parts in surfaces]
        self._worlds = _worlds(self._nodes)
        self._shapes: dict[Any, Triangles] = {}
        self._unjointed: set[int] = set()
        self._hidden = 0
        self._instances = 0

    def read(self) -> tuple[list[tuple[SourceNode, Triangles]], list[str]]:
        """Read the triangles; the points if there are none."""
        shown = [index for index in self._shown() if "mesh" in self._nodes[index]]
        meshes = {self._nodes[index]["mesh"] for index in shown}
        modes = [part.get("mode", TRIANGLES) for mesh in meshes for part in item(self._meshes, mesh)["primitives"]]
        if not set(modes) <= {*POINTS, *LINES, *SURFACES}:
            raise ValueError("a primitive of an unknown mode")
        found = [self._placed(index, SURFACES) for index in shown]
        solid = any(len(triangles.faces) for _, triangles in found)
        if not solid:
            found = [self._placed(index, POINTS) for index in shown]
        unread = (*LINES, *POINTS) if solid else LINES
        said = {
            "primitives that are points or lines were left out": sum(mode in unread for mode in modes),
            HIDDEN: self._hidden,
            "meshes with a skin but without joints were placed by their nodes": len(self._unjointed),
        }
        return [(node, shape) for node, shape in found if len(shape.vertices)], counts_of(said)

    def _shown(self) -> list[int]:
        """The nodes of the scene, by index."""
        scenes = self._header.get("scenes")
        if not scenes:
            return list(range(len(self._nodes)))
        order = list(item(scenes, self._header.get("scene", 0)).get("nodes", ()))
        found, shown = set(order), set()
        for index in order:
            node = item(self._nodes, index)
            if not node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True):
                self._hidden += 1
                continue
            shown.add(index)
            below = [child for child in node.get("children", ()) if child not in found]
            found.update(below)
            order.extend(below)
        return sorted(shown)

    def _placed(self, index: int, modes: Sequence[int]) -> tuple[SourceNode, Triangles]:
        """What a node places: by the joints of its skin, in the coordinates of the scene, or else by itself."""
        node = self._nodes[index]
        mesh, skin, weights = item(self._meshes, node["mesh"]), node.get("skin"), node.get("weights")
        if skin is not None and not self._jointed[node["mesh"]]:
            self._unjointed.add(index)
            skin = None
        key = (node["mesh"], None if weights is None else tuple(weights), skin, modes)
        if key not in self._shapes:
            parts = [part for part in mesh["primitives"] if part.get("mode", TRIANGLES) in modes]
            self._shapes[key] = self._shape(parts, weights or mesh.get("weights", ()), skin)
        shape = self._shapes[key]
        instances = node.get("extensions", {}).get(INSTANCES)
        if instances is not None:
            if skin is not None:
                raise ValueError("instances of a skinned mesh")
            shape = self._repeated(shape, instances["attributes"])
        name = node.get("name") or mesh.get("name")
        world = self._worlds[index] if skin is None else np.eye(4)
        return SourceNode(name if name and isinstance(name, str) else f"node_{index}", index, world), shape

    def _shape(self, parts: Sequence[Json], weights: Sequence[float], skin: int | None) -> Triangles:
        """The triangles of primitives with the weights of their morph targets, as the joints of a skin bend them."""
        weights = weights if any(weights) else ()
        bones = None if skin is None else self._bones(item(self._header["skins"], skin))
        vertices: list[FloatArray] = [np.empty((0, 3))]
        faces: list[Int64Array] = [np.empty((0, 3), dtype=np.int64)]
        first = 0
        for part in parts:
            if "POSITION" not in part["attributes"]:
                continue  # nothing to show, as the specification says
            points = self._arrays.floats(part["attributes"]["POSITION"])
            for weight, target in zip(weights, part.get("targets", ()), strict=bool(weights) and "targets" in part):
                if weight and "POSITION" in target:
                    points = points + weight * self._arrays.floats(target["POSITION"])
            corners = self._corners(part, len(points))
            if len(corners) and corners.max() >= len(points):
                raise ValueError(f"a face uses vertex {corners.max()}, but there are {len(points)}")
            if bones is not None:
                points = self._skinned(points, part["attributes"], bones)
                if (np.linalg.det(bones[:, :3, :3]) < 0).all():
                    corners = corners[:, ::-1]
            if weights or bones is not None:  # one of several shapes of a mesh
                self._arrays.need(points.nbytes + corners.nbytes)
            vertices.append(points)
            faces.append(corners + first)
            first += len(points)
        return Triangles(np.concatenate(vertices), np.concatenate(faces))

    def _corners(self, part: Json, count: int) -> Int64Array:
        mode = part.get("mode", TRIANGLES)
        if mode in POINTS:
            return np.empty((0, 3), dtype=np.int64)
        corners = self._arrays.integers(part["indices"])[:, 0] if "indices" in part else np.arange(count)
        if mode == TRIANGLES:
            return corners.reshape(-1, 3)
        self._arrays.need(3 * corners.nbytes)
        return strip_triangles(corners) if mode == STRIP else fan_triangles(corners)

    def _bones(self, skin: Json) -> FloatArray:
        """How each joint of a skin moves points ``[J, 4, 4]``."""
        joints = skin["joints"]
        self._arrays.need(2 * self._worlds[0].nbytes * len(joints))
        bones = np.stack([item(self._worlds, joint) for joint in joints])
        if "inverseBindMatrices" not in skin:
            return bones
        inverses = self._arrays.floats(skin["inverseBindMatrices"], "MAT4").reshape(-1, 4, 4)
        return np.asarray(bones @ inverses[: len(joints)].transpose(0, 2, 1))

    def _skinned(self, points: FloatArray, attributes: Json, bones: FloatArray) -> FloatArray:
        """Points as the joints of a skin place them: the mean of what each joint does, by its weight."""
        sets = [name.removeprefix("JOINTS_") for name in sorted(attributes) if name.startswith("JOINTS_")]
        self._arrays.need(2 * bones[0].nbytes * len(points))
        joints = np.concatenate([self._arrays.integers(attributes[f"JOINTS_{one}"], "VEC4") for one in sets], axis=1)
        weights = np.concatenate([self._arrays.floats(attributes[f"WEIGHTS_{one}"], "VEC4") for one in sets], axis=1)
        whole = weights.sum(axis=1)
        weights[whole == 0, 0] = 1.0  # follow the first joint
        weights /= np.where(whole == 0, 1.0, whole)[:, None]
        placed = np.zeros_like(points)
        for joint, weight in zip(joints.T, weights.T, strict=True):
            used = np.flatnonzero(weight)
            moves = bones[joint[used]]
            moved = dots(moves[:, :3, :3], points[used, None, :]) + moves[:, :3, 3]
            placed[used] += weight[used, None] * moved
        return placed

    def _repeated(self, shape: Triangles, attributes: Json) -> Triangles:
        """All instances of a shape within its node."""
        kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
        floats = self._arrays.floats
        (count,) = {self._arrays.accessor(index)["count"] for index in attributes.values()}
        self._instances += count
        if self._instances > MOST_PLACES:
            raise ValueError(f"{self._instances} instances, more than {MOST_PLACES}")
        self._arrays.need(count * (shape.vertices.nbytes + shape.faces.nbytes))
        given = {name: floats(attributes[name], kind) for name, kind in kinds.items() if name in attributes}
        moves = _placements(*(given.get(name, np.array([at])) for name, at in zip(kinds, UNMOVED, strict=True)))
        vertices, faces = [shape.vertices[:0]], [shape.faces[:0]]
        for number, move in enumerate(np.broadcast_to(moves, (count, 4, 4))):
            vertices.append(heights(shape.vertices, move[:3, :3]) + move[:3, 3])
            turned = shape.faces[:, ::-1] if np.linalg.det(move[:3, :3]) < 0 else shape.faces
            faces.append(turned + number * len(shape.vertices))
        return Triangles(np.concatenate(vertices), np.concatenate(faces))


UNMOVED = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0))
"""Translation, rotation and scale of a node that gives none."""


def _worlds(nodes: Sequence[Json]) -> FloatArray:
    """The transform of each node to the coordinates of the scene ``[N, 4, 4]``."""
    parents: list[int | None] = [None] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.get("children", ()):
            if item(parents, child) not in (None, index):
                raise ValueError(f"the node {child} is placed below two others, or inside itself")
            parents[child] = index
    order = [index for index, parent in enumerate(parents) if parent is None]
    for index in order:
        order.extend(dict.fromkeys(nodes[index].get("children", ())))
    if len(order) < len(nodes):
        raise ValueError("a node is placed inside itself")
    worlds = _locals(nodes)
    for index in order:
        if (parent := parents[index]) is not None:
            worlds[index] = worlds[parent] @ worlds[index]
    return worlds


def _locals(nodes: Sequence[Json]) -> FloatArray:
    """The transform of each node to the coordinates of its parent."""
    if not nodes:
        return np.empty((0, 4, 4))
    fields = zip(("translation", "rotation", "scale"), UNMOVED, strict=True)
    placed = _placements(*(np.array([node.get(name, at) for node in nodes], float) for name, at in fields))
    for index, node in enumerate(nodes):
        if "matrix" in node:
            placed[index] = np.array(node["matrix"], float).reshape(4, 4).T
    return placed


def _placements(moves: FloatArray, turns: FloatArray, sizes: FloatArray) -> FloatArray:
    """Transforms ``[N, 4, 4]`` of translations, quaternions ``x, y, z, w`` and scales, one for each, or one for all."""
    if (moves.shape[1:], turns.shape[1:], sizes.shape[1:]) != ((3,), (4,), (3,)):
        raise ValueError("a transform of other numbers than it needs")
    length = np.sqrt((turns * turns).sum(axis=1, keepdims=True))
    x, y, z, w = np.where(length > 0, turns / length, UNMOVED[1]).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    placed = np.tile(np.eye(4), (max(len(moves), len(turns), len(sizes)), 1, 1))
    placed[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * sizes[:, None, :]
    placed[:, :3, 3] = moves
    return placed
