"""The solids to learn on: a folder of meshes, each repaired once and kept."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from rlacd.errors import RlacdError, TrainingError
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component
from rlacd.solid.frame import Frame
from rlacd.solid.load import load_mesh
from rlacd.solid.repair import repair

ENDINGS = frozenset({".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf"})

TURNS = (0.0, 45.0, 90.0, 180.0)
"""Degrees about one axis: the paper's augmentation."""


@dataclass(frozen=True)
class MeshList:
    """What a folder holds.

    Attributes
    ----------
    training, validation : tuple of str
        Paths relative to the folder.
    unreadable, too_large : int
        Files left out.
    """

    training: tuple[str, ...]
    validation: tuple[str, ...]
    unreadable: int
    too_large: int


def list_meshes(folder: Path, max_faces: int, validation: int, seed: int) -> MeshList:
    """Find the meshes below a folder; `validation` of them, chosen by the seed, are held out.

    Raises
    ------
    TrainingError
        Nothing is left to learn on.
    """
    names, unreadable, too_large = [], 0, 0
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS and p.is_file()):
        try:
            faces = len(load_mesh(path).faces)
        except RlacdError:
            unreadable += 1
            continue
        if faces > max_faces:
            too_large += 1
        else:
            names.append(path.relative_to(folder).as_posix())
    if len(names) <= validation:
        raise TrainingError(
            f"{folder} holds {len(names)} meshes to learn on ({unreadable} cannot be read, {too_large} have more than "
            f"{max_faces} triangles); more than {validation} are needed, since that many are held out for validation."
        )
    shuffled = [names[i] for i in np.random.default_rng(seed).permutation(len(names))]
    return MeshList(tuple(sorted(shuffled[validation:])), tuple(sorted(shuffled[:validation])), unreadable, too_large)


class Solids:
    """Repaired solids by name, taken from the cache folder, or repaired and put there.

    Parameters
    ----------
    folder : Path
        Of the meshes.
    cache : Path, optional
        A folder of this class's own; several processes may share it. Without, solids are kept in memory only.
    """

    def __init__(self, folder: Path, cache: Path | None = None) -> None:
        self._folder = folder
        self._cache = cache
        self._held: dict[str, Manifold | None] = {}
        if cache is not None:
            cache.mkdir(parents=True, exist_ok=True)

    def get(self, name: str, axis: int = 0, degrees: float = 0.0) -> Component | None:
        """Get a solid turned about a coordinate axis, in its frame; None when it cannot be repaired."""
        if name not in self._held:
            self._held[name] = self._load(name)
        solid = self._held[name]
        if solid is None:
            return None
        return Component(_framed(solid.rotate([degrees if i == axis else 0.0 for i in range(3)])) if degrees else solid)

    def _load(self, name: str) -> Manifold | None:
        kept = None if self._cache is None else self._cache / f"{hashlib.sha256(name.encode()).hexdigest()[:24]}.npz"
        if kept is not None and kept.exists():
            with np.load(kept, allow_pickle=False) as arrays:
                vertices, faces = arrays["vertices"], arrays["faces"]
        else:
            vertices, faces = self._repaired(name)
        if kept is not None and not kept.exists():
            partial = kept.with_suffix(f".{os.getpid()}.npz")
            np.savez(partial, vertices=vertices, faces=faces)
            os.replace(partial, kept)
        return Manifold(Mesh64(vertices, faces)) if len(faces) else None

    def _repaired(self, name: str) -> tuple[FloatArray, NDArray[np.uint64]]:
        try:
            solid = repair(load_mesh(self._folder / name), threads=1).manifold
            Component(solid)
        except (RlacdError, ValueError):  # flat or empty: nothing to cut
            return np.empty((0, 3)), np.empty((0, 3), dtype=np.uint64)
        mesh = solid.to_mesh64()
        return np.array(mesh.vert_properties[:, :3], order="C"), np.array(mesh.tri_verts, dtype=np.uint64, order="C")


def _framed(solid: Manifold) -> Manifold:
    """Carry a solid to where its box is centred and its longest side 2."""
    box = np.asarray(solid.bounding_box(), dtype=np.float64).reshape(2, 3)
    frame = Frame.of(box)
    return solid.translate([float(-x) for x in frame.center]).scale([frame.scale] * 3)
