"""Names that game engines understand, in GLB and OBJ: Unreal's ``UCX_`` and Godot's ``-convcolonly``."""

from __future__ import annotations

from collections.abc import Callable

from rlacd.io.write.encode import encode_glb, encode_obj
from rlacd.io.write.model import Model, node_name


def encode_unreal(model: Model, ending: str) -> bytes:
    """``UCX_<mesh>_00``, ``UCX_<mesh>_01``, ... are the hulls of the mesh ``<mesh>``."""
    return _encode(model, ending, lambda name, index: f"UCX_{name}_{index:02d}")


def encode_godot(model: Model, ending: str) -> bytes:
    """Nodes ending in ``-convcolonly`` become convex shapes of a static body and are not drawn."""
    return _encode(model, ending, lambda name, index: f"{name}_{index:03d}-convcolonly")


def _encode(model: Model, ending: str, named: Callable[[str, int], str]) -> bytes:
    name = node_name(model.name)
    names = [named(name, index) for index in range(len(model.hulls))]
    encode = encode_glb if ending == "glb" else encode_obj
    return encode(model.hulls, names, None if model.visual is None else (name, model.visual))
