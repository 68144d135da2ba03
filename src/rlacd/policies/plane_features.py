"""Features of a plane, its neighbours and its component, which networks get from the sweep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.planes.sweep import Sweep, paper_planes, sweep, valid_planes
from rlacd.policies.greedy import EXPONENT, excess_norm
from rlacd.solid.arrays import BoolArray, Float32Array, FloatArray
from rlacd.solid.component import NEGLIGIBLE_VOLUME as TINY
from rlacd.solid.component import Component

STEPS = (1, 2)
"""Distances of the neighbours that are looked at, in planes of the same direction."""

FEATURES = 38

GREATEST_FEATURE = 8.0
"""No feature is larger, whatever the mesh; ordinary ones are at most 5."""


def plane_features(
    s: Sweep, valid: BoolArray, hull: float, volume: float, box: FloatArray, length: float | None
) -> FloatArray:
    """Features [K * M, F] of candidate planes; they stay the same if below and above change places.

    Parameters
    ----------
    s : Sweep
        The sweep of 25 planes along each of 6 directions, then those of reflex edges.
    valid : bool [K * M]
    hull, volume : float
        Volumes of the component's hull and of the component.
    box : float [3]
        Extents of the component's box.
    length : float, optional
        The criterion's length, if it has one.
    """
    longest, excess = float(box.max()), max(hull - volume, TINY)
    below, above = np.maximum(s.hull_below - s.solid_below, 0), np.maximum(s.hull_above - s.solid_above, 0)
    small, large = np.minimum(below, above), np.maximum(below, above)
    cost = excess_norm(s) / _native.powers(np.array([excess]), EXPONENT)
    saved = (s.hull_below + s.hull_above - volume) / excess
    lowest = cost[valid].min() if valid.any() else 0.0
    area, round_ = s.section_area / longest**2, 4 * np.pi * s.section_area / np.maximum(s.section_perimeter, TINY) ** 2
    fill = np.stack([s.solid_below / np.maximum(s.hull_below, TINY), s.solid_above / np.maximum(s.hull_above, TINY)])
    scale = length or 0.05
    planes, along = np.arange(len(cost)), 6 * OFFSETS_PER_AXIS
    axes = np.where(planes < along, planes // OFFSETS_PER_AXIS, planes)
    columns = [
        *(small / excess, large / excess, saved, cost, _native.logarithms((cost + 1e-3) / (lowest + 1e-3))),
        _rank(np.where(valid, cost, np.inf)),
        _rank(np.where(valid, saved, np.inf)),
        _rank(np.where(valid, large, np.inf)),
        *(np.minimum(s.solid_below, s.solid_above) / max(volume, TINY), np.minimum(s.hull_below, s.hull_above) / hull),
        *(area, s.section_perimeter / longest, round_, fill.min(axis=0), fill.max(axis=0)),
        np.minimum(s.thickness_below, s.thickness_above) / np.maximum(s.thickness_below + s.thickness_above, TINY),
        _native.logarithms(_native.cube_roots(small) / scale + 0.01),
        _native.logarithms(_native.cube_roots(large) / scale + 0.01),
        *_neighbours(cost, axes),
        *_neighbours(area, axes),
        *_neighbours(np.minimum(fill[0], fill[1]), axes),
    ]
    wide, long = _native.logarithms(np.array([_native.cube_roots(np.array([excess]))[0], longest]) / scale)
    own = [
        *(wide, volume / hull, *(np.sort(box)[:2] / longest), long),
        *(float(length is None), valid.mean(), lowest),
    ]
    return np.column_stack([*columns, np.tile(own, (len(cost), 1))]).clip(-GREATEST_FEATURE, GREATEST_FEATURE)


def _rank(cost: FloatArray) -> FloatArray:
    rank = np.empty(len(cost))
    rank[np.argsort(cost, kind="stable")] = np.arange(len(cost))
    return rank / len(cost)


def _neighbours(values: FloatArray, axes: NDArray[np.intp]) -> list[FloatArray]:
    """Least and greatest difference from the neighbours at each distance; 0 for planes that have none."""
    found: list[FloatArray] = []
    for step in STEPS:
        gaps = np.zeros((2, len(values)))
        same = axes[step:] == axes[:-step]
        gaps[0, :-step] = np.where(same, values[step:] - values[:-step], 0)
        gaps[1, step:] = np.where(same, values[:-step] - values[step:], 0)
        found += [gaps.min(axis=0), gaps.max(axis=0)]
    return found


PLANES = 6 * OFFSETS_PER_AXIS


def sweep_features(component: Component, threshold: float) -> Float32Array:
    """Features [150, 38] of the paper's planes of a component; they depend on nothing else.

    Parameters
    ----------
    threshold : float
        The criterion's length in the frame.
    """
    planes = paper_planes(component)
    scored, valid, box = sweep(component, planes), valid_planes(component, planes), np.ptp(component.box, axis=0)
    return plane_features(scored, valid, component.hull.volume, component.volume, box, threshold).astype(np.float32)
