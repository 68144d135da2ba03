"""What the guide network sees of a component: its sweep, made comparable between sizes and between directions.

Lengths are given twice: relative to the component, and relative to the criterion's scale. Only the second tells how
far from being done a side would be.
"""

from __future__ import annotations

import numpy as np

from rlacd import _native
from rlacd.planes.sweep import SLIVER, Sweep
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Component

VERSION = 1
"""Of the features; weights made for another version are refused."""

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
"""Where each plane feature goes when a direction is reversed: *below* and *above* change places."""

PLANE_FEATURES = len(MIRRORED)
COMPONENT_FEATURES = 10

_TINY = 1e-30
_P = 1.3  # of the greedy score that is an input


def sweep_table(s: Sweep) -> FloatArray:
    """Get the sweep as one array [K, M, 10], its columns in the order of `SWEEP_COLUMNS`."""
    table = np.stack([getattr(s, name) for name in SWEEP_COLUMNS], axis=-1)
    return table.reshape(*s.candidates.offsets.shape, len(SWEEP_COLUMNS))


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


def features(table: FloatArray, whole: FloatArray, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the network's inputs for B components.

    Parameters
    ----------
    table : float64 [B, K, M, 10]
        Sweeps, see `sweep_table`.
    whole : float64 [B, 4]
        See `measures`.
    scale : float64 [B]
        The criterion's length: a part is about done when it deviates from its hull by no more.

    Returns
    -------
    planes : float32 [B, K, 22, M]
        One column a plane. Reversing a direction reverses M and permutes the features by `MIRRORED`.
    component : float32 [B, 10]
    """
    hull, solid, area, hull_area = (whole[:, i, None, None] for i in range(4))
    length = np.cbrt(hull)
    unit = scale[:, None, None]
    hb, ha, sb, sa, section, perimeter, tb, ta, eb, ea = np.moveaxis(table, -1, 0)
    extent = np.maximum((tb + ta).max(axis=(1, 2)), _TINY)[:, None, None]
    below, above = np.maximum(hb - sb, 0), np.maximum(ha - sa, 0)
    enough = (sb > 0) & (sa > 0)
    valid = enough & (tb > SLIVER * eb) & (ta > SLIVER * ea)
    norm = np.log(below**_P + above**_P + (1e-6 * hull) ** _P) / _P
    total = np.log(hb + ha + _TINY)
    worst = np.log(np.maximum(below, above) + 1e-6 * hull)
    planes = np.stack(
        [
            hb / hull,
            ha / hull,
            2 * np.clip(sb / hull, 0, 1),
            2 * np.clip(sa / hull, 0, 1),
            np.sqrt(below / hull),
            np.sqrt(above / hull),
            _squash(0.3 * np.cbrt(0.75 / np.pi * below) / unit),
            _squash(0.3 * np.cbrt(0.75 / np.pi * above) / unit),
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
            valid.astype(np.float64),
            np.clip(norm - _least(norm, valid), -3, 3),
            np.clip(4 * (total - _least(total, valid)), -3, 3),
            np.clip(worst - _least(worst, valid), -3, 3),
        ],
        axis=2,
    )
    excess = np.maximum(hull - solid, 0)
    component = np.concatenate(
        [
            v[:, 0]
            for v in (
                np.log(length / unit),
                np.log(0.3 * np.cbrt(0.75 / np.pi * excess) / unit + 0.01),
                solid / hull,
                np.log(area / length**2),
                np.log(hull_area / length**2),
                np.log(extent / unit),
                np.log((tb + ta).min(axis=(1, 2))[:, None, None] / extent + 1e-3),
                np.log(solid / area / unit),
                np.maximum(_least(norm, valid) - np.log(excess + 1e-6 * hull), -4),
                np.maximum(4 * (_least(total, valid) - np.log(hull)), -4),
            )
        ],
        axis=1,
    )
    return np.ascontiguousarray(planes, np.float32), np.ascontiguousarray(component, np.float32)


def _squash(x: FloatArray) -> FloatArray:
    """Map 0..inf to 0..2, steepest around 1."""
    return 2 * x / (1 + x)


def _least(cost: FloatArray, valid: BoolArray) -> FloatArray:
    """Get the least cost [B, 1, 1] over the valid planes; over all where none is."""
    some = valid.any(axis=(1, 2), keepdims=True)
    least: FloatArray = np.where(valid | np.logical_not(some), cost, np.inf).min(axis=(1, 2), keepdims=True)
    return least
