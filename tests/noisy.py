"""Dense, noisy copies of real meshes, made by the script beside them."""

from __future__ import annotations

from pathlib import Path

import trimesh

from tests.scripts import script


def noisy_copy(corpus: Path, name: str) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """The mesh and a copy with some 10,000 faces or more, displaced by 0.001 of half the longest side."""
    mesh = trimesh.load(corpus / name, force="mesh", process=False)
    return mesh, script(corpus / "dense.py").densify(mesh.copy(), 10_000, 0.001)
