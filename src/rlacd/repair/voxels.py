"""The space that a ball of given radius can reach from outside, on a voxel grid, and a closed wrap of the rest.

Input: a surface in the normalised frame. The reachable space is the union of all balls that touch no face and can roll
in from infinity; the rest (the surface's closing) is what a collision with anything larger than the ball sees. Every
point of its boundary is within about 1.4 radii of the surface.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd._native import label_cells, nearest_labels, poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.solid.frame import FloatArray
from rlacd.solid.topology import BoolArray, IntArray

GAP = 0.03
"""Greatest distance of a cap from the input's surface, and the radius of the ball a gap must stop, in frame units, by
default."""

# Distances between cells are roots of whole numbers: this much more than a radius adds only rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Reach:
    """Reachable space on a grid of cubic cells.

    Attributes
    ----------
    origin
        ``[3]``, the centre of cell (0, 0, 0).
    pitch
        Edge length of a cell.
    radius
        Radius of the ball.
    reached
        ``[X, Y, Z]``, cells the ball can cover.
    occupied
        ``[X, Y, Z]``, cells of the surface.
    room
        ``[X, Y, Z]``, label of every connected set of cells where the ball fits but which it cannot enter; 0 elsewhere.
    """

    origin: FloatArray
    pitch: float
    radius: float
    reached: BoolArray
    occupied: BoolArray
    room: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray, radius: float, resolution: int) -> Reach:
        """Roll a ball around a surface; the longest side of the frame has `resolution` cells."""
        pitch = 2.0 / resolution
        margin = int(np.ceil(radius / pitch)) + 3
        origin, marks, shape = _native.mark_cells(vertices, faces.astype(np.int64), pitch / 2, pitch, margin)
        occupied = np.frombuffer(marks, dtype=bool).reshape(shape)
        poll_stop()
        label = label_cells(~_grown(occupied, radius / pitch)).reshape(occupied.shape)
        outside = label == label[0, 0, 0]
        reached = _grown(outside, radius / pitch)
        room = np.where(outside, 0, label)
        return cls(origin, pitch, radius, reached, occupied, room)

    @property
    def place(self) -> float:
        """A quarter of a cell."""
        return self.pitch / 4

    def covers(self, points: FloatArray) -> BoolArray:
        """Return ``[N]`` whether the ball can reach each point; it can reach all points off the grid."""
        cell = np.rint((points - self.origin) / self.pitch).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.reached.shape)).all(axis=1)
        result = np.ones(len(points), dtype=bool)
        result[inside] = self.reached[tuple(cell[inside].T)]
        return result

    def rooms_outside(self, solid: SurfaceQuery) -> IntArray:
        """Return the labels of the rooms whose deepest cell lies outside a solid."""
        labels = np.unique(self.room)
        labels = labels[labels > 0]
        if len(labels) == 0:
            return labels
        depth = _steps_away(self.occupied)
        cells = np.flatnonzero(self.room)
        deepest_first = cells[np.argsort(-depth.ravel()[cells], kind="stable")]
        _, first = np.unique(self.room.ravel()[deepest_first], return_index=True)
        deepest = np.stack(np.unravel_index(deepest_first[first], self.room.shape), axis=1)
        centers = self.origin + deepest * self.pitch
        return labels[~solid.inside(centers)]

    def volumes(self, rooms: IntArray) -> FloatArray:
        """Return the volume of the cells of each of some rooms: where the ball's centre may be."""
        return np.asarray(np.bincount(self.room.ravel())[rooms] * self.pitch**3)

    def is_deep(self, points: FloatArray, depth: float) -> BoolArray:
        """Return ``[N]`` whether points lie at least `depth` from the cells that the ball can reach."""
        cell = np.clip(np.rint((points - self.origin) / self.pitch).astype(np.int64), 0, np.array(self.room.shape) - 1)
        reached = self.reached.astype(self.room.dtype)
        return np.asarray(nearest_labels(reached, cell, depth / self.pitch + _ROUNDING) == 0)

    def one_in_each_place(self, points: FloatArray) -> IntArray:
        """Return the indices of the first point in each cube of size `place`."""
        first = _native.first_in_place(np.floor((points - self.origin) / self.place))
        return np.flatnonzero(first == np.arange(len(points)))

    def points_in(self, cells: BoolArray, count: int) -> FloatArray:
        """Return `count` random points or a few more ``[N, 3]``, as many in each cell, the same ones every time."""
        inside = np.argwhere(cells)
        inside = np.repeat(inside, -(-count // len(inside)), axis=0)
        return self.origin + (inside + np.random.default_rng(0).uniform(-0.5, 0.5, inside.shape)) * self.pitch

    def rooms_near(self, points: FloatArray) -> IntArray:
        """Return ``[N]`` the label of a room whose walls may contain each point, 0 for none."""
        cell = np.clip(np.rint((points - self.origin) / self.pitch).astype(np.int64), 0, np.array(self.room.shape) - 1)
        return nearest_labels(self.room, cell, self.radius / self.pitch + 2 + _ROUNDING)

    def around_rooms(self, rooms: IntArray) -> BoolArray:
        """Return ``[X, Y, Z]`` the unreachable cells of some rooms and of their walls."""
        return _grown(np.isin(self.room, rooms), self.radius / self.pitch + 2) & ~self.reached

    def around_rest(self, points: FloatArray, solid: SurfaceQuery) -> BoolArray:
        """Return ``[X, Y, Z]`` the unreachable cells of what a solid leaves of the rooms that hold some points."""
        labels = self.room[tuple(np.rint((points - self.origin) / self.pitch).astype(np.int64).T)]
        if not labels.any():
            return np.zeros(self.room.shape, dtype=bool)
        rest = np.flatnonzero(np.isin(self.room, labels[labels > 0]))
        centers = self.origin + np.stack(np.unravel_index(rest, self.room.shape), axis=1) * self.pitch
        mark = np.zeros(self.room.shape, dtype=bool)
        mark.ravel()[rest[~solid.inside(centers)]] = True
        return _grown(mark, self.radius / self.pitch + 2) & ~self.reached

    def around_points(self, points: FloatArray) -> BoolArray:
        """Return ``[X, Y, Z]`` the unreachable cells at and between some points."""
        mark = np.zeros(self.reached.shape, dtype=bool)
        mark[tuple(np.rint((points - self.origin) / self.pitch).astype(np.int64).T)] = True
        return _grown(mark, self.radius / self.pitch) & ~self.reached

    def wrap(
        self, cells: BoolArray, surface: SurfaceQuery, thickness: float, solid: SurfaceQuery | None = None
    ) -> tuple[FloatArray, IntArray]:
        """Return the closed surface of a set of cells, projected onto a surface where it is near.

        Corners of cells move to `thickness` in front of the closest point of the surface as seen from their place,
        so a wrap of a single sheet keeps two sides. Corners farther than two cells away span a gap and are smoothed.
        Corners inside `solid`, with which the wrap will be united, stay: projected, they would leave a slit.
        """
        corners, quads = _boundary_squares(cells)
        points = self.origin + (corners - 0.5) * self.pitch
        closest, _ = surface.closest(points)
        away = points - closest
        distance = np.linalg.norm(away, axis=1)
        is_free = np.ones(len(points), dtype=bool) if solid is None else ~solid.inside(points)
        attached = distance <= 2 * self.pitch
        step = thickness / np.maximum(distance, np.finfo(float).tiny)
        moved = attached & is_free
        points[moved] = (closest + np.minimum(step, 1)[:, None] * away)[moved]
        _smooth(points, quads, ~attached & is_free)
        return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _steps_away(cells: BoolArray) -> IntArray:
    """Count ``[X, Y, Z]`` the steps along the axes from each cell to the nearest of `cells`."""
    steps = np.where(cells, 0, sum(cells.shape))
    for axis, count in enumerate(cells.shape):
        at = np.arange(count).reshape(np.roll([count, 1, 1], axis))
        from_below = np.minimum.accumulate(steps - at, axis=axis) + at
        from_above = np.flip(np.minimum.accumulate(np.flip(steps + at, axis), axis=axis), axis) - at
        steps = np.minimum(from_below, from_above)
    return steps


def _grown(cells: BoolArray, radius: float) -> BoolArray:
    """Return ``[X, Y, Z]`` which cells are at most `radius` cells away from one of `cells`."""
    result = np.zeros_like(cells)
    reach = int(radius + _ROUNDING)
    padded = np.pad(cells, reach)
    tall = {0: padded}  # grown along the last axis alone
    for z in range(1, reach + 1):
        tall[z] = tall[z - 1].copy()
        tall[z][..., z:] |= padded[..., :-z]
        tall[z][..., :-z] |= padded[..., z:]
    x, y, z = cells.shape
    for dx, dy in itertools.product(range(-reach, reach + 1), repeat=2):
        left = (radius + _ROUNDING) ** 2 - dx**2 - dy**2
        if left >= 0:
            poll_stop()
            result |= tall[int(left**0.5)][reach + dx : reach + dx + x, reach + dy : reach + dy + y, reach : reach + z]
    return result


def _boundary_squares(solid: BoolArray) -> tuple[FloatArray, IntArray]:
    """Return corner coordinates ``[N, 3]`` (cell (0, 0, 0) spans 0 to 1), outward squares ``[Q, 4]`` of a cell set."""
    shape = np.array(solid.shape) + 1
    squares = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for direction in (1, -1):
            beyond = np.zeros_like(solid)
            to: list[slice] = [slice(None)] * 3
            frm: list[slice] = [slice(None)] * 3
            to[axis], frm[axis] = (
                (slice(None, -1), slice(1, None)) if direction == 1 else (slice(1, None), slice(None, -1))
            )
            beyond[tuple(to)] = solid[tuple(frm)]
            cells = np.argwhere(solid & ~beyond)
            cells[:, axis] += direction == 1
            ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
            if direction == -1:
                ring.reverse()
            loop = []
            for du, dv in ring:
                corner = cells.copy()
                corner[:, u] += du
                corner[:, v] += dv
                loop.append(np.ravel_multi_index(tuple(corner.T), tuple(shape)))
            squares.append(np.stack(loop, axis=1))
    flat = np.concatenate(squares)
    used, index = np.unique(flat, return_inverse=True)
    corners = np.stack(np.unravel_index(used, tuple(shape)), axis=1).astype(np.float64)
    return corners, index.reshape(-1, 4)


def _smooth(points: FloatArray, quads: IntArray, free: BoolArray, rounds: int = 20) -> None:
    """Pull the free points to the mean of their neighbours, in place; the others stay."""
    if not free.any():
        return
    a = quads.ravel()
    b = quads[:, [1, 2, 3, 0]].ravel()
    tail, head = np.concatenate([a, b]), np.concatenate([b, a])
    some = free[tail]
    tail, head = tail[some], head[some]
    degree = np.maximum(np.bincount(tail, minlength=len(points)), 1)
    for _ in range(rounds):
        poll_stop()
        mean = np.stack([np.bincount(tail, points[head, k], len(points)) for k in range(3)], axis=1)
        points[free] = (mean / degree[:, None])[free]
