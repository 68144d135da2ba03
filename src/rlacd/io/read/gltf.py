"""What a glTF file declares, checked against what it holds.

Its JSON may use one array for any number of meshes, take any part of a buffer any number of times, and declare arrays
without any bytes behind them. A parser would allocate memory for all of them, and copy names and everything else
attached to a mesh for each of its primitives. So the parser receives only the triangles and their transforms.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from rlacd.errors import MeshFileError
from rlacd.io.read.limits import MOST_PLACES, most_in_memory

Json: TypeAlias = dict[str, Any]

MAGIC, JSON_CHUNK = b"glTF", b"JSON"

ITEM_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""By component type; see "Accessor Data Types" in the specification."""

ITEMS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

DRACO = "KHR_draco_mesh_compression"
UNREAD = ("EXT_meshopt_compression", "KHR_meshopt_compression")
"""Extensions that encode the triangles: without the decoder, the file holds zeros in their place. Draco is decoded
before (`gltf_encoded.py`), so that its name is gone."""

INSTANCES = "EXT_mesh_gpu_instancing"

HARMLESS = re.compile(
    r"(KHR|EXT|MSFT)_(materials|texture|lights|xmp|animation)_\w+|KHR_(mesh_quantization|xmp|draco_mesh_compression)"
    r"|EXT_(mesh_features|instance_features|structural_metadata)|VRM\w*"
)
"""Extensions that leave the triangles as they are, or that are decoded before."""

KEPT = {
    "buffers": ("byteLength", "uri"),
    "bufferViews": ("buffer", "byteOffset", "byteLength", "byteStride"),
    "accessors": ("bufferView", "byteOffset", "componentType", "count", "type"),
    "nodes": ("children", "mesh", "matrix", "translation", "rotation", "scale"),
    "scenes": ("nodes",),
}
"""The fields that determine the triangles and their transforms, besides the meshes."""

UNREADABLE = "cannot be read as glTF: it is damaged or cut off"


def plain_gltf(path: Path, content: bytes, beside: Callable[[str], bytes]) -> bytes:
    """Return a glTF file with the same triangles and nothing else; refuse one that declares more than it holds.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    content : bytes
        Its content, JSON or binary (GLB).
    beside : callable
        Returns the content of a file that a buffer names.

    Raises
    ------
    MeshFileError
        It declares more than it holds, or more than is reasonable.
    FileNotFoundError
        Raised by `beside`.
    """
    header, rest = split(path, content)
    try:
        plain = _plain(path, header)
        _check(path, plain, _bytes_given(path, plain, len(content), beside))
    except (TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        raise damaged(path, error) from error
    return joined(plain, rest)


def damaged(path: Path, error: Exception) -> MeshFileError:
    """Build the error for a file whose parts are missing or of the wrong type, as an exception tells."""
    return MeshFileError(f"{path} {UNREADABLE} ({type(error).__name__}: {error!s:.100}); export it again")


def joined(header: Json, rest: bytes | None) -> bytes:
    """Put together what `split` took apart."""
    text = json.dumps(header).encode()
    if rest is None:
        return text
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII4s", MAGIC, 2, 20 + len(text) + len(rest), len(text), JSON_CHUNK)
    return b"".join((head, text, rest))


def node_names(path: Path, content: bytes) -> list[str]:
    """Name every node of a glTF file: as it is called, like its mesh, or by its index."""
    header, _ = split(path, content)
    meshes = header.get("meshes", [])

    def named(index: int, node: Json) -> str:
        own = node.get("name")
        mesh = node.get("mesh")
        if not own and isinstance(mesh, int) and 0 <= mesh < len(meshes):
            own = meshes[mesh].get("name")
        return own if own and isinstance(own, str) else f"node_{index}"

    return [named(index, node) for index, node in enumerate(header.get("nodes", []))]


def split(path: Path, content: bytes) -> tuple[Json, bytes | None]:
    """Split a file into its JSON and, if it is binary, the bytes that follow."""
    text, rest = content, None
    if content.startswith(MAGIC):
        if len(content) < 20 or content[16:20] != JSON_CHUNK:
            raise MeshFileError(f"{path} {UNREADABLE}; export it again")
        length, chunk = struct.unpack_from("<II", content, 8)
        if max(length, 20 + chunk) > len(content):
            raise MeshFileError(f"{path} is cut off: its header declares {length} bytes; export it again")
        if content[4:8] != b"\2\0\0\0":
            raise MeshFileError(f"{path} is of another version than glTF 2: convert it to glb, obj, stl or ply")
        text, rest = content[20 : 20 + chunk], content[20 + chunk :]
    try:
        header = json.loads(text.decode())
    except RecursionError as error:
        raise MeshFileError(f"{path} nests its JSON too deeply: no exporter writes such files") from error
    except ValueError as error:
        raise MeshFileError(f"{path} {UNREADABLE} ({error}); export it again") from error
    if not isinstance(header, dict):
        raise MeshFileError(f"{path} {UNREADABLE}; export it again")
    return header, rest


def unread_in(path: Path, content: bytes) -> list[str]:
    """A sentence for each kind of content that is not read: lines, points, poses, instances, morphs."""
    header, _ = split(path, content)
    nodes, meshes = header.get("nodes", []), header.get("meshes", [])
    modes = [primitive.get("mode", 4) for mesh in meshes for primitive in mesh["primitives"]]
    skinned = sum(1 for node in nodes if "skin" in node and "mesh" in node)
    instanced = sum(1 for node in nodes if INSTANCES in node.get("extensions", {}))
    morphed = sum(1 for holder in (*meshes, *nodes) if any(holder.get("weights", ())))
    said = {
        "primitives are points or lines, and were left out": sum(1 for mode in modes if mode in (0, 1, 2, 3)),
        "skinned meshes were placed by their nodes, not by their joints": skinned,
        f"nodes have instances by {INSTANCES}, which were left out": instanced,
        "morph weights were left out, so that those meshes have their basic shape": morphed,
    }
    return [f"{count} {what}" for what, count in said.items() if count]


def refuse_hidden(path: Path, header: Json, extensions: Sequence[str] = UNREAD) -> None:
    """Refuse a file that requires one of these extensions to find its triangles."""
    for name in extensions:
        if name in header.get("extensionsRequired", []):
            raise MeshFileError(
                f"{path} hides its triangles by {name}, which is not read: export it again without that compression, "
                "or run  npx @gltf-transform/cli copy IN.glb OUT.glb"
            )


def _plain(path: Path, header: Json) -> Json:
    refuse_hidden(path, header, (*UNREAD, DRACO))
    for name in header.get("extensionsRequired", []):
        if HARMLESS.fullmatch(str(name)) is None:
            raise MeshFileError(f"{path} requires the extension {name!r:.60}, which is not read: export it without it")
    plain: Json = {key: header[key] for key in ("scene",) if key in header}
    plain["asset"] = {"version": header.get("asset", {}).get("version", "2.0")}
    for key, fields in KEPT.items():
        if key in header:
            plain[key] = [_only(item, fields) for item in header[key]]
    plain["meshes"] = [
        {"primitives": [_plain_primitive(primitive) for primitive in mesh["primitives"]]}
        for mesh in header.get("meshes", [])
    ]
    return plain


def _plain_primitive(primitive: Json) -> Json:
    return {**_only(primitive, ("indices", "mode")), "attributes": _only(primitive["attributes"], ("POSITION",))}


def _only(item: Json, fields: tuple[str, ...]) -> Json:
    if not isinstance(item, dict):  # the fields' names may be in a string, too
        raise TypeError(f"{item!s:.40} is no object")
    return {field: item[field] for field in fields if field in item}


def _bytes_given(path: Path, header: Json, own: int, beside: Callable[[str], bytes]) -> int:
    """Count the bytes of the file and of the files its buffers name."""
    buffers = header.get("buffers", [])
    if len(buffers) > MOST_PLACES:
        raise MeshFileError(
            f"{path} has {len(buffers)} buffers, more than {MOST_PLACES}: export it again with a single buffer"
        )
    named = {buffer["uri"] for buffer in buffers if "base64," not in buffer.get("uri", "base64,")}
    return own + sum(len(beside(name)) for name in sorted(named))


def _check(path: Path, header: Json, given: int) -> None:
    primitives = [primitive for mesh in header["meshes"] for primitive in mesh["primitives"]]
    nodes = header.get("nodes", [])
    edges = sum(len(node.get("children", [])) for node in nodes)
    edges += sum(len(scene.get("nodes", [])) for scene in header.get("scenes", []))
    counts = {"nodes": len(nodes), "references to nodes": edges, "primitives": len(primitives)}
    for what, count in counts.items():
        if count > MOST_PLACES:
            raise MeshFileError(f"{path} has {count} {what}, more than {MOST_PLACES}: join its meshes first")
    views = header.get("bufferViews", [])
    accessors = [_Accessor(path, accessor, views) for accessor in header.get("accessors", [])]
    asked = sum(_natural(path, view.get("byteLength", 0), "byteLength") for view in views)
    asked += sum(accessor.bytes for accessor in accessors)
    asked += sum(accessors[index].as_loaded for primitive in primitives for index in _used(primitive))
    if asked > most_in_memory(given):
        raise MeshFileError(
            f"{path} asks for {asked} bytes, though it holds {given}: export it again, with one buffer view per array"
        )


class _Accessor:
    """The size of an array: ``bytes`` in the file, and ``as_loaded`` in a mesh, with eight bytes per number."""

    def __init__(self, path: Path, accessor: Json, views: list[Json]) -> None:
        count = _natural(path, accessor["count"], "count")
        row = ITEM_BYTES[accessor["componentType"]] * ITEMS[accessor["type"]]
        self.bytes = count * row
        self.as_loaded = 8 * count * ITEMS[accessor["type"]]
        if "bufferView" not in accessor:
            return  # zeros, or data of an extension
        view = views[_natural(path, accessor["bufferView"], "bufferView")]
        start = _natural(path, accessor.get("byteOffset", 0), "byteOffset")
        _natural(path, view.get("byteOffset", 0), "byteOffset")
        stride = _natural(path, view.get("byteStride", row), "byteStride")
        length = start + (count - 1) * stride + row if count else 0
        if stride < row or length > view["byteLength"]:
            raise MeshFileError(f"{path} declares {count} rows but has no room for them; export it again")


def _used(primitive: Json) -> Iterator[int]:
    """Yield the accessors of a primitive."""
    yield from primitive["attributes"].values()
    if "indices" in primitive:
        yield primitive["indices"]


def _natural(path: Path, number: Any, what: str) -> int:
    if not isinstance(number, int) or number < 0:
        raise MeshFileError(
            f"{path} has {number!r:.40} as a {what}, which cannot be negative or fractional; export it again"
        )
    return number
