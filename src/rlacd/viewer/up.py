"""Which axis points up in files of formats that do not say it: a guess, for looking only."""

from __future__ import annotations

import numpy as np

from rlacd.options.output import Axis
from rlacd.solid.input_mesh import InputMesh

SAY_NOTHING = (".obj", ".stl", ".ply", ".off", ".xyz")
"""Formats that say nothing of directions: programs for drawing write y up, programs for machines z."""

NEAR = 0.005
"""How far from the ground a mesh may stand, as a share of its longest side."""


def guessed_up(mesh: InputMesh) -> Axis:
    """Guess y if the mesh stands on y = 0 and not on z = 0, else z, which files are taken for elsewhere."""
    points = mesh.vertices[np.unique(mesh.faces)] if len(mesh.faces) else mesh.vertices
    low = points.min(axis=0)
    stands = np.abs(low) <= NEAR * (points.max(axis=0) - low).max()
    return "y" if stands[1] and not stands[2] else "z"
