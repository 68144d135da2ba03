"""Names that game engines understand, in GLB and OBJ: Unreal's ``UCX_`` and Godot's ``-convcolonly``."""

from __future__ import annotations

from collections.abc import Callable

from rlacd.io.write.encode import encode_glb, encode_obj
from rlacd.io.write.model import Model, node_name
from rlacd.solid.primitive import Primitive

ENGINE_NAMES: dict[str, Callable[[str, int, Primitive | None], str]] = {
    "unreal": lambda name, index, primitive: f"{_prefix(primitive)}_{name}_{index:02d}",
    "godot": lambda name, index, primitive: f"{name}_{index:03d}-convcolonly",
}
"""Names of hulls. Unreal: ``UCX_<name>_00``, ``UCX_<name>_01``, ... are the hulls of the node or mesh ``<name>``; boxes
begin with ``UBX``, spheres with ``USP``, capsules with ``UCP``. Godot: nodes ending in ``-convcolonly`` become convex
shapes of a static body and are not drawn."""


def _prefix(primitive: Primitive | None) -> str:
    return {"box": "UBX", "sphere": "USP", "capsule": "UCP"}.get("" if primitive is None else primitive.kind, "UCX")


def encode_engine(model: Model, engine: str, ending: str) -> bytes:
    """The input as one grey node, and the hulls named for the engine."""
    name = node_name(model.name)
    names = [ENGINE_NAMES[engine](name, index, primitive) for index, primitive in enumerate(model.primitives)]
    encode = encode_glb if ending == "glb" else encode_obj
    return encode(model.hulls, names, None if model.visual is None else (name, model.visual))
