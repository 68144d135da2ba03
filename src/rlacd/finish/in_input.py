"""Hulls in the input's unit, where coordinates may resolve less than in the frame."""

from __future__ import annotations

import itertools

import numpy as np
import trimesh

from rlacd.options.navigable import LARGEST_COORDINATE
from rlacd.options.presets import HullLimits
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.frame import Frame
from rlacd.solid.hull import NO_LIMITS, TOLERANCE, Hull, keeps
from rlacd.solid.primitive import PRIMITIVE

_LARGEST = float(np.finfo(np.float64).max)


def in_input(hull: Hull, frame: Frame, limits: HullLimits = NO_LIMITS) -> trimesh.Trimesh:
    """Carry a hull from the frame to the input's unit: vertices are rounded first, so the result is exactly convex.

    Parameters
    ----------
    hull : Hull
        In the frame, inside the limits.
    frame : Frame
    limits : HullLimits, optional
        For the replacement of a hull that is thinner than the coordinates can resolve.

    Returns
    -------
    trimesh.Trimesh
        Convex and closed, with positive volume. If the hull stands for a primitive, ``metadata`` describes it.
    """
    with np.errstate(over="ignore"):  # a limited hull can reach beyond the input, and so beyond the largest number
        points = np.clip(frame.to_input(hull.vertices), -_LARGEST, _LARGEST)
    there = Hull.of(points)
    if there is None:
        there = _thickened(points, limits)
    metadata = {} if hull.primitive is None else {PRIMITIVE: hull.primitive.in_input(frame).as_plain()}
    return trimesh.Trimesh(there.vertices, there.faces, process=False, metadata=metadata)


def as_carried(part: Part, there: trimesh.Trimesh, frame: Frame) -> Part:
    """Get the part with the hull that `in_input` made of its own, in the frame: what has to be measured.

    The same part if no vertex moved by more than `TOLERANCE`, as always unless the coordinates resolve little.
    """
    points = frame.to_frame(there.vertices)
    if part.hull.primitive is not None or np.abs(points).max() > LARGEST_COORDINATE:
        return part
    if points.shape == part.hull.vertices.shape and np.abs(points - part.hull.vertices).max() <= TOLERANCE:
        return part
    if all(np.abs(part.hull.vertices - point).max(axis=1).min() <= TOLERANCE for point in points):
        return part
    hull = Hull.of(points)
    return part if hull is None else part.with_hull(hull)


def _thickened(points: FloatArray, limits: HullLimits) -> Hull:
    """A hull of flat points [N, 3] that has a volume and is within the limits."""
    step = _step(points)
    lower, upper = np.maximum(points, step - _LARGEST) - step, np.minimum(points, _LARGEST - step) + step
    corners = itertools.product(*zip(lower.T, upper.T, strict=True))
    hull = Hull.of(np.concatenate([np.stack(corner, axis=1) for corner in corners]))
    return hull if hull is not None and keeps(hull, limits) else plain_hull(points, limits)


def plain_hull(points: FloatArray, limits: HullLimits) -> Hull:
    """Get a box around points [N, 3], or a tetrahedron if a box has too many vertices or triangles."""
    hull = Hull.of(_box_around(points) if limits.allow(vertices=8, faces=12) else _tetrahedron_around(points))
    assert hull is not None
    return hull


def _box_around(points: FloatArray) -> FloatArray:
    """Corners [8, 3] of a box around the points, padded on every side by the resolution of their largest coordinate.

    One floating-point step along an axis may vanish next to a large coordinate on another axis.
    """
    step = _step(points)
    lower = np.maximum(points.min(axis=0), step - _LARGEST) - step
    upper = np.minimum(points.max(axis=0), _LARGEST - step) + step
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))


def _step(points: FloatArray) -> float:
    """The resolution of the points' largest coordinate."""
    limits = np.finfo(np.float64)
    return float(np.abs(points).max() * limits.eps + limits.smallest_subnormal)


def _tetrahedron_around(points: FloatArray) -> FloatArray:
    """Corners [4, 3] of a tetrahedron around that box: one of its corners and three on the extended edges."""
    box = _box_around(points)
    lower, upper = box[0], box[-1]
    to_lower = lower / 2 + upper / 2 > 0  # edges lead towards the origin, where coordinates do not overflow
    corner, edge = np.where(to_lower, upper, lower), np.where(to_lower, lower - upper, upper - lower)
    # 1/4 + 1/4 + 1/4 < 1: the far corner of the box stays inside in spite of rounding.
    return np.concatenate([corner[None], corner + np.diag(4 * edge)])
