"""A start without what is not needed: trimesh imports every library that it can make use of."""

from __future__ import annotations

import sys
from pathlib import Path

NOT_OURS = ("scipy", "shapely", "rtree", "cascadio")
"""Libraries that trimesh uses where they are installed, and rlacd never needs: half of a command's time."""

WITHOUT_GRAPHS = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf")
"""Formats that trimesh reads without networkx and lxml."""


def import_trimesh(mesh: Path) -> None:
    """Import trimesh with what it needs to read a file like this; for commands that end with this mesh."""
    unused = (*NOT_OURS, "networkx", "lxml") if mesh.suffix.lower() in WITHOUT_GRAPHS else NOT_OURS
    hidden = [name for name in unused if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    import trimesh  # noqa: F401

    for name in hidden:
        del sys.modules[name]
