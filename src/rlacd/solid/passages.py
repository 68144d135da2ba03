"""Passages and pockets: places outside a solid that its walls hold between them, such as holes, slots and mouths.

A ball with the normal of a wall through its centre shrinks until it touches another wall (Ma, Bae and Choi, "3D medial
axis point approximation using nearest neighbors and the normal field", 2012). Then it is pushed away from whatever is
nearest. Between walls it goes to and fro; where they leave it a way out it drifts. If it is held once it goes against
its drift, it is in the throat of a passage, as in the hole of a ring; else in none.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray, dots
from rlacd.solid.balls import Balls

LARGEST_DRIFT = 0.25
"""Share of its way by which a held ball may drift: the walls that hold it open by up to 30 degrees."""

STEPS = (1 / 2, 1 / 8, 1 / 32, 1 / 128)
"""Shares of its radius by which a ball is pushed to the middle between walls, ..."""

PUSHES, MORE = 12, 8
"""... so often by each, since in the corner of two walls it goes a third of its way; and then to and fro by the last,
to see whether it drifts."""

STRAY = 0.6
"""A ball that goes so much of the way nearly straight finds no other wall: to the middle, it is a third or half; in a
right-angled crease, 0.7."""

GROWTH = 1.5
"""A ball that touches walls beside its passage's middle is by less than this smaller than one in it."""

ALIKE = 1.02
"""Times as large as another, a ball does not count as larger."""

FACES = 2000
"""Triangles of which each is a start; of more, those whose middles lie in different cells, or that face elsewhere."""

CELLS, COARSER = 256, 1.5
"""Cells along the longest side, and by how much larger ones are tried while there are too many."""


def passage_balls(
    solid: tuple[FloatArray, IntArray],
    surface: _native.Surface,
    radii: tuple[float, float],
    starts: int,
    spacing: float,
    threads: int,
    wanted: Callable[[Balls], BoolArray] | None = None,
) -> Balls:
    """Find the largest balls that fit in passages, each exactly as large as the surface leaves it.

    Parameters
    ----------
    solid : vertices float64 [V, 3] and faces int32 [F, 3]
        Closed, oriented outwards.
    surface : _native.Surface
        That of the solid.
    radii : (float, float)
        The least and the largest radius.
    starts : int
        Points of the surface from which balls start, beside the middles of its triangles.
    spacing : float
        A ball is left out if the centre of a larger one is within this share of its radius.
    threads : int
        The result does not depend on it.
    wanted : callable, optional
        Tells which of some balls, not quite in their place yet, matter.
    """
    least, most = radii
    points, normals = _starts(*solid, starts)
    held = surface.held_balls(points, normals, least / GROWTH, most, threads)
    balls = Balls(points + held[:, None] * normals, held).some(held > 0)
    if wanted is not None:
        balls = balls.some(wanted(balls))
    balls = _pushed(balls.some(_one_a_cell(balls, 4 * spacing)), least / GROWTH, spacing, surface, threads)
    balls = balls.some((balls.radii >= least) & (balls.radii <= most))
    return spread(balls.some(surface.winding(balls.centres, threads=threads, is_closed=True) < 0.5), spacing)


def _starts(vertices: FloatArray, faces: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Points spread over the surface and in the middle of triangles, of which small holes have many; their normals."""
    points, of = _native.sample_surface(vertices, faces, count, 0)
    middles, normals = vertices[faces].mean(axis=1), _native.long_normals(vertices, faces.astype(np.int64))
    some = _apart(middles, normals)
    points, normals = np.concatenate([points, middles[some]]), normals[np.concatenate([of, some])]
    areas = np.sqrt(dots(normals, normals))
    sound = areas > 0
    return np.ascontiguousarray(points[sound]), normals[sound] / areas[sound, None]


def _apart(middles: FloatArray, normals: FloatArray) -> IntArray:
    """Numbers of triangles: all if they are few, else one in each cell and octant of directions."""
    some, size = np.arange(len(middles)), 2 / CELLS
    octants = (normals > 0) @ np.array([1, 2, 4])
    while len(some) > FACES:
        x, y, z = np.floor(middles / size).astype(np.int64).T + CELLS
        _, some = np.unique(((x * 2 * CELLS + y) * 2 * CELLS + z) * 8 + octants, return_index=True)
        size *= COARSER
    return some.astype(np.int32)


def _pushed(balls: Balls, least: float, spacing: float, surface: _native.Surface, threads: int) -> Balls:
    """The balls that are held, in the best place near theirs, one of those that meet there; and those in throats."""
    free = np.zeros_like(balls.centres)
    pushed, drifts, share = _pushed_by(STEPS[0], PUSHES, balls, free, surface, threads)
    drifting = np.flatnonzero(share > LARGEST_DRIFT)
    drifting = drifting[_one_a_cell(balls.some(drifting), 4 * spacing)]
    throats = _in_throats(balls.some(drifting), drifts[drifting], least, surface, threads)
    for step, times in [*((step, PUSHES) for step in STEPS[1:]), (STEPS[-1], MORE)]:
        pushed = pushed.some(share <= STRAY)
        pushed = pushed.some(_one_a_cell(pushed, 2 * spacing))
        pushed, _, share = _pushed_by(step, times, pushed, free[: len(pushed)], surface, threads)
    pushed = pushed.some(share <= LARGEST_DRIFT)
    return Balls(np.concatenate([pushed.centres, throats.centres]), np.concatenate([pushed.radii, throats.radii]))


def _in_throats(balls: Balls, drifts: FloatArray, least: float, surface: _native.Surface, threads: int) -> Balls:
    """Balls that drift, but are held where they go against their drift: there the way out is narrowest.

    Most find no throat but the bottom of a crease, where they become smaller than `least`.
    """
    against = drifts / np.sqrt(dots(drifts, drifts))[:, None]
    for step, times, most in [*((step, 2 * PUSHES, STRAY) for step in STEPS[1:]), (STEPS[-1], MORE, LARGEST_DRIFT)]:
        _, ways, share = _pushed_by(step, times, balls, against, surface, threads, least)
        balls = Balls(ends := balls.centres + ways, surface.distance(ends, threads))
        stay = (share <= most) & (balls.radii >= least)
        balls, against = balls.some(stay), against[stay]
    return balls


def _pushed_by(
    step: float, times: int, balls: Balls, against: FloatArray, surface: _native.Surface, threads: int, least: float = 0
) -> tuple[Balls, FloatArray, FloatArray]:
    """The best balls on the ways of pushed ones, the ways from begin to end, and their share of a straight way."""
    size = step * balls.radii
    best, radii, ends = surface.pushed(balls.centres, against, size, times, least, threads)
    ways = ends - balls.centres
    return Balls(best, radii), ways, np.sqrt(dots(ways, ways)) / (times * size)


def spread(balls: Balls, spacing: float) -> Balls:
    """Leave out balls within a share of their own radius of one that is as large; the ends of passages come first."""
    balls = balls.some(np.argsort(-balls.radii, kind="stable"))
    away, chosen = np.full(len(balls), np.inf), []
    while len(balls) and away[farthest := int(away.argmax())] >= spacing:
        chosen.append(farthest)
        way = balls.centres - balls.centres[farthest]
        nearer = np.minimum(away, np.sqrt(dots(way, way)) / balls.radii)
        away = np.where(balls.radii <= ALIKE * balls.radii[farthest], nearer, away)
        away[farthest] = -1.0
    return balls.some(np.array(chosen, dtype=np.intp))


def _one_a_cell(balls: Balls, spacing: float) -> NDArray[np.intp]:
    """Numbers of the largest of those of about one size in each cell, which lie within that share of their radius."""
    order = np.argsort(-balls.radii, kind="stable")
    _, size = np.frexp(balls.radii[order])  # a radius of 0.5 to 1 times a power of 2
    cells = np.floor(balls.centres[order] / np.ldexp(spacing / (2 * np.sqrt(3)), size)[:, None]).astype(np.int64)
    x, y, z = cells.T + (1 << 17)
    return order[np.unique(((x << 18 | y) << 18 | z) << 6 | (size & 63), return_index=True)[1]]
