"""Mesh files made to harm whoever opens them, and what is to be said of each."""

from __future__ import annotations

import base64
import bz2
import io
import json
import os
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from trimesh import creation

Build = Callable[[Path], Path]

REFUSED: dict[str, tuple[Build, str]] = {}
"""Files that have to be refused, and words of the sentence that says why."""

HARMLESS: dict[str, Build] = {}
"""Files that look bad but give a box."""

BOX = creation.box()


def refused(name: str, says: str) -> Callable[[Callable[[], bytes]], Callable[[], bytes]]:
    """Register what makes the content of a file; its ending is the last part of `name`."""

    def register(content: Callable[[], bytes]) -> Callable[[], bytes]:
        REFUSED[name] = (_writer(name, content), says)
        return content

    return register


def harmless(name: str) -> Callable[[Callable[[], bytes]], Callable[[], bytes]]:
    def register(content: Callable[[], bytes]) -> Callable[[], bytes]:
        HARMLESS[name] = _writer(name, content)
        return content

    return register


def _writer(name: str, content: Callable[[], bytes]) -> Build:
    def write(folder: Path) -> Path:
        path = folder / f"mesh.{name.rpartition('.')[2]}"
        path.write_bytes(content())
        return path

    return write


# --- counts that a header promises ------------------------------------------------------------------------------------

PLY = "ply\nformat {kind} 1.0\n{elements}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list {count} int vertex_indices\n"


def ply(elements: str, body: bytes = b"\1" * 1000, kind: str = "binary_little_endian") -> bytes:
    return PLY.format(kind=kind, elements=elements).encode() + body


@refused("a trillion vertices.ply", "unexpected length")
def _() -> bytes:
    return ply(f"element vertex {10**12}\n{XYZ}element face 1\n{LIST.format(count='uchar')}")


@refused("thirty thousand lists.ply", "header")
def _() -> bytes:
    lists = "".join(f"property list uchar int a{i}\n" for i in range(30_000))
    return ply(f"element vertex 3\n{XYZ}element face 1\n{lists}", bytes(40_000))


@refused("a trillion vertices in text.ply", "promises")
def _() -> bytes:
    return ply(f"element vertex {10**12}\n{XYZ}", b"0 0 0\n1 0 0\n0 1 0\n", "ascii")


@refused("counts that add up by a negative one.ply", "where a count belongs|negative")
def _() -> bytes:
    elements = f"element vertex {10**9}\n{XYZ}element face {-(10**9) + 50}\nproperty float a\n" + XYZ.replace("x", "b")
    return ply(elements.replace("property float b\n", "property int b\n"))


@refused("a face of two billion corners.ply", "again|promises")
def _() -> bytes:
    body = np.zeros(9, "<f4").tobytes() + struct.pack("<i", 2 * 10**9) + b"\0" * 100
    return ply(f"element vertex 3\n{XYZ}element face 1\n{LIST.format(count='int')}", body)


@refused("faces without corners, a billion of them.ply", "promises|again")
def _() -> bytes:
    return ply(f"element vertex 3\n{XYZ}element face {10**9}\n{LIST.format(count='uchar')}", b"\0" * 5000)


@refused("a billion things of no size.ply", "promises|again")
def _() -> bytes:
    return ply(f"element vertex 3\n{XYZ}element nothing {10**9}\n", b"\0" * 36)


@refused("ten million empty lines of FORMAT  ASCII.ply", "lines")
def _() -> bytes:
    return ply(f"element vertex {10**7}\n{XYZ}", b"\n" * 10**7, " ASCII")


@refused("ten million empty lines.ply", "lines")
def _() -> bytes:
    return ply(f"element vertex {10**7}\n{XYZ}", b"\n" * 10**7, "ascii")


@refused("four billion triangles.stl", "promises 4294967295 triangles")
def _() -> bytes:
    return b"\0" * 80 + b"\xff" * 4 + b"\0" * 500


@refused("a trillion vertices.off", "promises")
def _() -> bytes:
    return f"OFF\n{10**12} {10**12} 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".encode()


@refused("counts below zero.off", "again|no points")
def _() -> bytes:
    return b"OFF\n-3 -1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@refused("counts with a billion digits, nearly.off", "again")
def _() -> bytes:
    return b"OFF\n" + b"9" * 10**6 + b" 1 0\n0 0 0\n"


@refused("a trillion vertices with normals, colours and texture coordinates.off", "promises")
def _() -> bytes:
    return f"STCNOFF {10**12} 0 0\n0 0 0 0 0 1 1 1 1 1 0 0\n".encode()


@refused("a space of a billion dimensions.off", "dimensions")
def _() -> bytes:
    return f"nOFF {10**9}\n1 0 0\n{'0 ' * 1000}\n".encode()


@refused("a binary file of four billion vertices.off", "binary")
def _() -> bytes:
    return b"OFF BINARY\n" + b"\xff" * 4000


@refused("a comment of ten million characters, and nothing else.off", "holds|empty")
def _() -> bytes:
    return b"#" * 10**7


@refused("a face of vertex 10^12.obj", "vertex|again")
def _() -> bytes:
    return f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {10**12}\n".encode()


@refused("a face of vertex -10^12, with a texture.obj", "vertex|again")
def _() -> bytes:
    return f"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 {-(10**12)}/1\n".encode()


@refused("a face of a vertex with a million digits.obj", "vertex|again|digits")
def _() -> bytes:
    return b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 " + b"9" * 10**6 + b"\nf 1 2 3 1\n"


@refused("only numbers that are too large.obj", "NaN or infinite")
def _() -> bytes:
    return b"v 1e999999 0 0\nv 1 -1e999999 0\nv 0 nan 1e999999\nf 1 2 3\n"


# --- text that costs more than its length -----------------------------------------------------------------------------


@harmless("a hundred thousand bodies of one name.stl")
def _() -> bytes:
    corners = "".join(
        f"facet normal 0 0 0\nouter loop\n{''.join(f'vertex {x} {y} {z}' + chr(10) for x, y, z in triangle)}endloop\n"
        "endfacet\nendsolid a\nsolid a\n"
        for triangle in BOX.triangles
    )
    return b"solid a\n" + b"endsolid a\nsolid a\n" * 100_000 + corners.encode() + b"endsolid a\n"


@harmless("ten thousand bodies that end and begin in one line.stl")
def _() -> bytes:
    corners = "".join(
        "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle) + "endsolid solid a\n" for triangle in BOX.triangles
    )
    return ("solid a\n" + corners * 1000 + "endsolid\n").encode()


@harmless("a hundred thousand materials.obj")
def _() -> bytes:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
    faces = ["f {} {} {}\n".format(*(face + 1)) for face in BOX.faces]
    used = "".join(f"usemtl m{i}\n{faces[i % 12]}" for i in range(100_000))
    return (vertices + "vn 0 0 1\n" * 50_000 + "v 0 0 0\n" * 50_000 + used).encode()


@harmless("references out of the folder.obj")
def _() -> bytes:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in BOX.vertices)
    faces = "".join("f {} {} {}\n".format(*(face + 1)) for face in BOX.faces)
    libraries = "".join(f"mtllib {name}\n" for name in ("../../../../etc/passwd", "/dev/zero", "file:///dev/zero"))
    return (libraries + vertices + "usemtl evil\n" + faces).encode()


@refused("a line of ten million digits.obj", "again|NaN or infinite|vertex")
def _() -> bytes:
    return b"v " + b"1" * 10**7 + b" 0 0\nf 1 1 1\n"


@refused("ten million zeros.xyz", "again|empty")
def _() -> bytes:
    return b"\0" * 10**7 + b"x"


# --- glTF -------------------------------------------------------------------------------------------------------------


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


def glb(tree: dict[str, Any], binary: bytes = b"") -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def accessors(*changes: dict[str, Any]) -> list[dict[str, Any]]:
    return [{**accessor, **change} for accessor, change in zip(gltf_tree()["accessors"], changes, strict=True)]


@refused("a billion vertices without data.gltf", "asks for")
def _() -> bytes:
    nothing = [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]
    return gltf(accessors=nothing, meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}])


@refused("a billion vertices in 96 bytes.gltf", "promises")
def _() -> bytes:
    return gltf(accessors=accessors({"count": 10**9}, {}))


@refused("a count below zero.gltf", "promises|negative")
def _() -> bytes:
    return gltf(accessors=accessors({"count": -1}, {}))


@refused("a count that is no whole number.gltf", "count|damaged")
def _() -> bytes:
    return gltf(accessors=accessors({"count": 1e300}, {}))


@refused("rows on top of each other.gltf", "promises|stride")
def _() -> bytes:
    tree = gltf_tree(accessors=accessors({"count": 10**9}, {}))
    tree["bufferViews"][0]["byteStride"] = 1
    return json.dumps(tree).encode()


@refused("a stride below zero.gltf", "promises|stride|negative")
def _() -> bytes:
    tree = gltf_tree()
    tree["bufferViews"][0]["byteStride"] = -(10**9)
    return json.dumps(tree).encode()


@refused("a view before its buffer.gltf", "promises|negative")
def _() -> bytes:
    tree = gltf_tree()
    tree["bufferViews"][0]["byteOffset"] = -96
    return json.dumps(tree).encode()


def many(count: int, what: dict[str, Any]) -> list[dict[str, Any]]:
    return [what] * count


@refused("a hundred thousand views of one megabyte.glb", "asks for")
def _() -> bytes:
    tree = gltf_tree(
        bufferViews=many(99_000, {"buffer": 0, "byteOffset": 4, "byteLength": 10**6 - 4}),
        buffers=[{"byteLength": 10**6}],
    )
    return glb(tree, b"\0" * 10**6)


@refused("ten thousand accessors of one megabyte.glb", "asks for")
def _() -> bytes:
    tree = gltf_tree(bufferViews=[{"buffer": 0, "byteLength": 12 * 10**5}], buffers=[{"byteLength": 12 * 10**5}])
    few = {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 99_999, "type": "VEC3"}
    tree["accessors"] = many(10_000, few)
    return glb(tree, b"\0" * 12 * 10**5)


@refused("ten thousand primitives of one megabyte.glb", "asks for")
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


@refused("a million nodes.gltf", "nodes")
def _() -> bytes:
    return gltf(nodes=many(1_000_000, {"mesh": 0}), scenes=[{"nodes": list(range(1_000_000))}])


@refused("nodes that are their own children.gltf", "itself")
def _() -> bytes:
    return gltf(nodes=[{"children": [1]}, {"children": [2, 0]}, {"mesh": 0, "children": [1]}])


@refused("a node among its own children.gltf", "itself")
def _() -> bytes:
    return gltf(nodes=[{"mesh": 0, "children": [0]}])


@harmless("two children each, forty deep.gltf")
def _() -> bytes:
    return gltf(nodes=[*({"children": [i + 1, i + 1]} for i in range(40)), {"mesh": 0}])


@harmless("nodes twenty thousand deep.gltf")
def _() -> bytes:
    count = 20_000
    return gltf(nodes=[*({"children": [i + 1]} for i in range(count)), {"mesh": 0}])


@harmless("meshes in nodes fifty thousand deep.gltf")
def _() -> bytes:
    return gltf(nodes=[*({"children": [i + 1], "mesh": 0} for i in range(49_000)), {"mesh": 0}])


@refused("brackets a million deep.gltf", "deep")
def _() -> bytes:
    return b'{"asset": {"version": "2.0"}, "extras": ' + b"[" * 10**6 + b"]" * 10**6 + b"}"


@refused("brackets a million deep.glb", "deep")
def _() -> bytes:
    text = b'{"asset": {"version": "2.0"}, "extras": ' + b"[" * 10**6 + b"]" * 10**6 + b"}"
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunk)) + chunk


@refused("a chunk of four billion bytes.glb", "cut off|again")
def _() -> bytes:
    return struct.pack("<IIIII", 0x46546C67, 2, 0xFFFFFFFF, 0xFFFFFFF0, 0x4E4F534A) + b'{"asset":{}}'


@refused("each of a thousand nodes below each.gltf", "references")
def _() -> bytes:
    return gltf(nodes=[{"children": list(range(1000))}] * 999 + [{"mesh": 0}])


@refused("a million buffers.glb", "buffers")
def _() -> bytes:
    return glb(gltf_tree(buffers=many(1_000_000, {"uri": "data:;base64,"})))


@refused("meshes that only Draco reads.gltf", "KHR_draco_mesh_compression")
def _() -> bytes:
    return gltf(extensionsRequired=["KHR_draco_mesh_compression"])


@refused("views that only meshopt reads.gltf", "EXT_meshopt_compression")
def _() -> bytes:
    return gltf(extensionsRequired=["EXT_meshopt_compression"])


@harmless("a name of a megabyte and ten thousand primitives.gltf")
def _() -> bytes:
    primitives = many(10_000, {"attributes": {"POSITION": 0}, "indices": 1, "mode": 0})
    primitives[-1] = {**primitives[-1], "mode": 4}
    named = {"name": "a" * 10**6, "extras": {str(i): i for i in range(100_000)}, "primitives": primitives}
    return gltf(meshes=[named], nodes=[{"mesh": 0, "name": "b" * 10**6}])


@refused("numbers where lists belong.gltf", "damaged")
def _() -> bytes:
    return gltf(accessors=7, meshes={"a": 3})


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

    REFUSED[f"a buffer {style}.gltf"] = (_build, "beside the mesh")


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


# --- archives ---------------------------------------------------------------------------------------------------------

MODEL = (
    '<?xml version="1.0"?>{doctype}<model unit="millimeter" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    "<resources>{objects}</resources><build>{items}</build></model>"
)
MESH = (
    "<mesh><vertices>"
    + "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in BOX.vertices)
    + "</vertices><triangles>"
    + "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in BOX.faces)
    + "</triangles></mesh>"
)


def model(
    objects: str = f'<object id="1">{MESH}</object>', items: str = '<item objectid="1"/>', doctype: str = ""
) -> str:
    return MODEL.format(objects=objects, items=items, doctype=doctype)


def zipped(members: dict[str, bytes | str], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def threemf(text: str, **more: bytes | str) -> bytes:
    return zipped({"3D/3dmodel.model": text, **more})


@refused("a gigabyte of spaces.3mf", "unpacks to")
def _() -> bytes:
    spaces = b" " * 2**20
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("3D/3dmodel.model", "w", force_zip64=True) as member,
    ):
        for _ in range(1024):
            member.write(spaces)
    return file.getvalue()


@refused("a gigabyte in a picture.3mf", "unpacks to")
def _() -> bytes:
    return threemf(model(), **{f"Metadata/{i}.png": bytes(2**26) for i in range(16)})


@refused("a short member that bzip2 knows to be long.3mf", "bzip2|compressed in a way")
def _() -> bytes:
    content = zipped({"3D/3dmodel.model": model(), "a.png": bz2.compress(bytes(2**29))}, zipfile.ZIP_STORED)
    return _relabelled(content, b"a.png", zipfile.ZIP_BZIP2)


def _relabelled(content: bytes, name: bytes, kind: int) -> bytes:
    """Make a stored member say that it was compressed, and holds as many bytes as it takes."""
    changed = bytearray(content)
    for signature, at in ((b"PK\x03\x04", 30), (b"PK\x01\x02", 46)):
        start = -1
        while (start := content.find(signature, start + 1)) >= 0:
            if content[start + at : start + at + len(name)] == name:
                struct.pack_into("<H", changed, start + (8 if at == 30 else 10), kind)
    return bytes(changed)


@refused("a hundred thousand members.3mf", "members")
def _() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for i in range(100_000):
            archive.writestr(zipfile.ZipInfo(str(i)), b"")
    return file.getvalue()


@refused("an archive in an archive.3mf", "again")
def _() -> bytes:
    return zipped({"inner.3mf": threemf(model())})


@refused("parts of parts, forty times two.3mf", "triangles|places")
def _() -> bytes:
    doubled = "".join(
        f'<object id="{i + 1}"><components><component objectid="{i}"/><component objectid="{i}"/></components></object>'
        for i in range(1, 41)
    )
    return threemf(model(f'<object id="1">{MESH}</object>{doubled}', '<item objectid="41"/>'))


@refused("a part of itself.3mf", "itself")
def _() -> bytes:
    ring = '<object id="2"><components><component objectid="3"/></components></object>'
    ring += '<object id="3"><components><component objectid="2"/><component objectid="1"/></components></object>'
    return threemf(model(f'<object id="1">{MESH}</object>{ring}', '<item objectid="2"/>'))


@refused("parts ten thousand deep.3mf", "deep")
def _() -> bytes:
    chain = "".join(
        f'<object id="{i + 1}"><components><component objectid="{i}"/></components></object>' for i in range(1, 10_000)
    )
    return threemf(model(f'<object id="1">{MESH}</object>{chain}', '<item objectid="10000"/>'))


@refused("a million items.3mf", "places|unpacks to")
def _() -> bytes:
    return threemf(model(items='<item objectid="1"/>' * 1_000_000))


@refused("fifty thousand items.3mf", "places")
def _() -> bytes:
    return threemf(model(items='<item objectid="1"/>' * 50_000))


@refused("a name of a megabyte.3mf", "name of 1000000")
def _() -> bytes:
    named = f'<object id="1" name="{"a" * 10**6}">{MESH}</object>'
    return threemf(model(named, '<item objectid="1"/>' * 5000))


@refused("a member that is read ten thousand times.3mf", "places|amounts to|triangles")
def _() -> bytes:
    parts = '<component objectid="1" path="/3D/a.model"/>' * 10_000
    other = model(items="").replace(MESH, MESH * 100)
    return threemf(
        model(f'<object id="2"><components>{parts}</components></object>', '<item objectid="2"/>'),
        **{"3D/a.model": other},
    )


# --- XML --------------------------------------------------------------------------------------------------------------

LAUGHS = "<!DOCTYPE a [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{i + 1} '{f'&a{i};' * 10}'>" for i in range(12)) + "]>"
QUADRATIC = f"<!DOCTYPE a [<!ENTITY a '{'1 ' * 100_000}'>]>"
EXTERNAL = "<!DOCTYPE a [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>"
OUTSIDE = "<!DOCTYPE a SYSTEM 'file:///dev/zero'>"
PARAMETER = "<!DOCTYPE a [<!ENTITY % b SYSTEM 'file:///dev/zero'> %b;]>"

COLLADA = (
    '<?xml version="1.0" encoding="utf-8"?>{doctype}'
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
    '<asset><unit meter="1"/></asset>'
    '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">{numbers}</float_array>'
    '<technique_common><accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{faces}</mesh></geometry></library_geometries>'
    "<library_nodes>{nodes}</library_nodes>"
    '<library_visual_scenes><visual_scene id="s">{scene}</visual_scene></library_visual_scenes>'
    '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
)
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
INDICES = " ".join(str(i) for i in BOX.faces.ravel())


def collada(**parts: str) -> bytes:
    text = {
        "doctype": "",
        "numbers": " ".join(str(x) for x in BOX.vertices.ravel()),
        "faces": f'<triangles count="12">{INPUT}<p>{INDICES}</p></triangles>',
        "nodes": "",
        "scene": '<node id="n"><instance_geometry url="#g"/></node>',
    }
    return COLLADA.format(**{**text, **parts}).encode()


@harmless("a box.dae")
def _() -> bytes:
    return collada()


@harmless("a box that includes what it must not.dae")
def _() -> bytes:
    include = (
        '<extra xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="file:///dev/zero" parse="text"/></extra>'
    )
    return collada(scene=f'<node id="n"><instance_geometry url="#g"/></node>{include}')


for kind, (doctype, entity) in {
    "a billion laughs": (LAUGHS, "&a12;"),
    "an entity used a hundred thousand times": (QUADRATIC, "&a;" * 100_000),
    "a file as an entity": (EXTERNAL, "&a;"),
    "a document type that is a device": (OUTSIDE, ""),
    "a device as a parameter": (PARAMETER, ""),
}.items():

    def _dae(doctype: str = doctype, entity: str = entity) -> bytes:
        return collada(doctype=doctype, numbers=entity)

    def _dae16(doctype: str = doctype, entity: str = entity) -> bytes:
        text = collada(doctype=doctype, numbers=entity).decode().replace("utf-8", "utf-16")
        return text.encode("utf-16")

    def _3mf(doctype: str = doctype, entity: str = entity) -> bytes:
        return threemf(model(doctype=doctype, items=f'<item objectid="1"/>{entity}'))

    def _attribute(doctype: str = doctype, entity: str = entity) -> bytes:
        return threemf(model(doctype=doctype, objects=f'<object id="1" name="{entity[:5000]}">{MESH}</object>'))

    refused(f"{kind}.dae", "DOCTYPE")(_dae)
    refused(f"{kind} in UTF-16.dae", "DOCTYPE")(_dae16)
    refused(f"{kind}.3mf", "DOCTYPE")(_3mf)
    refused(f"{kind} in an attribute.3mf", "DOCTYPE")(_attribute)


@refused("elements a hundred thousand deep.dae", "deep|again")
def _() -> bytes:
    return collada(scene="<node>" * 100_000 + "</node>" * 100_000)


@refused("nodes of nodes, forty times two.dae", "triangles|places")
def _() -> bytes:
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>' + "".join(
        f'<node id="n{i + 1}"><instance_node url="#n{i}"/><instance_node url="#n{i}"/></node>' for i in range(40)
    )
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#n40"/></node>')


@refused("nodes of nodes in the worst order.dae", "deep")
def _() -> bytes:
    nodes = "".join(f'<node id="n{i}"><instance_node url="#n{i + 1}"/></node>' for i in range(20_000))
    nodes += '<node id="n20000"><instance_geometry url="#g"/></node>'
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#n0"/></node>')


@refused("a node in itself.dae", "itself")
def _() -> bytes:
    nodes = '<node id="a"><instance_node url="#b"/></node><node id="b"><instance_node url="#a"/></node>'
    return collada(nodes=nodes, scene='<node id="n"><instance_node url="#a"/></node>')


@refused("a name of a megabyte.dae", "name of 1000000")
def _() -> bytes:
    return collada(scene='<node id="n">' + '<instance_geometry url="#g"/>' * 5000 + "</node>").replace(
        b'<geometry id="g">', b'<geometry id="' + b"g" * 10**6 + b'">'
    )


@refused("a million placed boxes.dae", "places")
def _() -> bytes:
    return collada(scene='<node id="n">' + '<instance_geometry url="#g"/>' * 300_000 + "</node>")


@refused("a polygon of two billion corners.dae", "promises")
def _() -> bytes:
    return collada(faces=f'<polylist count="1">{INPUT}<vcount>2000000000</vcount><p>{INDICES}</p></polylist>')


@refused("an offset of two billion.dae", "again|promises|no points")
def _() -> bytes:
    far = INPUT.replace('offset="0"', 'offset="2000000000"')
    return collada(faces=f'<triangles count="12">{far}<p>{INDICES}</p></triangles>')


@refused("an archive behind a mesh.dae", "archive")
def _() -> bytes:
    return collada() + zipped({"bomb.dae": bytes(2**28)})


@refused("a gigabyte of spaces.zae", "unpacks to")
def _() -> bytes:
    return zipped({"mesh.dae": bytes(2**28)})


@refused("a billion laughs.zae", "DOCTYPE")
def _() -> bytes:
    return zipped({"mesh.dae": collada(doctype=LAUGHS, numbers="&a12;")})


@harmless("a box.zae")
def _() -> bytes:
    return zipped({"manifest.xml": "<dae_root>mesh.dae</dae_root>", "mesh.dae": collada()})


# --- formats whose parsers are not trusted ----------------------------------------------------------------------------

for ending in ("xaml", "3dxml", "step", "stp", "xdmf", "h5", "vtk", "msh", "binvox", "zip", "dxf"):
    refused(f"another format.{ending}", "convert it")(lambda: b"anything")


# --- found by fuzz/damaged.py --------------------------------------------------------------------------------


@refused("a node below one whose mesh there is not.gltf", "placed nowhere")
def _() -> bytes:
    return gltf(nodes=[{"mesh": -3, "children": [1]}, {"mesh": 0}])


@refused("a node that is the parent of the scene.gltf", "itself")
def _() -> bytes:
    return gltf(nodes=[{"name": "world", "children": [1]}, {"mesh": 0, "children": [0]}])
