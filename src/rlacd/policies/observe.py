"""The 150 planes of the paper, which of them are valid, and points of a component's surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.planes.candidates import OFFSETS_PER_AXIS, Candidates, axis_and_principal
from rlacd.planes.sweep import SLIVER
from rlacd.solid.arrays import BoolArray
from rlacd.solid.component import Component

Float32Array = NDArray[np.float32]


def paper_planes(component: Component) -> Candidates:
    """The paper's 150 planes: 25 a direction about the centre of the component's box, 1/25 of its longest side apart.

    Along a shorter side, the outer ones miss the component; they are not valid.
    """
    lower, upper = component.box
    directions = axis_and_principal(component).directions
    steps = (np.arange(OFFSETS_PER_AXIS) - OFFSETS_PER_AXIS // 2) / OFFSETS_PER_AXIS * float((upper - lower).max())
    return Candidates(directions, (directions @ ((lower + upper) / 2))[:, None] + steps)


def surface_points(component: Component, count: int) -> Float32Array:
    """Points on the surfaces of a component and of its hull [2, count, 3]; box centred, longest side 2.

    The same component gives the same points.
    """
    lower, upper = component.box
    shapes = (component, component.hull)
    points = np.stack([_native.sample_surface(shape.vertices, shape.faces, count, 0)[0] for shape in shapes])
    seen: Float32Array = ((points - (lower + upper) / 2) / (float((upper - lower).max()) / 2)).astype(np.float32)
    return seen


def valid_planes(component: Component, candidates: Candidates) -> BoolArray:
    """Whether each of the candidates [K * M] leaves no side thinner than 2 % of the component's extent.

    The component is connected, so every plane within its extent meets it, and the thickness of a side is the plane's
    distance from that end: no sweep is needed. This is slightly stricter than `Sweep.valid`, which compares a side with
    its own extent. If no plane is valid, as in a thin sheet, the limit is lowered to a hundredth.
    """
    heights = component.hull.vertices @ candidates.directions.T
    lower, upper = heights.min(axis=0), heights.max(axis=0)
    extent = float((upper - lower).max())
    thinner = np.minimum(candidates.offsets - lower[:, None], upper[:, None] - candidates.offsets).ravel()
    for sliver in (SLIVER, SLIVER / 100):
        valid: BoolArray = thinner > sliver * extent
        if valid.any():
            break
    return valid
