"""A glTF scene with everything that engines use and rlacd does not, built from nothing."""

from __future__ import annotations

import base64
import copy
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tests.io.hostile.gltf import glb

Json = dict[str, Any]


def png() -> bytes:
    """A picture of 2 by 2 pixels."""
    return base64.b64decode(
        "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAEElEQVR4nGM4IQcEJxggFAAcfgQRs56ClAAAAABJRU5ErkJggg=="
    )


class Rig:
    """A cart: a turned and stretched axle with two wheels below it, which share a mesh, and a skinned flag.

    `header` and `binary` are its JSON and its buffer.
    """

    def __init__(self) -> None:
        self.binary = b""
        self.header: Json = {
            "asset": {"version": "2.0", "generator": "a test", "extras": {"kept": [1, 2.5, None, "ä"]}},
            "extensionsUsed": ["KHR_materials_unlit", "EXT_nobody_knows"],
            "extensions": {"EXT_nobody_knows": {"deep": {"nodes": [0, 1]}}},
            "scene": 0,
            "scenes": [{"name": "stage", "nodes": [0, 3], "extras": {"mood": "calm"}}],
            "bufferViews": [],
            "accessors": [],
            "samplers": [{"magFilter": 9728}],
            "textures": [{"source": 0, "sampler": 0}],
            "materials": [
                {
                    "name": "paint",
                    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                    "extensions": {"KHR_materials_unlit": {}},
                }
            ],
        }
        image = self.view(png())
        self.header["images"] = [{"bufferView": image, "mimeType": "image/png", "name": "red and blue"}]
        self.header["meshes"] = [
            self.mesh("axle", trimesh.creation.box((1.0, 0.1, 0.1))),
            self.mesh("wheel", trimesh.creation.cylinder(0.3, 0.1, sections=16)),
            self.mesh("flag", trimesh.creation.box((0.02, 0.4, 0.3)), skinned=True),
        ]
        root = 0.5**0.5
        self.header["nodes"] = [
            {
                "name": "Axle",
                "mesh": 0,
                "rotation": [0, root, 0, root],
                "scale": [2, 1, 1],
                "translation": [0, 0.3, 0],
                "children": [1, 2],
                "extras": {"door": True},
            },
            {"name": "Wheel", "mesh": 1, "translation": [0.5, 0, 0], "scale": [1, 1, -1]},
            {"mesh": 1, "translation": [-0.5, 0, 0]},
            {"name": "Flag pole", "mesh": 2, "skin": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0.8, 0, 1]},
            {"name": "bone", "translation": [0, 0.8, 0]},
        ]
        self.header["scenes"][0]["nodes"].append(4)
        inverse = self.accessor(np.eye(4, dtype="<f4").reshape(1, 16), "MAT4")
        self.header["skins"] = [{"joints": [4], "inverseBindMatrices": inverse, "name": "rig"}]
        times = self.accessor(np.array([0.0, 1.0], dtype="<f4"), "SCALAR", min=[0.0], max=[1.0])
        turns = self.accessor(np.array([[0, 0, 0, 1], [0, 0, root, root]], dtype="<f4"), "VEC4")
        self.header["animations"] = [
            {
                "name": "roll",
                "samplers": [{"input": times, "output": turns, "interpolation": "LINEAR"}],
                "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}],
            }
        ]

    def view(self, data: bytes) -> int:
        at = len(self.binary)
        self.header["bufferViews"].append({"buffer": 0, "byteOffset": at, "byteLength": len(data)})
        self.binary += data + bytes(-len(data) % 4)
        return len(self.header["bufferViews"]) - 1

    def accessor(self, array: np.ndarray[Any, Any], kind: str, component: int = 5126, **more: Any) -> int:
        count = array.size if kind == "SCALAR" else len(array)
        described = {"bufferView": self.view(array.tobytes()), "componentType": component, "count": count, "type": kind}
        self.header["accessors"].append(described | more)
        return len(self.header["accessors"]) - 1

    def mesh(self, name: str, shape: trimesh.Trimesh, *, skinned: bool = False) -> Json:
        points = np.asarray(shape.vertices, dtype="<f4")
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        attributes = {
            "POSITION": self.accessor(points, "VEC3", **bounds),
            "NORMAL": self.accessor(np.asarray(shape.vertex_normals, dtype="<f4"), "VEC3"),
            "TEXCOORD_0": self.accessor(np.ascontiguousarray(points[:, :2]), "VEC2"),
        }
        if skinned:
            attributes["JOINTS_0"] = self.accessor(np.zeros((len(points), 4), dtype="<u2"), "VEC4", 5123)
            weights = np.tile(np.array([1, 0, 0, 0], dtype="<f4"), (len(points), 1))
            attributes["WEIGHTS_0"] = self.accessor(weights, "VEC4")
        indices = self.accessor(np.asarray(shape.faces, dtype="<u4").ravel(), "SCALAR", 5125)
        return {"name": name, "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}

    def glb(self, path: Path) -> Path:
        """Write one binary file, with a chunk at its end that no reader knows."""
        header = {**self.header, "buffers": [{"byteLength": len(self.binary), "name": "all"}]}
        path.write_bytes(glb(header, self.binary, b"unknown!"))
        return path

    def gltf(self, path: Path, *, embedded: bool = False) -> Path:
        """Write JSON, with its buffer and picture in files beside it, or in it."""
        header = copy.deepcopy(self.header)
        data = base64.b64encode(self.binary).decode()
        uri = f"data:application/octet-stream;base64,{data}" if embedded else "the buffer.bin"
        header["buffers"] = [{"byteLength": len(self.binary), "uri": uri}]
        if not embedded:
            (path.parent / "the buffer.bin").write_bytes(self.binary)
            (path.parent / "paint.png").write_bytes(png())
            header["images"] = [{"uri": "paint.png", "name": "red and blue"}]
        path.write_text(json.dumps(header), encoding="utf-8")
        return path


def write_mesh(mesh: trimesh.Trimesh, path: Path) -> Path:
    """Write a mesh in the format that the path ends in; glTF brings its buffers along."""
    if path.suffix == ".gltf":
        for name, content in trimesh.Scene(mesh).export(file_type="gltf").items():
            (path if name == "model.gltf" else path.with_name(name)).write_bytes(content)
    else:
        (trimesh.Scene(mesh) if path.suffix in (".glb", ".3mf") else mesh).export(path)
    return path


def read_glb(path: Path) -> tuple[Json, bytes, list[tuple[bytes, bytes]]]:
    """The JSON of a GLB file, its binary chunk and its other chunks; checks all lengths."""
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    chunks, at = [], 12
    while at < len(content):
        size, kind = struct.unpack_from("<I4s", content, at)
        assert size % 4 == 0
        chunks.append((kind, content[at + 8 : at + 8 + size]))
        at += 8 + size
    assert chunks[0][0] == b"JSON"
    assert chunks[1][0] == b"BIN\0"
    return json.loads(chunks[0][1]), chunks[1][1], chunks[2:]


def view_of(header: Json, binary: bytes, view: int) -> bytes:
    known = header["bufferViews"][view]
    assert known["buffer"] == 0
    assert known["byteOffset"] + known["byteLength"] <= header["buffers"][0]["byteLength"] <= len(binary)
    return binary[known["byteOffset"] :][: known["byteLength"]]


def painted_obj(folder: Path, *names: str) -> Path:
    """Crates side by side as OBJ, each with half its faces of wood, which is a picture, and half in red."""
    lines = ["mtllib crate.mtl", "vt 0 0", "vt 1 0", "vt 1 1"]
    for number, name in enumerate(names or ["crate"]):
        crate = trimesh.creation.box((1, 2, 3)).apply_translation((5 * number, 0, 0))
        lines += [f"o {name}", *("v {:g} {:g} {:g}".format(*point) for point in crate.vertices)]
        for half, paint in enumerate(("wood", "red")):
            faces = crate.faces[half::2] + 1 + 8 * number
            lines += [f"usemtl {paint}", *("f {}/1 {}/2 {}/3".format(*face) for face in faces)]
    path = folder / "crate.obj"
    path.write_text("\n".join(lines) + "\n")
    paints = ["newmtl wood", "Kd 1 1 1", "map_Kd wood.png", "newmtl red", "Kd 1 0 0"]
    (folder / "crate.mtl").write_text("\n".join(paints) + "\n")
    (folder / "wood.png").write_bytes(png())
    return path
