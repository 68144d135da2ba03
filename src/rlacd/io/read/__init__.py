"""Meshes from files: a reader for each format, and maintained parsers behind checks of what a file declares."""

from __future__ import annotations

from importlib import import_module
from typing import Any

CURVED = ("step", "stp", "iges", "igs")
"""The formats that hold surfaces instead of triangles."""

READERS = {
    "obj": "read.obj:read_obj",
    "msh": "read.simple_formats:read_msh",
    "stl": "read.simple_formats:read_stl",
    "ply": "read.ply:read_ply",
    "off": "read.simple_formats:read_off",
    **dict.fromkeys(("glb", "gltf", "vrm"), "read.gltf:read_gltf"),
    **dict.fromkeys(("dae", "zae"), "read.collada:read_collada"),
    "3mf": "read.threemf:read_3mf",
    "fbx": "read.fbx:read_fbx",
    **dict.fromkeys(CURVED, "read.cad:read_cad"),
    "xyz": "read.simple_formats:read_xyz",
    **dict.fromkeys(("usd", "usda", "usdc", "usdz"), "read.usd:read_usd"),
}
"""The formats that are read: by extension, the function that reads it."""


def function_of(place: str) -> Any:
    """A function by its place in ``rlacd.io``, ``read.obj:read_obj``: its module is imported when it is needed."""
    module, name = place.split(":")
    return getattr(import_module(f"rlacd.io.{module}"), name)
