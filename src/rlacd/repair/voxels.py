"""The space that a ball of given radius can reach from outside, on a voxel grid, and a closed wrap of the rest.

Input: a surface in the normalised frame. The reachable space is the union of all balls that touch no face and can roll
in from infinity; the rest (the surface's closing) is what a collision with anything larger than the ball sees. Every
point of its boundary is within about 1.4 radii of the surface.
"""

from __future__ import annotations

import itertools

import numpy as np
from manifold3d import Manifold

from rlacd import _native
from rlacd._native import label_cells, nearest_labels, poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array
from rlacd.solid.frame import HALF_THICKNESS, ROUNDING
from rlacd.solid.manifold import to_manifold

FILLING_ERROR = 4 * HALF_THICKNESS
"""How far simplifying may move what fills a room."""


class Reach:
    """Space that a ball can reach, rolled around a surface on a grid of cubic cells.

    Parameters
    ----------
    surface
    radius
        Of the ball.
    resolution
        Number of cells along the longest side of the frame.

    Attributes
    ----------
    origin
        ``[3]``, the centre of cell (0, 0, 0).
    pitch
        Edge length of a cell.
    reached
        ``[X, Y, Z]``, cells the ball can cover.
    void
        ``[X, Y, Z]``, label of each void: connected cells where the ball fits but which it cannot enter; 0 elsewhere.
    """

    def __init__(self, surface: SurfaceQuery, radius: float, resolution: int) -> None:
        self._surface, self.pitch, self.radius = surface, 2.0 / resolution, radius
        margin = int(np.ceil(radius / self.pitch)) + 3
        marked = _native.mark_cells(surface.vertices, surface.faces, self.pitch / 2, self.pitch, margin)
        self.origin: FloatArray = np.array(marked[0])
        occupied = np.frombuffer(marked[1], dtype=bool).reshape(marked[2])
        poll_stop()
        label = label_cells(~_grown(occupied, radius / self.pitch)).reshape(occupied.shape)
        outside = label == label[0, 0, 0]
        self.reached, self.void = _grown(outside, radius / self.pitch), np.where(outside, 0, label)

    def covers(self, points: FloatArray) -> BoolArray:
        """Return ``[N]`` whether the ball can reach each point; it can reach all points off the grid."""
        return np.asarray(self.reached[tuple(self._cells(points).T)])

    def _cells(self, points: FloatArray) -> Int64Array:
        """The cells ``[N, 3]`` of points, nearest ones for those off the grid."""
        cells = np.rint((points - self.origin) / self.pitch).astype(np.int64)
        return np.clip(cells, 0, np.array(self.void.shape) - 1)

    def voids_outside(self, voids: Int64Array, solid: SurfaceQuery) -> Int64Array:
        """Return cells ``[N]`` of `voids` that lie outside a solid, of one in four cells."""
        cells = np.flatnonzero(np.isin(self.void, voids))
        at = np.stack(np.unravel_index(cells, self.void.shape), axis=1)
        some = at.sum(axis=1) % 4 == 0  # some in each layer of cells
        outside: Int64Array = cells[some][~solid.inside(self.origin + at[some] * self.pitch)]
        return outside

    def is_deep(self, points: FloatArray, depth: float) -> BoolArray:
        """Return ``[N]`` whether points lie at least `depth` from the cells that the ball can reach."""
        reached = self.reached.astype(self.void.dtype)
        return np.asarray(nearest_labels(reached, self._cells(points), depth / self.pitch + ROUNDING) == 0)

    def voids_near(self, points: FloatArray) -> Int64Array:
        """Return ``[N]`` the label of a void whose walls may contain each point, 0 for none."""
        return nearest_labels(self.void, self._cells(points), self.radius / self.pitch + 2 + ROUNDING)

    def around_cells(self, cells: Int64Array) -> BoolArray:
        """Return ``[X, Y, Z]`` the unreachable cells of voids at and between some cells, and of their walls there."""
        mark = np.zeros(self.void.shape, dtype=bool)
        mark.ravel()[cells] = True
        between = _grown(mark, 2) & (self.void > 0)
        return _grown(between, self.radius / self.pitch + 2) & ~self.reached

    def around_points(self, points: FloatArray) -> BoolArray:
        """Return ``[X, Y, Z]`` the unreachable cells at and between some points."""
        mark = np.zeros(self.reached.shape, dtype=bool)
        mark[tuple(self._cells(points).T)] = True
        return _grown(mark, self.radius / self.pitch) & ~self.reached

    def wrap(self, cells: BoolArray, solid: SurfaceQuery | None = None) -> Manifold:
        """Return a set of cells as a solid, projected onto the surface where it is near, and simplified.

        Corners of cells move to `HALF_THICKNESS` in front of the closest point of the surface as seen from their
        place, so a wrap of a single sheet keeps two sides. Corners farther than two cells away span a gap and are
        smoothed. Corners inside `solid`, with which the wrap will be united, stay: projected, they would leave a slit.
        """
        corners, quads = _boundary_squares(cells)
        points = self.origin + (corners - 0.5) * self.pitch
        closest, _ = self._surface.closest(points)
        away = points - closest
        distance = np.linalg.norm(away, axis=1)
        is_far = distance > 2 * self.pitch
        moved = ~is_far
        if solid is not None:
            moved[moved] = ~solid.inside(points[moved])
        step = HALF_THICKNESS / np.maximum(distance, np.finfo(float).tiny)
        points[moved] = (closest + np.minimum(step, 1)[:, None] * away)[moved]
        _smooth(points, quads, is_far)
        wrap = to_manifold(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
        return wrap.simplify(HALF_THICKNESS / 2 if solid is None else FILLING_ERROR)


def _grown(cells: BoolArray, radius: float) -> BoolArray:
    """Return ``[X, Y, Z]`` which cells are at most `radius` cells away from one of `cells`."""
    result = np.zeros_like(cells)
    reach = int(radius + ROUNDING)
    padded = np.pad(cells, reach)
    tall = {0: padded}  # grown along the last axis alone
    for z in range(1, reach + 1):
        tall[z] = tall[z - 1].copy()
        tall[z][..., z:] |= padded[..., :-z]
        tall[z][..., :-z] |= padded[..., z:]
    x, y, z = cells.shape
    for dx, dy in itertools.product(range(-reach, reach + 1), repeat=2):
        left = (radius + ROUNDING) ** 2 - dx**2 - dy**2
        if left >= 0:
            poll_stop()
            result |= tall[int(left**0.5)][reach + dx : reach + dx + x, reach + dy : reach + dy + y, reach : reach + z]
    return result


def _boundary_squares(solid: BoolArray) -> tuple[FloatArray, Int64Array]:
    """Return corner coordinates ``[N, 3]`` (cell (0, 0, 0) spans 0 to 1), outward squares ``[Q, 4]`` of a cell set."""
    shape = tuple(np.array(solid.shape) + 1)
    steps = shape[1] * shape[2], shape[2], 1
    squares = []
    for axis in range(3):
        pad = np.eye(3, dtype=int)[axis]
        before, after = np.pad(solid, [(n, 0) for n in pad]), np.pad(solid, [(0, n) for n in pad])
        for outward, here in ((-1, before > after), (1, after > before)):  # the set ends: squares face up; it begins
            at = np.unravel_index(np.flatnonzero(here), here.shape)
            corner, along = np.ravel_multi_index(at, shape), (steps[(axis + 1) % 3], steps[(axis + 2) % 3])
            loop = np.array([(0, 0), (1, 0), (1, 1), (0, 1)][::-outward]) @ along
            squares.append(corner[:, None] + loop)
    flat = np.concatenate(squares)
    used, index = np.unique(flat, return_inverse=True)
    corners = np.stack(np.unravel_index(used, shape), axis=1).astype(np.float64)
    return corners, index.reshape(-1, 4)


def _smooth(points: FloatArray, quads: Int64Array, free: BoolArray, rounds: int = 20) -> None:
    """Pull the free points to the mean of their neighbours, in place; the others stay."""
    a, b = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    tail, head = np.concatenate([a, b]), np.concatenate([b, a])
    tail, head = tail[free[tail]], head[free[tail]]
    degree = np.maximum(np.bincount(tail, minlength=len(points)), 1)
    for _ in range(rounds if free.any() else 0):
        poll_stop()
        mean = np.stack([np.bincount(tail, points[head, k], len(points)) for k in range(3)], axis=1)
        points[free] = (mean / degree[:, None])[free]
