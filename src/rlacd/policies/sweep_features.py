"""What networks see of a component without a pre-trained encoder: the plane sweep, and its size."""

from __future__ import annotations

import numpy as np

from rlacd.criteria.concavity import VOLUME_WEIGHT, volume_radius
from rlacd.planes.sweep import Sweep, sweep
from rlacd.policies.observe import Float32Array, paper_planes, valid_planes
from rlacd.solid.component import Component

PLANES = 150

PER_PLANE, PER_COMPONENT = 6, 6
"""Numbers of features."""

FEATURES = PER_PLANE * PLANES + PER_COMPONENT


def sweep_features(component: Component, threshold: float, hull: bool = True) -> Float32Array:
    """Features [906] of a component for the network of the paper: those of 150 planes, then those of the component.

    The same component always gives the same features; its size in the frame is among them.

    Parameters
    ----------
    threshold : float
        The criterion's length in the frame.
    hull : bool
        Whether hulls are seen (the paper's 4.5.2 leaves them out).
    """
    planes = paper_planes(component)
    scored = sweep(component, planes)
    longest = float(np.ptp(component.box, axis=0).max())
    excess = max(component.hull.volume - component.volume, 1e-12)
    below, above = _excess(scored)
    features = np.stack(
        [
            below / excess * hull,
            above / excess * hull,
            scored.hull_below / component.hull.volume * hull,
            scored.solid_below / component.volume,
            scored.section_area / longest**2,
            valid_planes(component, planes),
        ],
        axis=1,
    )
    own = [
        np.log2(longest / 2),
        np.log2(longest / threshold),
        np.log2(1e-3 + VOLUME_WEIGHT * volume_radius(component.volume, component.hull.volume) / threshold) * hull,
        component.volume / component.hull.volume * hull,
        *(np.sort(np.ptp(component.box, axis=0))[:2] / longest),
    ]
    found: Float32Array = np.nan_to_num(np.concatenate([features.ravel(), own])).astype(np.float32)
    return found


def _excess(scored: Sweep) -> tuple[Float32Array, Float32Array]:
    return (
        np.maximum(scored.hull_below - scored.solid_below, 0),
        np.maximum(scored.hull_above - scored.solid_above, 0),
    )
