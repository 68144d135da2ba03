"""Formats whose parsers are not trusted, and what fuzz/damaged.py found."""

from __future__ import annotations

from tests.io.hostile.gltf import gltf
from tests.io.hostile.registry import refused

for ending in ("xaml", "3dxml", "xdmf", "h5", "vtk", "binvox", "dxf"):
    refused(f"another format.{ending}", "convert it")(lambda: b"anything")
refused("another format.zip", "unpack it")(lambda: b"anything")
refused("a node below one whose mesh there is not.gltf", "no index")(
    lambda: gltf(nodes=[{"mesh": -3, "children": [1]}, {"mesh": 0}])
)
refused("a node that is the parent of the scene.gltf", "itself")(
    lambda: gltf(nodes=[{"name": "world", "children": [1]}, {"mesh": 0, "children": [0]}])
)
