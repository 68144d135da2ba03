"""The meshes to learn from: repaired once, kept as arrays, and split into those to learn from and those to judge by."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from manifold3d import Manifold, Mesh64

from rlacd.errors import MeshError
from rlacd.learn.guide.files import load_arrays, save_arrays
from rlacd.solid.load import load_mesh
from rlacd.solid.repair import repair

ENDINGS = frozenset({".ply", ".obj", ".stl", ".off", ".glb", ".gltf"})

HELD_OUT = 24
"""One mesh of so many is held out."""

TOO_MANY_FACES = 3000
"""Repaired meshes with more are left out: the same time labels several smaller ones."""


def mesh_names(folder: Path, max_bytes: int) -> list[str]:
    """List the meshes below a folder that are no larger than `max_bytes`, sorted."""
    return sorted(
        p.relative_to(folder).as_posix()
        for p in folder.rglob("*")
        if p.suffix.lower() in ENDINGS and p.stat().st_size <= max_bytes
    )


def is_held_out(name: str) -> bool:
    """Tell whether a mesh is for judging only; decided by its name alone."""
    return zlib.crc32(name.encode()) % HELD_OUT == 0


def shuffled(names: Sequence[str], seed: int) -> list[str]:
    """Put names in an order that depends on the seed only."""
    order = np.random.default_rng(seed).permutation(len(names))
    return [names[i] for i in order]


def load_solid(folder: Path, name: str, cache: Path) -> Manifold | None:
    """Load and repair a mesh, or take it from the cache; None where it cannot be used (that is cached too)."""
    kept = cache / f"{name}.npz"
    if not kept.exists():
        try:
            mesh = repair(load_mesh(folder / name), threads=1).manifold.to_mesh64()
            vertices, faces = mesh.vert_properties[:, :3], mesh.tri_verts
        except MeshError:
            vertices, faces = np.empty((0, 3)), np.empty((0, 3), np.uint64)
        save_arrays(kept, {"vertices": np.asarray(vertices), "faces": np.asarray(faces)})
    arrays = load_arrays(kept)
    if not 0 < len(arrays["faces"]) <= TOO_MANY_FACES:
        return None
    return Manifold(Mesh64(arrays["vertices"], arrays["faces"]))
