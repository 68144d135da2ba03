"""Binary glTF 2.0: a node, a mesh and a material per solid.

trimesh's writer takes a quarter of a millisecond per mesh, which is too long for thousands of hulls after a timeout.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rlacd.io.write.single_precision import Triangles

ROUGHNESS = 0.8

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED_INT = 5126, 5125
ATTRIBUTES, INDICES = 34962, 34963


class Placed(NamedTuple):
    """A solid and where it stands.

    Attributes
    ----------
    name
        Of the node, the mesh and the material.
    mesh
        Its vertices are rounded to float32.
    shift
        ``[3]``, the translation of the node.
    color
        ``[3]``, linear light in [0, 1].
    """

    name: str
    mesh: Triangles
    shift: npt.NDArray[np.float64]
    color: npt.NDArray[np.float64]


def glb(solids: Iterable[Placed], generator: str) -> bytes:
    """Write solids as the bytes of a GLB file, in their order."""
    solids = list(solids)
    (positions, indices), accessors = packed([solid.mesh for solid in solids], 0)
    described = {
        "asset": {"version": "2.0", "generator": generator},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(solids)))}],
        "nodes": [_node(index, solid) for index, solid in enumerate(solids)],
        "meshes": [
            {
                "name": solid.name,
                "primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1, "material": i, "mode": 4}],
            }
            for i, solid in enumerate(solids)
        ],
        "materials": [material(solid) for solid in solids],
        "accessors": accessors,
        "bufferViews": [
            # glTF demands a stride where accessors share a view.
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions), "byteStride": 12, "target": ATTRIBUTES},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices), "target": INDICES},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }
    text = json.dumps(described, separators=(",", ":"), allow_nan=False).encode()
    chunks = chunk(JSON_CHUNK, text + b" " * (-len(text) % 4)) + chunk(BINARY_CHUNK, positions + indices)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def packed(meshes: Sequence[Triangles], first_view: int) -> tuple[tuple[bytes, bytes], list[dict[str, Any]]]:
    """All positions and all indices, and the accessors of each mesh into views of the two."""
    positions = [np.asarray(mesh.vertices).astype("<f4") for mesh in meshes]
    indices = [np.asarray(mesh.faces).astype("<u4") for mesh in meshes]
    accessors: list[dict[str, Any]] = []
    at = [0, 0]
    for points, corners in zip(positions, indices, strict=True):
        where = {"bufferView": first_view, "byteOffset": at[0], "componentType": _FLOAT}
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        accessors.append(where | {"count": len(points), "type": "VEC3"} | bounds)
        where = {"bufferView": first_view + 1, "byteOffset": at[1], "componentType": _UNSIGNED_INT}
        accessors.append(where | {"count": corners.size, "type": "SCALAR"})
        at = [at[0] + points.nbytes, at[1] + corners.nbytes]
    data = b"".join(array.tobytes() for array in positions), b"".join(array.tobytes() for array in indices)
    return data, accessors


def material(solid: Placed) -> dict[str, Any]:
    """The material of a solid, in its colour."""
    return {
        "name": solid.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*solid.color.tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": ROUGHNESS,
        },
    }


def _node(mesh: int, solid: Placed) -> dict[str, Any]:
    node = {"name": solid.name, "mesh": mesh}
    return node | {"translation": solid.shift.tolist()} if solid.shift.any() else node


def chunk(kind: int, content: bytes) -> bytes:
    """A chunk with its header."""
    return struct.pack("<II", len(content), kind) + content
