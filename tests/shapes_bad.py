"""Inputs that no modeller would hand in on purpose."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from trimesh import creation

from tests.shapes import Floats

Mesh = tuple[Floats, Any]


def arrays(mesh: trimesh.Trimesh) -> Mesh:
    return np.array(mesh.vertices), np.array(mesh.faces)


def ell() -> Mesh:
    """Two boxes that cross; cut along its diagonals, four hulls without any excess."""
    return arrays(trimesh.util.concatenate([creation.box((2, 0.4, 0.4)), creation.box((0.4, 0.4, 2))]))


def klein_bottle(around: int = 24, tube: int = 12) -> Mesh:
    """A closed surface without an inside: the tube's end meets its start mirrored."""
    u, v = np.meshgrid(
        np.linspace(0, 2 * np.pi, around, endpoint=False),
        np.linspace(0, 2 * np.pi, tube, endpoint=False),
        indexing="ij",
    )
    radius = 4 * (1 - np.cos(u) / 2)
    body = 6 * np.cos(u) * (1 + np.sin(u))
    x = np.where(u < np.pi, body + radius * np.cos(u) * np.cos(v), body - radius * np.cos(v))
    y = np.where(u < np.pi, 16 * np.sin(u) + radius * np.sin(u) * np.cos(v), 16 * np.sin(u))
    vertices = np.stack([x, y, radius * np.sin(v)], axis=-1).reshape(-1, 3)
    faces = []
    for i in range(around):
        for j in range(tube):
            here = [i * tube + j, i * tube + (j + 1) % tube]
            last = i == around - 1
            there = [(tube // 2 - k) % tube if last else (i + 1) * tube + k % tube for k in (j, j + 1)]
            faces += [[here[0], there[0], here[1]], [here[1], there[0], there[1]]]
    return vertices, np.array(faces)


def band(twists: int, count: int = 100) -> trimesh.Trimesh:
    """A band with half twists; an odd number makes it one-sided."""
    t = 2 * np.pi * np.arange(count) / count
    half = 0.3 * np.stack(
        [np.cos(twists * t / 2) * np.cos(t), np.cos(twists * t / 2) * np.sin(t), np.sin(twists * t / 2)], axis=1
    )
    middle = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    vertices = np.vstack([middle + half, middle - half])
    faces = []
    for i in range(count):
        j, swap = (i + 1) % count, twists % 2 == 1 and i == count - 1
        a, b = i, i + count
        c, d = (j + count, j) if swap else (j, j + count)
        faces += [[a, c, b], [b, c, d]]
    return trimesh.Trimesh(vertices, faces, process=False)
