"""glTF and GLB: trees, accessors, buffers, and where their addresses lead."""

from __future__ import annotations

import base64
import json
import os
import struct
from pathlib import Path
from typing import Any

from tests.io.hostile.registry import BOX, REFUSED, harmless, refused


def gltf_tree(**changes: Any) -> dict[str, Any]:
    """A box in one buffer, which is written out as data; `changes` replace parts of it."""
    positions, indices = BOX.vertices.astype("<f4").tobytes(), BOX.faces.astype("<u4").tobytes()
    data = base64.b64encode(positions + indices).decode()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(positions + indices), "uri": f"data:application/octet-stream;base64,{data}"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        **changes,
    }


def gltf(**changes: Any) -> bytes:
    return json.dumps(gltf_tree(**changes)).encode()


def glb(tree: dict[str, Any], *binary: bytes) -> bytes:
    """A GLB file of a tree and a buffer; what else there is follows in a chunk that no reader knows."""
    text = json.dumps(tree).encode()
    chunks = zip((b"JSON", b"BIN\0", b"XTRA"), (text + b" " * (-len(text) % 4), *binary), strict=False)
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def accessors(*changes: dict[str, Any]) -> list[dict[str, Any]]:
    return [{**accessor, **change} for accessor, change in zip(gltf_tree()["accessors"], changes, strict=True)]


@refused("a billion vertices without data.gltf", "decodes to more")
def _() -> bytes:
    nothing = [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]
    return gltf(accessors=nothing, meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}])


refused("a billion vertices in 96 bytes.gltf", "decodes to more")(
    lambda: gltf(accessors=accessors({"count": 10**9}, {}))
)
refused("a count that is no whole number.gltf", "count|damaged")(
    lambda: gltf(accessors=accessors({"count": 1e300}, {}))
)


@refused("rows on top of each other.gltf", "decodes to more")
def _() -> bytes:
    tree = gltf_tree(accessors=accessors({"count": 10**9}, {}))
    tree["bufferViews"][0]["byteStride"] = 1
    return json.dumps(tree).encode()


@refused("a view before its buffer.gltf", "declares|negative")
def _() -> bytes:
    tree = gltf_tree()
    tree["bufferViews"][0]["byteOffset"] = -96
    return json.dumps(tree).encode()


def many(count: int, what: dict[str, Any]) -> list[dict[str, Any]]:
    return [what] * count


@refused("ten thousand primitives of one megabyte.glb", "decodes to more")
def _() -> bytes:
    tree = gltf_tree(bufferViews=[{"buffer": 0, "byteLength": 12 * 10**5}], buffers=[{"byteLength": 12 * 10**5}])
    tree["accessors"] = [{"bufferView": 0, "componentType": 5126, "count": 99_999, "type": "VEC3"}]
    tree["meshes"] = [{"primitives": many(10_000, {"attributes": {"POSITION": 0}})}]
    return glb(tree, b"\0" * 12 * 10**5)


@refused("a mesh placed a hundred thousand times.glb", "triangles")
def _() -> bytes:
    tree = gltf_tree(bufferViews=[{"buffer": 0, "byteLength": 36 * 1000}], buffers=[{"byteLength": 36 * 1000}])
    tree["accessors"] = [{"bufferView": 0, "componentType": 5126, "count": 3000, "type": "VEC3"}]
    tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    tree["nodes"], tree["scenes"] = many(30_000, {"mesh": 0}), [{"nodes": list(range(30_000))}]
    return glb(tree, b"\0" * 36 * 1000)


refused("a million nodes.gltf", "nodes")(
    lambda: gltf(nodes=many(1_000_000, {"mesh": 0}), scenes=[{"nodes": list(range(1_000_000))}])
)
refused("nodes that are their own children.gltf", "itself")(
    lambda: gltf(nodes=[{"children": [1]}, {"children": [2, 0]}, {"mesh": 0, "children": [1]}])
)
harmless("two children each, forty deep.gltf")(
    lambda: gltf(nodes=[*({"children": [i + 1, i + 1]} for i in range(40)), {"mesh": 0}])
)


harmless("meshes in nodes fifty thousand deep.gltf")(
    lambda: gltf(nodes=[*({"children": [i + 1], "mesh": 0} for i in range(49_000)), {"mesh": 0}])
)
refused("brackets a million deep.gltf", "deep")(
    lambda: b'{"asset": {"version": "2.0"}, "extras": ' + b"[" * 10**6 + b"]" * 10**6 + b"}"
)


refused("a chunk of four billion bytes.glb", "cut off|again")(
    lambda: struct.pack("<IIIII", 0x46546C67, 2, 0xFFFFFFFF, 0xFFFFFFF0, 0x4E4F534A) + b'{"asset":{}}'
)
refused("each of a thousand nodes below each.gltf", "references")(
    lambda: gltf(nodes=[{"children": list(range(1000))}] * 999 + [{"mesh": 0}])
)
refused("a million buffers.glb", "buffers")(lambda: glb(gltf_tree(buffers=many(1_000_000, {"uri": "data:;base64,"}))))


@refused("quantized views that only meshopt reads, in a buffer without bytes.gltf", "EXT_meshopt_compression")
def _() -> bytes:
    """As gltfpack and glTF-Transform write them."""
    return gltf(
        extensionsRequired=["EXT_meshopt_compression", "KHR_mesh_quantization"],
        buffers=[{"byteLength": 800, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}],
        accessors=[
            {"bufferView": 0, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True},
            {"bufferView": 0, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
    )


@harmless("a name of a megabyte and ten thousand primitives.gltf")
def _() -> bytes:
    primitives = many(10_000, {"attributes": {"POSITION": 0}, "indices": 1, "mode": 0})
    primitives[-1] = {**primitives[-1], "mode": 4}
    named = {"name": "a" * 10**6, "extras": {str(i): i for i in range(100_000)}, "primitives": primitives}
    return gltf(meshes=[named], nodes=[{"mesh": 0, "name": "b" * 10**6}])


def reference(uri: str) -> bytes:
    return gltf(buffers=[{"byteLength": 240, "uri": uri}])


for style, uri in {
    "by dots": "../secret.bin",
    "by dots in percent": "%2e%2e/secret.bin",
    "by dots in percent twice": "%252e%252e/secret.bin",
    "by dots behind a folder": "a/../../secret.bin",
    "by backslashes": "..\\secret.bin",
    "by an absolute path": "{outside}/secret.bin",
    "by a file address": "file://{outside}/secret.bin",
    "by a file address with dots": "file:../secret.bin",
    "by the web": "http://127.0.0.1:9/secret.bin",
    "by a NUL": "mesh.bin\0../secret.bin",
    "to a device": "/dev/zero",
    "to a device by its folder": "zero.bin",
    "to a pipe": "pipe.bin",
    "to a link": "link.bin",
    "by a folder that is a link": "folder/secret.bin",
    "to a password": "../../../../../../../../etc/passwd",
}.items():

    def _build(folder: Path, uri: str = uri) -> Path:
        """A folder with all kinds of traps; the secret would do as the box's buffer."""
        inside = folder / "inside"
        inside.mkdir()
        positions, indices = BOX.vertices.astype("<f4").tobytes(), BOX.faces.astype("<u4").tobytes()
        (folder / "secret.bin").write_bytes(positions + indices)
        (inside / "a").mkdir()
        (inside / "link.bin").symlink_to(folder / "secret.bin")
        (inside / "folder").symlink_to(folder)
        (inside / "zero.bin").symlink_to("/dev/zero")
        os.mkfifo(inside / "pipe.bin")
        path = inside / "mesh.gltf"
        path.write_bytes(reference(uri.format(outside=folder)))
        return path

    REFUSED[f"a buffer {style}.gltf"] = (_build, "in its folder or below it")


def named_often(folder: Path) -> Path:
    """A box whose buffer, a megabyte of zeros, is named nine thousand times over."""
    (folder / "much.bin").write_bytes(bytes(10**6))
    path = folder / "mesh.gltf"
    path.write_bytes(gltf(buffers=many(9_000, {"byteLength": 10**6, "uri": "much.bin"})))
    return path


def _shadow(folder: Path) -> Path:
    """A damaged file beside one of the name that a parser may fall back to."""
    (folder / "model.gltf").write_bytes(gltf())
    path = folder / "mesh.gltf"
    path.write_bytes(gltf()[:-40])
    return path


REFUSED["a damaged file beside another one.gltf"] = (_shadow, "again")


INSTANCES = "EXT_mesh_gpu_instancing"


@refused("a hundred thousand instances in each of a thousand nodes.gltf", "instances")
def _() -> bytes:
    zeros = {"componentType": 5126, "count": 90_000, "type": "VEC3"}
    instanced = {"mesh": 0, "extensions": {INSTANCES: {"attributes": {"TRANSLATION": 2}}}}
    return gltf(
        accessors=[*gltf_tree()["accessors"], zeros],
        meshes=[{"primitives": [{"attributes": {}}]}],
        nodes=many(1000, instanced),
        scenes=[{"nodes": list(range(1000))}],
    )


@refused("a mesh of a megabyte with five thousand sets of weights.glb", "decodes to more")
def _() -> bytes:
    tree = gltf_tree(bufferViews=[{"buffer": 0, "byteLength": 3 * 10**6}], buffers=[{"byteLength": 3 * 10**6}])
    tree["accessors"] = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
        {"bufferView": 0, "componentType": 5121, "count": 3 * 10**6, "type": "SCALAR"},
    ]
    morphed = {"attributes": {"POSITION": 0}, "indices": 1, "targets": [{"POSITION": 0}]}
    tree["meshes"] = [{"primitives": [morphed]}]
    tree["nodes"] = [{"mesh": 0, "weights": [index + 1]} for index in range(5000)]
    tree["scenes"] = [{"nodes": list(range(5000))}]
    return glb(tree, b"\0" * 3 * 10**6)


@refused("ninety thousand primitives of points in ninety thousand nodes.gltf", "places")
def _() -> bytes:
    count = 90_000
    primitives = many(count, {"attributes": {"POSITION": 0}, "mode": 0})
    return gltf(
        meshes=[{"primitives": primitives}], nodes=many(count, {"mesh": 0}), scenes=[{"nodes": list(range(count))}]
    )


@refused("a skin of a hundred thousand joints on each of a thousand nodes.gltf", "decodes to more|damaged")
def _() -> bytes:
    tree = gltf_tree()
    joints = {"componentType": 5121, "count": 8, "type": "VEC4"}
    tree["accessors"] += [joints, {**joints, "componentType": 5126}]
    (primitive,) = tree["meshes"][0]["primitives"]
    primitive["attributes"] |= {"JOINTS_0": 2, "WEIGHTS_0": 3}
    tree["meshes"] = many(1000, tree["meshes"][0])
    tree["nodes"] = [{"mesh": index, "skin": 0} for index in range(1000)]
    tree["scenes"] = [{"nodes": list(range(1000))}]
    tree["skins"] = [{"joints": [0] * 100_000}]
    return json.dumps(tree).encode()


for ending in ("xaml", "3dxml", "xdmf", "h5", "vtk", "binvox", "dxf"):
    refused(f"another format.{ending}", "convert it")(lambda: b"anything")
refused("another format.zip", "unpack it")(lambda: b"anything")
refused("a node below one whose mesh there is not.gltf", "no index")(
    lambda: gltf(nodes=[{"mesh": -3, "children": [1]}, {"mesh": 0}])
)
refused("a node that is the parent of the scene.gltf", "itself")(
    lambda: gltf(nodes=[{"name": "world", "children": [1]}, {"mesh": 0, "children": [0]}])
)
