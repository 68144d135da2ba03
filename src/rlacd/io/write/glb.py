"""Binary glTF 2.0: a node, a mesh and a material per solid.

trimesh's writer takes a quarter of a millisecond per mesh, which is too long for thousands of hulls after a timeout.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

ROUGHNESS = 0.8

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED_INT = 5126, 5125
_ATTRIBUTES, _INDICES = 34962, 34963


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
    mesh: trimesh.Trimesh
    shift: npt.NDArray[np.float64]
    color: npt.NDArray[np.float64]


def glb(solids: Iterable[Placed], generator: str) -> bytes:
    """Write solids as the bytes of a GLB file, in their order."""
    solids = list(solids)
    positions = [np.asarray(solid.mesh.vertices).astype("<f4") for solid in solids]
    indices = [np.asarray(solid.mesh.faces).astype("<u4") for solid in solids]
    accessors: list[dict[str, Any]] = []
    at = [0, 0]
    for points, corners in zip(positions, indices, strict=True):
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        accessors += [
            {"bufferView": 0, "byteOffset": at[0], "componentType": _FLOAT, "count": len(points), "type": "VEC3"}
            | bounds,
            {
                "bufferView": 1,
                "byteOffset": at[1],
                "componentType": _UNSIGNED_INT,
                "count": corners.size,
                "type": "SCALAR",
            },
        ]
        at = [at[0] + points.nbytes, at[1] + corners.nbytes]
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
        "materials": [
            {
                "name": solid.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*solid.color.tolist(), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": ROUGHNESS,
                },
            }
            for solid in solids
        ],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": at[0], "target": _ATTRIBUTES},
            {"buffer": 0, "byteOffset": at[0], "byteLength": at[1], "target": _INDICES},
        ],
        "buffers": [{"byteLength": sum(at)}],
    }
    text = json.dumps(described, separators=(",", ":"), allow_nan=False).encode()
    chunks = _chunk(_JSON, text + b" " * (-len(text) % 4)) + _chunk(
        _BINARY, b"".join(array.tobytes() for array in (*positions, *indices))
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _node(mesh: int, solid: Placed) -> dict[str, Any]:
    node = {"name": solid.name, "mesh": mesh}
    return node | {"translation": solid.shift.tolist()} if solid.shift.any() else node


def _chunk(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", len(content), kind) + content
