"""Point clouds for pretraining: many points of each mesh, sampled once; every step draws a subset."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rlacd import _native
from rlacd.errors import RlacdError, TrainingError
from rlacd.io.read.load import load_mesh
from rlacd.learn.meshes import TURNS
from rlacd.policies.observe import Float32Array

KEPT = 8192
"""Points stored per mesh."""


class Clouds:
    """Surface samples of meshes in their files' orientation, centred, in the unit ball.

    Parameters
    ----------
    folder : Path
        Folder of the meshes.
    names : sequence of str
        Relative to it. Meshes without a surface are skipped.
    kept : Path
        Cache file of this class, ``.npy``: written once, then mapped into memory; its ``.json`` lists the names.

    Raises
    ------
    TrainingError
        None of the meshes has a surface.
    """

    def __init__(self, folder: Path, names: Sequence[str], kept: Path) -> None:
        listing = kept.with_suffix(".json")
        if not listing.exists():
            _write(folder, names, kept, listing)
        self.names: tuple[str, ...] = tuple(json.loads(listing.read_text(encoding="utf-8")))
        if names and not self.names:
            raise TrainingError(f"no mesh in {folder} has a surface to take points of; give other meshes.")
        self._points: Float32Array = np.load(kept, mmap_mode="r", allow_pickle=False)

    def __len__(self) -> int:
        return len(self.names)

    def draw(self, rows: Sequence[int], count: int, rng: np.random.Generator) -> Float32Array:
        """Draw `count` points from each of the given clouds, [B, count, 3], in random order."""
        order = rng.random((len(rows), KEPT), dtype=np.float32).argsort(axis=1)[:, :count]
        return np.stack([self._points[row][chosen] for row, chosen in zip(rows, order, strict=True)])


def augmented(clouds: Float32Array, rotate: bool, stretch: float, rng: np.random.Generator) -> Float32Array:
    """Turn each cloud [B, N, 3] about an axis, stretch it along each, and rescale it into the unit ball."""
    changed = np.empty_like(clouds)
    for i, cloud in enumerate(clouds):
        matrix = _turn(int(rng.integers(3)), float(rng.choice(TURNS))) if rotate else np.eye(3)
        factors = np.exp(rng.uniform(-1, 1, size=3) * np.log(stretch))
        changed[i] = in_unit_ball(cloud @ (factors[:, None] * matrix).T)
    return changed


def in_unit_ball(points: np.ndarray) -> np.ndarray:
    """Centre the bounding box of points [N, 3] and scale the farthest point to distance 1."""
    centered = points - (points.min(axis=0) + points.max(axis=0)) / 2
    scaled: np.ndarray = centered / np.sqrt((centered**2).sum(axis=1).max())
    return scaled


def epoch_rows(clouds: int, batch: int, step: int, seed: int) -> list[int]:
    """Return the clouds of a step: every cloud once per epoch, in random order."""
    places = range(step * batch, (step + 1) * batch)
    orders = {e: np.random.default_rng([seed, 1, e]).permutation(clouds) for e in {p // clouds for p in places}}
    return [int(orders[p // clouds][p % clouds]) for p in places]


def _write(folder: Path, names: Sequence[str], kept: Path, listing: Path) -> None:
    held, clouds = [], []
    for name in names:
        try:
            mesh = load_mesh(folder / name)
            points = _native.sample_surface(mesh.vertices, mesh.faces.astype(np.int32), KEPT, 0)[0]
        except (RlacdError, ValueError):
            continue
        if np.ptp(points, axis=0).max() > 0:
            held.append(name)
            clouds.append(in_unit_ball(points).astype(np.float32))
    partial = kept.with_suffix(".new.npy")
    np.save(partial, np.array(clouds, dtype=np.float32).reshape(-1, KEPT, 3))
    os.replace(partial, kept)
    listing.write_text(json.dumps(held), encoding="utf-8")


def _turn(axis: int, degrees: float) -> np.ndarray:
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cos, -sin, sin, cos
    return matrix
