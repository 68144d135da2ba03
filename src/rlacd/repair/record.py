"""What repair does to each body of an input: the step it needed, and how far its surface and the input's deviate."""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery, affordable, points_covering, shared_faces
from rlacd.repair.voxels import DEFAULT_GAP
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.solid import BodyRepair
from rlacd.solid.topology import BoolArray, IntArray, face_areas, marked

STEPS = ("closed", "reoriented", "outer skin", "welded", "capped", "slab", "wrapped", "hull")
"""The possible steps for a body, from the least change to the most."""


class Record:
    """The repairs of all bodies so far.

    Parameters
    ----------
    bodies : int
    body_of_input : int64 [F]
        The body of each face of the input.

    Attributes
    ----------
    step : int64 [bodies]
        The step that changed a body most, an index of `STEPS`.
    beyond, lost : float64 [bodies]
        Greatest distance of the repaired surface from the input's, and of the input's outside the solid from it.
    """

    def __init__(self, bodies: int, body_of_input: IntArray) -> None:
        self.bodies = bodies
        self.body_of_input = body_of_input
        self.step = np.zeros(bodies, dtype=np.int64)
        self.beyond, self.lost = np.zeros((2, bodies))

    @property
    def deviation(self) -> FloatArray:
        """Greatest distance between the repaired surface and the input's: float64 ``[bodies]``."""
        return np.maximum(self.beyond, self.lost)

    def note(self, bodies: IntArray, step: str) -> None:
        """Record a step; a body keeps the one that changes it most."""
        noted = marked(bodies, self.bodies)
        self.step[noted] = np.maximum(self.step[noted], STEPS.index(step))

    def has(self, step: str) -> BoolArray:
        """Return ``[bodies]`` whether this is the step of a body."""
        return np.asarray(self.step == STEPS.index(step))

    def rows(self, faces_out: IntArray) -> tuple[BodyRepair, ...]:
        """One row per body, given the triangles ``[bodies]`` after the repair."""
        faces_in = np.bincount(self.body_of_input, minlength=self.bodies)
        rows = zip(self.step.tolist(), faces_in.tolist(), faces_out.tolist(), self.deviation.tolist(), strict=True)
        return tuple(BodyRepair(i, STEPS[s], a, b, d) for i, (s, a, b, d) in enumerate(rows))


def measure(record: Record, surface: SurfaceQuery, solid: SurfaceQuery) -> IntArray:
    """Record, for the changed bodies, how far the solid and the input deviate; returns faces that lead out of it."""
    if record.step.max() < STEPS.index("outer skin"):
        return np.empty(0, dtype=np.int64)
    kept, taken_over = shared_faces(solid.vertices, solid.faces, surface.vertices, surface.faces)
    poll_stop()
    own = solid.faces[~kept]
    points, _ = points_covering(
        solid.vertices, own, affordable(DEFAULT_GAP, float(face_areas(solid.vertices, own).sum()))
    )
    closest, face = surface.closest(points)
    np.maximum.at(record.beyond, record.body_of_input[face], np.linalg.norm(points - closest, axis=1))

    replaced = np.flatnonzero((record.step[record.body_of_input] >= STEPS.index("outer skin")) & ~taken_over)
    faces = surface.faces[replaced]
    spacing = affordable(DEFAULT_GAP, float(face_areas(surface.vertices, faces).sum()))
    points, on = points_covering(surface.vertices, faces, spacing)
    distance = solid.distance(points)
    lost = np.flatnonzero(distance > 2 * HALF_THICKNESS)  # the middle of a slab is half as far from its surface
    lost = lost[~solid.inside(points[lost])]
    np.maximum.at(record.lost, record.body_of_input[replaced[on[lost]]], distance[lost])
    corners = np.unique(faces[_native.longest_edges(surface.vertices, faces) <= spacing])  # the first of the points
    is_out = marked(corners[lost[lost < len(corners)]], len(surface.vertices))
    leads_out = np.asarray(is_out[faces].any(axis=1))
    leads_out[on[lost]] = True
    return replaced[leads_out]
