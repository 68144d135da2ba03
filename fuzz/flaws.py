"""Closed meshes damaged like scans and exports: fins, scattered holes, missing or flipped patches, and a mixture.

Every function takes vertices float64 ``[V, 3]``, faces int64 ``[F, 3]``, the fraction of faces to damage and a random
generator, and returns new vertices and faces. The input's vertices keep their indices.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mesh = tuple[Floats, Ints]
Damage = Callable[[Floats, Ints, float, np.random.Generator], Mesh]

PATCH = 8
"""Faces per patch, if there are that many around its first one."""

LONGEST_FIN = 0.1
"""Height of a fin, for a mesh whose longest side is 2."""


def fins(vertices: Floats, faces: Ints, share: float, random: np.random.Generator) -> Mesh:
    """Add a triangle on an edge of the chosen fraction of faces, pointing outwards, tilted by up to 45 degrees."""
    some = random.permutation(len(faces))[: _count(faces, share)]
    corner = random.integers(3, size=len(some))
    a, b = faces[some, corner], faces[some, (corner + 1) % 3]
    triangles = vertices[faces[some]]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    edge = np.linalg.norm(vertices[b] - vertices[a], axis=1)
    height = np.minimum(edge, LONGEST_FIN * np.ptp(vertices, axis=0).max() / 2)
    aside = random.uniform(-1, 1, (len(some), 3))
    tip = (vertices[a] + vertices[b]) / 2 + height[:, None] * (normal + 0.5 * aside) / 1.5
    fin = np.stack([a, b, len(vertices) + np.arange(len(some))], axis=1)
    over = random.random(len(some)) < 0.5
    fin[over] = fin[over, ::-1]
    return np.concatenate([vertices, tip]), np.concatenate([faces, fin])


def moth_holes(vertices: Floats, faces: Ints, share: float, random: np.random.Generator) -> Mesh:
    """Remove scattered faces."""
    return vertices, np.delete(faces, random.permutation(len(faces))[: _count(faces, share)], axis=0)


def missing_patches(vertices: Floats, faces: Ints, share: float, random: np.random.Generator) -> Mesh:
    """Remove patches of adjacent faces."""
    return vertices, np.delete(faces, _patches(faces, share, random), axis=0)


def flipped_patches(vertices: Floats, faces: Ints, share: float, random: np.random.Generator) -> Mesh:
    """Flip patches of adjacent faces."""
    faces, some = faces.copy(), _patches(faces, share, random)
    faces[some] = faces[some, ::-1]
    return vertices, faces


def mixture(vertices: Floats, faces: Ints, share: float, random: np.random.Generator) -> Mesh:
    """Apply all of them, each to a quarter of the fraction."""
    for damage in (flipped_patches, moth_holes, missing_patches, fins):
        vertices, faces = damage(vertices, faces, share / 4, random)
    return vertices, faces


FAMILIES: dict[str, Damage] = {
    "fins": fins,
    "moth holes": moth_holes,
    "missing patches": missing_patches,
    "flipped patches": flipped_patches,
    "mixture": mixture,
}


def _count(faces: Ints, share: float) -> int:
    return max(1, round(share * len(faces)))


def _patches(faces: Ints, share: float, random: np.random.Generator) -> Ints:
    """Faces of patches that together make up the given fraction."""
    edge = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge_of = np.unique(edge, axis=0, return_inverse=True)
    incidence = coo_array((np.ones(len(edge)), (np.repeat(np.arange(len(faces)), 3), edge_of.reshape(-1)))).tocsr()
    neighbours = (incidence @ incidence.T).tocsr()
    left, taken = _count(faces, share), np.zeros(len(faces), dtype=bool)
    for seed in random.permutation(len(faces)):
        if left == 0:
            break
        patch, border = list[int](), [int(seed)]
        while border and len(patch) < min(PATCH, left):
            face = border.pop(0)
            if not taken[face]:
                taken[face] = True
                patch.append(face)
                border += neighbours.indices[neighbours.indptr[face] : neighbours.indptr[face + 1]].tolist()
        left -= len(patch)
    return np.flatnonzero(taken)
