"""Dense, noisy copies of real meshes, made by the script beside them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import trimesh


def noisy_copy(corpus: Path, name: str) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """The mesh and a copy with some 10,000 faces or more, displaced by 0.001 of half the longest side."""
    spec = importlib.util.spec_from_file_location("dense", corpus / "dense.py")
    assert spec is not None
    assert spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    mesh = trimesh.load(corpus / name, force="mesh", process=False)
    return mesh, maker.densify(mesh.copy(), 10_000, 0.001)
