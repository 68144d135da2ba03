"""Names that game engines understand, in GLB and OBJ: Unreal's ``UCX_`` and Godot's ``-convcolonly``."""

from __future__ import annotations

from collections.abc import Callable

from rlacd.io.write.encode import encode_glb, encode_obj
from rlacd.io.write.model import Model, node_name
from rlacd.solid.primitive import Primitive


def encode_unreal(model: Model, ending: str) -> bytes:
    """``UCX_<mesh>_00``, ``UCX_<mesh>_01``, ... are the hulls of the mesh ``<mesh>``; boxes begin with ``UBX``, spheres
    with ``USP``, capsules with ``UCP``."""
    return _encode(model, ending, lambda name, index: f"{_prefix(model.primitives[index])}_{name}_{index:02d}")


def encode_godot(model: Model, ending: str) -> bytes:
    """Nodes ending in ``-convcolonly`` become convex shapes of a static body and are not drawn."""
    return _encode(model, ending, lambda name, index: f"{name}_{index:03d}-convcolonly")


def _prefix(primitive: Primitive | None) -> str:
    return {"box": "UBX", "sphere": "USP", "capsule": "UCP"}.get("" if primitive is None else primitive.kind, "UCX")


def _encode(model: Model, ending: str, named: Callable[[str, int], str]) -> bytes:
    name = node_name(model.name)
    names = [named(name, index) for index in range(len(model.hulls))]
    encode = encode_glb if ending == "glb" else encode_obj
    return encode(model.hulls, names, None if model.visual is None else (name, model.visual))
