"""The meshes to learn from: those that are small enough, split into those to learn from and those to judge by."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from rlacd.learn.meshes import Solids

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
    return small(Solids(folder, cache).manifold(name))


def small(solid: Manifold | None) -> Manifold | None:
    """Leave out what cannot be used, or has too many faces."""
    return None if solid is None or solid.num_tri() > TOO_MANY_FACES else solid
