"""How far a repaired solid and its input deviate from each other."""

from __future__ import annotations

import numpy as np

from rlacd._native import PointTree, poll_stop
from rlacd.repair.distance import SurfaceQuery, points_covering, shared_faces
from rlacd.repair.record import STEPS, Record
from rlacd.repair.voxels import GAP
from rlacd.solid.frame import FloatArray
from rlacd.solid.thickness import HALF_THICKNESS
from rlacd.solid.topology import BoolArray


def measure(record: Record, surface: SurfaceQuery, solid: SurfaceQuery) -> tuple[float, FloatArray, int]:
    """Record, for the changed bodies, how far the solid and the input deviate from each other.

    Returns how far what a capped body lost lies from the solid, or a wrapped one if that is more than two balls' radii;
    the place, and the body.
    """
    if record.step.max() < STEPS.index("outer skin"):
        return 0.0, np.zeros(3), 0
    kept, taken_over = shared_faces(solid.vertices, solid.faces, surface.vertices, surface.faces)
    poll_stop()
    points, _ = points_covering(solid.vertices, solid.faces[~kept], GAP)
    closest, face = surface.closest(points)
    np.maximum.at(record.deviation, record.body_of_input[face], np.linalg.norm(points - closest, axis=1))

    changed = np.flatnonzero((record.step[record.body_of_input] >= STEPS.index("outer skin")) & ~taken_over)
    points, on = points_covering(surface.vertices, surface.faces[changed], GAP)
    distance = solid.distance(points)
    lost = np.flatnonzero(distance > 2 * HALF_THICKNESS)
    lost = lost[~inside_by_balls(solid, points[lost], distance[lost])]
    body = record.body_of_input[changed[on[lost]]]
    np.maximum.at(record.deviation, body, distance[lost])
    is_capped, is_wrapped = (record.step[body] == STEPS.index(step) for step in ("capped", "wrapped"))
    counts = np.flatnonzero(is_capped | (is_wrapped & (distance[lost] > 2 * GAP)))
    if len(counts) == 0:
        return 0.0, np.zeros(3), 0
    worst = counts[distance[lost[counts]].argmax()]
    return float(distance[lost[worst]]), points[lost[worst]], int(body[worst])


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
