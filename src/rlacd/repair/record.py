"""What repair does to each body of an input: the step it needed, how far its surface moved, its triangles."""

from __future__ import annotations

import numpy as np

from rlacd.solid.frame import FloatArray
from rlacd.solid.solid import BodyRepair
from rlacd.solid.topology import BoolArray, IntArray, marked

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
    faces_out : int64 [bodies]
        Triangles after the repair.
    """

    def __init__(self, bodies: int, body_of_input: IntArray) -> None:
        self.bodies = bodies
        self.body_of_input = body_of_input
        self.step = np.zeros(bodies, dtype=np.int64)
        self.beyond, self.lost = np.zeros((2, bodies))
        self.faces_out = np.zeros(bodies, dtype=np.int64)

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

    def rows(self) -> tuple[BodyRepair, ...]:
        """One row per body."""
        faces_in = np.bincount(self.body_of_input, minlength=self.bodies)
        rows = zip(self.step.tolist(), faces_in.tolist(), self.faces_out.tolist(), self.deviation.tolist(), strict=True)
        return tuple(BodyRepair(i, STEPS[s], a, b, d) for i, (s, a, b, d) in enumerate(rows))
