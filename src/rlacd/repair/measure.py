"""How far a repaired solid and its input deviate from each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import PointTree, poll_stop
from rlacd.repair.distance import (
    SurfaceQuery,
    affordable,
    once_in_each_place,
    points_covering,
    shared_faces,
    spread_points,
)
from rlacd.repair.record import STEPS, Record
from rlacd.repair.voxels import GAP
from rlacd.solid.frame import FloatArray
from rlacd.solid.thickness import HALF_THICKNESS
from rlacd.solid.topology import BoolArray, IntArray, face_areas, marked

# Farther away from a solid, what is outside is lost: the middle of a slab is half as far from its surface.
_OFF = 2 * HALF_THICKNESS
# Between corners this many times nearer than the gap, nothing is looked for.
_BETWEEN = 3


class Measured(NamedTuple):
    """How well a solid stands for its input.

    Attributes
    ----------
    depth : float
        How far what a capped body lost lies from the solid, or a wrapped one if that is more than two balls' radii.
    at : float64 [3]
        Where.
    body : int
        Of which body.
    outside : int64 [N]
        Faces of the input that lead out of the solid.
    doubted : int64 [N]
        Those that may do so although their corners do not.
    """

    depth: float
    at: FloatArray
    body: int
    outside: IntArray
    doubted: IntArray


def measure(record: Record, surface: SurfaceQuery, solid: SurfaceQuery) -> Measured:
    """Record, for the changed bodies, how far the solid and the input deviate from each other."""
    found = Measured(0.0, np.zeros(3), 0, *np.empty((2, 0), dtype=np.int64))
    if record.step.max() < STEPS.index("outer skin"):
        return found
    kept, taken_over = shared_faces(solid.vertices, solid.faces, surface.vertices, surface.faces)
    poll_stop()
    own = solid.faces[~kept]
    points, _ = points_covering(solid.vertices, own, affordable(GAP, float(face_areas(solid.vertices, own).sum())))
    closest, face = surface.closest(points)
    np.maximum.at(record.beyond, record.body_of_input[face], np.linalg.norm(points - closest, axis=1))

    replaced = np.flatnonzero((record.step[record.body_of_input] >= STEPS.index("outer skin")) & ~taken_over)
    faces = surface.faces[replaced]
    spacing = affordable(GAP, float(face_areas(surface.vertices, faces).sum()))
    points, on = points_covering(surface.vertices, faces, spacing)
    distance = solid.distance(points)
    lost = _outside(solid, points, distance)
    longest = _native.longest_edges(surface.vertices, faces)
    corners = np.unique(faces[longest <= spacing])  # the first of the points
    is_out = marked(corners[lost[lost < len(corners)]], len(surface.vertices))
    leads_out = np.asarray(is_out[faces].any(axis=1))
    leads_out[on[lost]] = True
    doubted = ~leads_out & (longest > GAP / _BETWEEN) & (longest <= spacing)
    found = found._replace(outside=replaced[leads_out], doubted=replaced[doubted])

    body = record.body_of_input[replaced[on[lost]]]
    np.maximum.at(record.lost, body, distance[lost])
    is_capped, is_wrapped = (record.step[body] == STEPS.index(step) for step in ("capped", "wrapped"))
    counts = np.flatnonzero(is_capped | (is_wrapped & (distance[lost] > 2 * GAP)))
    if len(counts) == 0:
        return found
    worst = counts[distance[lost[counts]].argmax()]
    return found._replace(depth=float(distance[lost[worst]]), at=points[lost[worst]], body=int(body[worst]))


def faces_outside(measured: Measured, surface: SurfaceQuery, solid: SurfaceQuery) -> IntArray:
    """Return the faces of the input that lead out of the solid."""
    doubted = measured.doubted
    faces = surface.faces[doubted]
    points, on = spread_points(surface.vertices, faces, GAP / _BETWEEN)
    is_corner = (points[:, None] == surface.vertices[faces[on]]).all(axis=2).any(axis=1)  # which were looked at
    points, on = points[~is_corner], on[~is_corner]

    def is_outside(points: FloatArray) -> BoolArray:
        return marked(_outside(solid, points, solid.distance(points)), len(points))

    outside = once_in_each_place(is_outside, points)
    return np.concatenate([measured.outside, doubted[np.unique(on[outside])]])


def _outside(solid: SurfaceQuery, points: FloatArray, distance: FloatArray) -> IntArray:
    """Return which of some points are lost, given their distances from the solid."""
    away = np.flatnonzero(distance > _OFF)
    return away[~inside_by_balls(solid, points[away], distance[away])]


def inside_by_balls(solid: SurfaceQuery, points: FloatArray, distance: FloatArray) -> BoolArray:
    """Return ``[N]`` whether a closed surface winds around points at known distances from it.

    A ball around a point up to the surface lies on one side of it, with all points in it.
    """
    ball = np.full(len(points), -1, dtype=np.int64)
    centers: list[int] = []
    tree = PointTree(points)
    for i in np.argsort(-distance, kind="stable").tolist():
        if ball[i] < 0:
            _, near = tree.within(points[i : i + 1], 0.99 * distance[i : i + 1])
            ball[near] = len(centers)
            centers.append(i)
    return solid.inside(points[centers])[ball]
