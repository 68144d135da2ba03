"""Where points lie relative to a triangle soup, and sample points on a soup for such queries."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rlacd._native import Surface, poll_stop
from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import BoolArray, IntArray

_CHUNK = 1_000_000
_STEPS = np.array([1, 2, 3, *(s << k for k in range(1, 9) for s in (2, 3))])
_LARGEST = 1024


class SurfaceQuery:
    """Nearest points and winding numbers of a triangle soup.

    Built on first use: most inputs never need it.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, threads: int | None = None) -> None:
        self.vertices = vertices
        self.faces = faces
        self.threads = threads

    @cached_property
    def _surface(self) -> Surface:
        return Surface(
            np.ascontiguousarray(self.vertices, dtype=np.float64), np.ascontiguousarray(self.faces, dtype=np.int32)
        )

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance ``[N]`` of each point to the faces."""
        return np.asarray(self._surface.distance(np.ascontiguousarray(points), threads=self.threads or 0))

    def closest(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the closest point ``[N, 3]`` of the faces and the face ``[N]`` it lies on."""
        found, face = self._surface.closest(np.ascontiguousarray(points), threads=self.threads or 0)
        return np.asarray(found), np.asarray(face, dtype=np.int64)

    def winding(self, points: FloatArray) -> FloatArray:
        """Return ``[N]`` how many times the faces wind around each point."""
        return np.asarray(self._surface.winding(np.ascontiguousarray(points), threads=self.threads or 0))

    def inside(self, points: FloatArray) -> BoolArray:
        """Return ``[N]`` whether the faces, a closed outward surface, wind around each point."""
        result: BoolArray = self.winding(points) > 0.5
        return result


def points_covering(vertices: FloatArray, faces: IntArray, spacing: float) -> tuple[FloatArray, IntArray]:
    """Choose points such that no point of a face is farther than `spacing` from one of them; corners are among them.

    Returns the points ``[N, 3]`` and a face ``[N]`` each lies on. Faces no larger than `spacing` share their corners.
    """
    corners = vertices[faces]
    small = (_squared(np.roll(corners, -1, axis=1) - corners) <= spacing**2).all(axis=1)
    first = np.full(len(vertices), -1, dtype=np.int64)
    numbers = np.flatnonzero(small)
    poll_stop()
    first[faces[numbers[::-1], ::-1].ravel()] = np.repeat(numbers[::-1], 3)
    shared = np.flatnonzero(first >= 0)
    large = np.flatnonzero(~small)
    points, on = spread_points(vertices, faces[large], spacing)
    return np.concatenate([vertices[shared], points]), np.concatenate([first[shared], large[on]])


def spread_points(vertices: FloatArray, faces: IntArray, spacing: float) -> tuple[FloatArray, IntArray]:
    """Lay a grid over every face so that no point of a face is farther than `spacing` from a grid point.

    Returns the points ``[N, 3]``, corners included, and the face ``[N]`` each lies on.
    """
    if len(faces) == 0:
        return np.empty((0, 3)), np.empty(0, np.int64)
    corners = vertices[faces]
    lengths = _squared(np.roll(corners, -1, axis=1) - corners)
    # Rotate every face so that its longest edge runs from a to b, then cover it in rows parallel to that edge.
    turn = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, turn[..., None], axis=1), 1, 0)
    base = np.sqrt(lengths.max(axis=1))
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(base, np.finfo(float).tiny)
    columns, rows = _round_up(base / spacing), _round_up(height / spacing)
    points: list[FloatArray] = []
    owner: list[IntArray] = []
    for pattern in np.unique(columns * _LARGEST + rows):
        n, m = divmod(int(pattern), _LARGEST)
        some = np.flatnonzero((columns == n) & (rows == m))
        poll_stop()
        v, u = np.divmod(np.arange(n * m + m), n + 1)
        u, v = np.append(u / n, 0.0)[None, :, None], np.append(v / m, 1.0)[None, :, None]
        for chunk in np.array_split(some, max(1, len(some) * u.size // _CHUNK)):
            poll_stop()
            row_start, row_end = (
                a[chunk, None] * (1 - v) + c[chunk, None] * v,
                b[chunk, None] * (1 - v) + c[chunk, None] * v,
            )
            points.append((row_start * (1 - u) + row_end * u).reshape(-1, 3))
            owner.append(np.repeat(chunk, u.size))
    return np.concatenate(points), np.concatenate(owner)


def _round_up(steps: FloatArray) -> IntArray:
    """Round up to 1, 2, 3, 4, 6, 8, 12, 16, ...: few distinct grids for any number of faces."""
    return _STEPS[np.minimum(np.searchsorted(_STEPS, steps), len(_STEPS) - 1)]


def _squared(vectors: FloatArray) -> FloatArray:
    result: FloatArray = np.einsum("...j,...j->...", vectors, vectors)
    return result
