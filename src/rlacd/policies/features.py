"""The plane ranker's inputs: a component's sweep, normalised for size and arranged by direction.

Lengths are given twice: relative to the component, and relative to the criterion's scale. Only the latter shows how
far a side is from being done.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.concavity import VOLUME_WEIGHT
from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.concave_edges import concave_edge_planes
from rlacd.planes.sweep import SLIVER, Sweep
from rlacd.policies.greedy import EXPONENT
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Component

VERSION = 2
"""Version of the features; weights for another version are rejected."""

SWEEP_COLUMNS = (
    "hull_below",
    "hull_above",
    "solid_below",
    "solid_above",
    "section_area",
    "section_perimeter",
    "thickness_below",
    "thickness_above",
    "extent_below",
    "extent_above",
)

MIRRORED = (1, 0, 3, 2, 5, 4, 7, 6, 9, 8, 11, 10, 13, 12, 14, 15, 16, 17, 18, 19, 20, 21)
"""Permutation of the plane features when a direction is reversed: *below* and *above* are swapped."""

DIRECTIONS = 6

CONCAVE_EDGES = 4
EDGE_PLANES = 3 * CONCAVE_EDGES
"""Maximum number of planes that the concave edges add."""

PLANE_FEATURES = len(MIRRORED)
COMPONENT_FEATURES = 10

Features = NDArray[np.float32]

_TINY = 1e-30


def candidates_of(component: Component, per_axis: int) -> Candidates:
    """Get the planes to rank: `per_axis` along each of six directions, then those of up to four concave edges."""
    return Candidates.joined(axis_and_principal(component, per_axis), concave_edge_planes(component, CONCAVE_EDGES))


def planes_per_axis(s: Sweep) -> int:
    """Count the planes per direction of a sweep over `candidates_of`: those along x come first."""
    other = (s.candidates.directions != s.candidates.directions[0]).any(axis=1)
    return int(np.argmax(other))


def tables(s: Sweep) -> tuple[FloatArray, FloatArray]:
    """Get a sweep over `candidates_of` as arrays with the columns of `SWEEP_COLUMNS`.

    Returns
    -------
    grid : float64 [6, per_axis, 10]
    edges : float64 [12, 10]
        Planes of concave edges; padded with zeros, as for planes that miss the solid.
    """
    per_axis = planes_per_axis(s)
    table = np.stack([getattr(s, name) for name in SWEEP_COLUMNS], axis=-1)
    planes = DIRECTIONS * per_axis
    edges = np.zeros((EDGE_PLANES, len(SWEEP_COLUMNS)))
    edges[: len(table) - planes] = table[planes:]
    return table[:planes].reshape(DIRECTIONS, per_axis, len(SWEEP_COLUMNS)), edges


def measures(component: Component) -> FloatArray:
    """Get the component's hull volume, volume, surface area and hull area [4]."""
    hull = component.hull
    return np.array(
        [
            hull.volume,
            component.volume,
            _native.mesh_area(component.vertices, component.faces),
            _native.mesh_area(hull.vertices, hull.faces),
        ]
    )


def features(
    grid: FloatArray, edges: FloatArray, whole: FloatArray, scale: FloatArray
) -> tuple[Features, Features, Features]:
    """Compute the network's inputs for B components.

    Parameters
    ----------
    grid : float64 [B, 6, M, 10]
    edges : float64 [B, 12, 10]
        Sweeps, see `tables`.
    whole : float64 [B, 4]
        See `measures`.
    scale : float64 [B]
        The criterion's length: a part is roughly done when it deviates from its hull by no more than this.

    Returns
    -------
    planes : float32 [B, 6, 22, M]
        One column per plane. Reversing a direction reverses M and permutes the features by `MIRRORED`.
    edges : float32 [B, 12, 22]
    component : float32 [B, 10]
    """
    hull, solid, area, hull_area = whole.T
    length = np.cbrt(hull)
    costs = [cost[..., None] for cost in _greedy_costs(grid, hull[:, None, None])]
    thickness = (grid[..., 6] + grid[..., 7]).max(axis=2)  # extent of the component along each direction
    extent = np.maximum(thickness.max(axis=1), _TINY)
    valid = _valid(grid)
    usable = valid | np.logical_not(valid.any(axis=(1, 2), keepdims=True))
    least = [np.where(usable[..., None], cost, np.inf).min(axis=(1, 2))[:, 0] for cost in costs]
    excess = np.maximum(hull - solid, 0)
    component = np.stack(
        [
            np.log(length / scale),
            np.log(VOLUME_WEIGHT * np.cbrt(0.75 / np.pi * excess) / scale + 0.01),
            solid / hull,
            np.log(area / length**2),
            np.log(hull_area / length**2),
            np.log(extent / scale),
            np.log(thickness.min(axis=1) / extent + 1e-3),
            np.log(solid / area / scale),
            np.maximum(least[0] - np.log(excess + 1e-6 * hull), -4),
            np.maximum(4 * (least[1] - np.log(hull)), -4),
        ],
        axis=1,
    )
    planes = _of_planes(grid, [x[:, None, None] for x in (hull, extent, scale, *least)])
    singles = _of_planes(edges, [x[:, None] for x in (hull, extent, scale, *least)])
    return (
        np.ascontiguousarray(np.moveaxis(planes, -1, -2), np.float32),
        np.ascontiguousarray(singles, np.float32),
        np.ascontiguousarray(component, np.float32),
    )


def _valid(table: FloatArray) -> BoolArray:
    _, _, sb, sa, _, _, tb, ta, eb, ea = np.moveaxis(table, -1, 0)
    valid: BoolArray = (sb > 0) & (sa > 0) & (tb > SLIVER * eb) & (ta > SLIVER * ea)
    return valid


def _greedy_costs(table: FloatArray, hull: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithms of three greedy scores: p-norm of the excesses, sum of the hull volumes, larger excess."""
    hb, ha, sb, sa = np.moveaxis(table[..., :4], -1, 0)
    below, above = np.maximum(hb - sb, 0), np.maximum(ha - sa, 0)
    norm = np.log(below**EXPONENT + above**EXPONENT + (1e-6 * hull) ** EXPONENT) / EXPONENT
    return norm, np.log(hb + ha + _TINY), np.log(np.maximum(below, above) + 1e-6 * hull)


def _of_planes(table: FloatArray, of_component: Sequence[FloatArray]) -> FloatArray:
    """Features [..., 22] of planes, from their sweep [..., 10]."""
    hull, extent, unit, *least = of_component
    hb, ha, sb, sa, section, perimeter, tb, ta, eb, ea = np.moveaxis(table, -1, 0)
    length = np.cbrt(hull)
    below, above = np.maximum(hb - sb, 0), np.maximum(ha - sa, 0)
    norm, total, worst = _greedy_costs(table, hull)
    return np.stack(
        [
            hb / hull,
            ha / hull,
            2 * np.clip(sb / hull, 0, 1),
            2 * np.clip(sa / hull, 0, 1),
            np.sqrt(below / hull),
            np.sqrt(above / hull),
            _squash(VOLUME_WEIGHT * np.cbrt(0.75 / np.pi * below) / unit),
            _squash(VOLUME_WEIGHT * np.cbrt(0.75 / np.pi * above) / unit),
            _squash(tb / unit / 4),
            _squash(ta / unit / 4),
            eb / extent,
            ea / extent,
            np.clip(sb / np.maximum(hb, _TINY), 0, 1),
            np.clip(sa / np.maximum(ha, _TINY), 0, 1),
            (hull - hb - ha) / hull * 2,
            np.minimum(section / length**2, 4),
            np.minimum(perimeter / length / 4, 4),
            (tb + ta) / extent,
            _valid(table).astype(np.float64),
            np.clip(norm - least[0], -3, 3),
            np.clip(4 * (total - least[1]), -3, 3),
            np.clip(worst - least[2], -3, 3),
        ],
        axis=-1,
    )


def _squash(x: FloatArray) -> FloatArray:
    """Map [0, inf) to [0, 2), with 1 fixed."""
    return 2 * x / (1 + x)
