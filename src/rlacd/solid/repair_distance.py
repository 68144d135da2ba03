"""Where points lie relative to a triangle soup, and the points on a soup to ask that from."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rlacd._native import Surface
from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import BoolArray, IntArray

_CHUNK = 1_000_000


class SurfaceQuery:
    """Nearest points and winding numbers of a triangle soup.

    Built on first use: most inputs never need it.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int32)

    @cached_property
    def _surface(self) -> Surface:
        return Surface(self.vertices, self.faces)

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance ``[N]`` of each point to the faces."""
        return np.asarray(self._surface.distance(np.ascontiguousarray(points)))

    def closest(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the closest point ``[N, 3]`` of the faces and the face ``[N]`` it lies on."""
        found, face = self._surface.closest(np.ascontiguousarray(points))
        return np.asarray(found), np.asarray(face, dtype=np.int64)

    def inside(self, points: FloatArray) -> BoolArray:
        """Return ``[N]`` whether the faces, a closed outward surface, wind around each point."""
        result: BoolArray = np.asarray(self._surface.winding(np.ascontiguousarray(points))) > 0.5
        return result


def spread_points(vertices: FloatArray, faces: IntArray, spacing: float) -> tuple[FloatArray, IntArray]:
    """Lay a grid over every face so that no point of a face is farther than `spacing` from a grid point.

    Returns the points ``[N, 3]``, corners included, and the face ``[N]`` each lies on.
    """
    if len(faces) == 0:
        return np.empty((0, 3)), np.empty(0, np.int64)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    longest = np.sqrt(np.maximum(np.maximum(_squared(b - a), _squared(c - b)), _squared(a - c)))
    steps = np.clip(np.ceil(longest / spacing), 1, 512).astype(np.int64)
    points: list[FloatArray] = []
    owner: list[IntArray] = []
    for n in np.unique(steps):
        i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
        i, j = i[i + j <= n], j[i + j <= n]
        some = np.flatnonzero(steps == n)
        for chunk in np.array_split(some, max(1, len(some) * len(i) // _CHUNK)):
            u, v = (i / n)[None, :, None], (j / n)[None, :, None]
            points.append(((1 - u - v) * a[chunk, None] + u * b[chunk, None] + v * c[chunk, None]).reshape(-1, 3))
            owner.append(np.repeat(chunk, len(i)))
    return np.concatenate(points), np.concatenate(owner)


def _squared(vectors: FloatArray) -> FloatArray:
    result: FloatArray = np.einsum("ij,ij->i", vectors, vectors)
    return result
