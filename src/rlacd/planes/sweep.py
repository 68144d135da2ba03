"""The sweep: scores of all candidate planes of a component, without cutting it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd.planes.candidates import Candidates
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import NEGLIGIBLE_VOLUME, Component

SLIVER = 0.02
"""A side thinner than this share of its largest extent (an inscribed ball of 1/100) is a sliver."""

ROUNDING_FACTOR = 10
"""Least volume of a side as a multiple of the negligible volume: the sweep and the cut round differently."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Scores of all candidate planes of one component; every array has one entry per plane, [K * M].

    Attributes
    ----------
    hull_below, hull_above : float64
        Volumes of the convex hulls of the two sides.
    solid_below, solid_above : float64
        Volumes of the two sides.
    section_area, section_perimeter : float64
        Of the solid's cross-section.
    thickness_below, thickness_above : float64
        Extents of the two sides along the plane's normal.
    extent_below, extent_above : float64
        Largest extents of the two sides' boxes.
    """

    candidates: Candidates
    hull_below: FloatArray
    hull_above: FloatArray
    solid_below: FloatArray
    solid_above: FloatArray
    section_area: FloatArray
    section_perimeter: FloatArray
    thickness_below: FloatArray
    thickness_above: FloatArray
    extent_below: FloatArray
    extent_above: FloatArray

    def valid(self, sliver: float = SLIVER) -> BoolArray:
        """Whether each plane meets the solid and leaves no side thinner than `sliver` times its largest extent."""
        return (
            (self.solid_below > ROUNDING_FACTOR * NEGLIGIBLE_VOLUME)
            & (self.solid_above > ROUNDING_FACTOR * NEGLIGIBLE_VOLUME)
            & (self.thickness_below > sliver * self.extent_below)
            & (self.thickness_above > sliver * self.extent_above)
        )


def sweep(component: Component, candidates: Candidates, threads: int = 1) -> Sweep:
    """Score all candidates of a component: exact volumes of both sides' solids and hulls (see native/cut/sweep.hpp)."""
    scores = _native.sweep(component.vertices, component.faces, candidates.directions, candidates.offsets, threads)
    return Sweep(candidates, *np.ascontiguousarray(scores.T))
