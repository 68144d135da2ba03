"""The sweep: scores of all candidate planes of a component, without cutting it, each computed once for all policies.

The plane whose two sides have the least excess hull volume is found without a full sweep.
"""

from __future__ import annotations

import math
import threading
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from rlacd import _native
from rlacd.planes.candidates import EDGES_PER_COMPONENT, OFFSETS_PER_AXIS, Candidates, all_planes
from rlacd.solid.arrays import BoolArray, FloatArray, heights
from rlacd.solid.component import NEGLIGIBLE_VOLUME, Component, Plane
from rlacd.solid.frame import ROUNDING
from rlacd.solid.hull import SLIVER_RADIUS

SLIVER = 2 * SLIVER_RADIUS
"""A side thinner than this share of its largest extent is a sliver."""

LEAST_SIDE = 10 * NEGLIGIBLE_VOLUME
"""Least volume of a side: the sweep and the cut round differently."""


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
        Area and perimeter of the solid's cross-section.
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
            (self.solid_below > LEAST_SIDE)
            & (self.solid_above > LEAST_SIDE)
            & (self.thickness_below > sliver * self.extent_below)
            & (self.thickness_above > sliver * self.extent_above)
        )


def sweep(component: Component, candidates: Candidates, threads: int = 1) -> Sweep:
    """Score all candidates of a component: volumes of both sides' solids and hulls (native/decompose/sweep.hpp)."""
    scores = _native.sweep(component.vertices, component.faces, candidates.directions, candidates.offsets, threads)
    return Sweep(candidates, *np.ascontiguousarray(scores.T))


class SweepCache:
    """Sweeps of components over their candidate planes, kept as long as the component lives.

    Parameters
    ----------
    seed : sequence of int, optional
        Only half of the planes are candidates, drawn by this seed and the component's vertices.
    """

    def __init__(self, seed: Sequence[int] | None = None) -> None:
        self._seed = seed
        self._sweeps: WeakKeyDictionary[Component, Sweep] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def candidates(self, component: Component) -> Candidates:
        """Get the planes of a component."""
        planes = all_planes(component, OFFSETS_PER_AXIS, EDGES_PER_COMPONENT)
        if self._seed is None:
            return planes
        random = np.random.default_rng([*self._seed, zlib.crc32(component.vertices.tobytes())])
        drawn = np.sort(random.permutation(len(planes))[: (len(planes) + 1) // 2])
        return Candidates(planes.directions[drawn], planes.offsets[drawn])

    def of(self, component: Component, threads: int = 1) -> Sweep:
        """Get the sweep of a component."""
        with self._lock:
            known = self._sweeps.get(component)
        if known is None:
            known = sweep(component, self.candidates(component), threads)
            with self._lock:  # another thread may have done the same, with the same result
                self._sweeps[component] = known
        return known


SLIVERS = (SLIVER, SLIVER / 100)
"""Thresholds for slivers, strictest first: planes that leave slivers are used only if there is no other."""


def least_excess(component: Component, candidates: Candidates, exponent: float, threads: int = 1) -> Plane | None:
    """Get the valid plane of least cost; None if every plane misses the solid or leaves a sliver.

    The cost is the `exponent`-norm of the two sides' |CH(m_i)| - |m_i|. It is computed only for planes that bounds do
    not rule out (native/decompose/least_excess.hpp). Of planes whose costs are equal up to rounding, as in symmetric
    shapes, the first is taken, so that the cuts do not depend on the unit and position of the input.

    Parameters
    ----------
    exponent : float
        1 for the sum, which orders planes like the sum of hull volumes (with its tolerance); infinity for the maximum.
    """
    # No plane costs more than the whole component: the hulls of the two sides are disjoint and lie in its hull.
    most = component.hull.volume if exponent == 1 else max(component.hull.volume - component.volume, 0.0)
    number = _native.find_least_excess(
        component.vertices,
        component.faces,
        candidates.directions,
        candidates.offsets,
        exponent,
        ROUNDING * (most if math.isinf(exponent) else float(_native.powers(np.array([most]), exponent)[0])),
        LEAST_SIDE,
        SLIVERS,
        threads,
    )
    return candidates.plane(number) if number >= 0 else None


def paper_planes(component: Component) -> Candidates:
    """The paper's 150 planes: 25 a direction about the centre of the component's box, 1/25 of its longest side apart.

    Along a shorter side, the outer ones miss the component; they are not valid.
    """
    lower, upper = component.box
    directions = all_planes(component, 1, 0).directions
    steps = (np.arange(OFFSETS_PER_AXIS) - OFFSETS_PER_AXIS // 2) / OFFSETS_PER_AXIS * float((upper - lower).max())
    return Candidates(directions, heights(directions, (lower + upper) / 2)[:, None] + steps)


def valid_planes(component: Component, candidates: Candidates) -> BoolArray:
    """Whether each of the candidates [K * M] leaves no side thinner than 2% of the component's extent.

    The component is connected, so every plane within its extent meets it, and the thickness of a side is the plane's
    distance from that end: no sweep is needed. This is slightly stricter than `Sweep.valid`, which compares a side with
    its own extent. If no plane is valid, as in a thin sheet, the limit is lowered to a hundredth.
    """
    along = heights(component.hull.vertices, candidates.directions)
    lower, upper = along.min(axis=0), along.max(axis=0)
    extent = float((upper - lower).max())
    thinner = np.minimum(candidates.offsets - lower[:, None], upper[:, None] - candidates.offsets).ravel()
    for sliver in SLIVERS:
        valid: BoolArray = thinner > sliver * extent
        if valid.any():
            break
    return valid


def distinct_planes(component: Component, candidates: Candidates) -> BoolArray:
    """`valid_planes`, each once: principal axes that are coordinate axes repeat the planes of those."""
    directions = candidates.directions
    first = (directions[:, None] == directions).all(axis=2).argmax(axis=1) == np.arange(len(directions))
    distinct: BoolArray = valid_planes(component, candidates) & np.repeat(first, candidates.offsets.shape[1])
    return distinct
