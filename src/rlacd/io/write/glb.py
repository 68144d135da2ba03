"""Binary glTF 2.0: solids added to a file, each with a node, a mesh and a material of its own.

trimesh's writer takes a quarter of a millisecond per mesh, which is too long for thousands of hulls after a timeout.
"""

from __future__ import annotations

import base64
import json
import struct
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rlacd.io.read.contents import Triangles
from rlacd.io.read.open_file import BINARY_CHUNK, JSON_CHUNK, MAGIC

ROUGHNESS = 0.8


class Placed(NamedTuple):
    """A solid and where it stands."""

    name: str
    """Of the node, the mesh and the material."""
    mesh: Triangles
    """Its vertices are rounded to float32."""
    shift: npt.NDArray[np.float64]
    """``[3]``, the translation of the node."""
    color: npt.NDArray[np.float64]
    """``[3]``, linear light in [0, 1]."""


class GltfFile:
    """A file that is being added to; no index that it holds changes.

    Parameters
    ----------
    header : dict
        Its JSON, changed in place.
    rest : bytes, optional
        What follows the JSON in a binary file.
    """

    def __init__(self, header: dict[str, Any], rest: bytes | None = None) -> None:
        self.header = header
        self.binary, self._others = _chunks(rest)
        self._added: list[bytes] = []
        self._length = 0

    def add(self, placed: Placed, mesh_name: str, parent: int | None = None, colored: bool = True) -> None:
        """Add a solid below a node, or at the top, with a mesh of that name."""
        header = self.header
        nodes, meshes = header.setdefault("nodes", []), header.setdefault("meshes", [])
        accessors = header.setdefault("accessors", [])
        points = np.asarray(placed.mesh.vertices).astype("<f4")
        corners = np.asarray(placed.mesh.faces).astype("<u4").ravel()
        primitive = {"attributes": {"POSITION": len(accessors)}, "indices": len(accessors) + 1, "mode": 4}
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        for array, kind, component, target in (
            (points, "VEC3", 5126, 34962),  # float32, attributes
            (corners, "SCALAR", 5125, 34963),  # uint32, indices
        ):
            view = self.append(array.tobytes(), target)
            described = {"bufferView": view, "componentType": component, "count": len(array), "type": kind}
            accessors.append(described | (bounds if kind == "VEC3" else {}))
        if colored:
            materials = header.setdefault("materials", [])
            primitive["material"] = len(materials)
            looks = {"baseColorFactor": [*placed.color.tolist(), 1.0], "metallicFactor": 0.0}
            materials.append({"name": placed.name, "pbrMetallicRoughness": looks | {"roughnessFactor": ROUGHNESS}})
        node: dict[str, Any] = {"name": placed.name, "mesh": len(meshes)}
        if placed.shift.any():
            node["translation"] = placed.shift.tolist()
        meshes.append({"name": mesh_name, "primitives": [primitive]})
        if parent is not None:
            nodes[parent].setdefault("children", []).append(len(nodes))
        else:
            scenes = header.setdefault("scenes", [{}])
            scenes[header.setdefault("scene", 0)].setdefault("nodes", []).append(len(nodes))
        nodes.append(node)

    def append(self, data: bytes, target: int | None = None) -> int:
        """Add bytes, and return the index of the view of them."""
        buffers, views = self.header.get("buffers", []), self.header.setdefault("bufferViews", [])
        own = self.binary is None and len(buffers) > 0
        start = self._length + (0 if own else len(self.binary or b""))
        self._added.append(data + bytes(-len(data) % 4))
        self._length += len(self._added[-1])
        view = {"buffer": len(buffers) if own else 0, "byteOffset": start, "byteLength": len(data)}
        views.append(view if target is None else view | {"target": target})
        return len(views) - 1

    def encoded(self) -> bytes:
        """The file."""
        buffers, added = self.header.setdefault("buffers", []), b"".join(self._added)
        if self.binary is None and buffers:  # the first buffer is an extension's own: its place is taken
            data = base64.b64encode(added).decode("ascii")
            buffers.append({"byteLength": len(added), "uri": f"data:application/octet-stream;base64,{data}"})
            binary = b""
        else:
            binary = (self.binary or b"") + added
            buffers[:1] = [{**(buffers[0] if buffers else {}), "byteLength": len(binary)}]
        text = json.dumps(self.header, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), JSON_CHUNK) + text
        chunks += (struct.pack("<I4s", len(binary), BINARY_CHUNK) + binary if binary else b"") + self._others
        return struct.pack("<4sII", MAGIC, 2, 12 + len(chunks)) + chunks


def _chunks(rest: bytes | None) -> tuple[bytes | None, bytes]:
    """The binary chunk, if there is one, and all others as they are."""
    if not rest:
        return None, b""
    length, kind = struct.unpack_from("<I4s", rest, 0)
    if kind != BINARY_CHUNK:
        return None, rest
    binary = rest[8 : 8 + length]
    return binary + bytes(-len(binary) % 4), rest[8 + length :]
