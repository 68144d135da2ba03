"""Observations of a component for Q networks: surface and hull points, candidate planes, and which are valid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.concavity import VOLUME_WEIGHT, volume_radius
from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.concave_edges import reflex_edges
from rlacd.planes.sweep import SLIVER
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Component

Float32Array = NDArray[np.float32]

SCALE_INPUTS = 10
"""Length of `Observation.scale`."""


@dataclass(frozen=True, eq=False)
class Observation:
    """The partial observation s(m) of one component.

    Attributes
    ----------
    points : float32 [2, N, 3]
        Points on the surfaces of the component and of its hull, in a frame where the component's bounding box is
        centred and its longest side is 2.
    directions : float32 [6, 3]
        Unit normals of the candidate planes: the coordinate axes, then the principal axes.
    scale : float32 [10]
        What that frame hides: log2 of half the longest side of the component's box in the solid's frame, 0.3 R_v over
        the threshold, and the share of its hull that the component fills. Then the box's proportions, and its reflex
        edges (`creases`).
    mask : bool [150]
        Which planes are valid.
    """

    points: Float32Array
    directions: Float32Array
    scale: Float32Array
    mask: BoolArray


def observe(component: Component, candidates: Candidates, threshold: float, count: int, seed: int = 0) -> Observation:
    """Observe a component; the same component and seed give the same points.

    Parameters
    ----------
    candidates : Candidates
        Candidates of this component, from `axis_and_principal`.
    threshold : float
        The criterion's threshold, in the solid's frame.
    count : int
        Number of points on each of the two surfaces.
    """
    lower, upper = component.box
    radius = float((upper - lower).max()) / 2
    hull = component.hull
    points = np.stack(
        [
            _native.sample_surface(component.vertices, component.faces, count, seed)[0],
            _native.sample_surface(hull.vertices, hull.faces, count, seed)[0],
        ]
    )
    relative = VOLUME_WEIGHT * volume_radius(component.volume, hull.volume) / threshold
    shape = np.sort(upper - lower)[:2] / (2 * radius)
    scale = [np.log2(radius), relative, component.volume / hull.volume, *shape, *creases(component, threshold)]
    return Observation(
        ((points - (lower + upper) / 2) / radius).astype(np.float32),
        candidates.directions.astype(np.float32),
        np.array(scale, dtype=np.float32),
        valid_planes(component, candidates),
    )


def creases(component: Component, threshold: float) -> FloatArray:
    """Sums over the reflex edges [5], as log(1 + x): what a component's parts are best predicted by.

    Number; length times angle; number, and length times angle, of those deeper below the hull than the threshold;
    greatest depth. Lengths are relative to the box's longest side, depths to the threshold.
    """
    edges, hull = reflex_edges(component), component.hull
    if not len(edges):
        return np.zeros(5)
    corners = hull.vertices[hull.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals, corners = normals[length > 0] / length[length > 0, None], corners[length > 0, 0]
    ends = component.vertices[edges.ends]
    depth = ((normals * corners).sum(axis=1) - ends.mean(axis=1) @ normals.T).min(axis=1) / threshold
    size = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) * edges.angle / np.ptp(component.box, axis=0).max()
    deep = depth > 1
    sums: FloatArray = np.log1p([len(edges), size.sum(), deep.sum(), size[deep].sum(), max(depth.max(), 0)])
    return sums


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


def candidates_of(component: Component) -> Candidates:
    """Get the paper's 150 planes, from which a Q network chooses."""
    return axis_and_principal(component)
