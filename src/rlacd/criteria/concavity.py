"""How far a hull and the solid may be apart, decided strictly: by distance, or by a concavity like CoACD's.

The distance ``H`` of a convex hull CH from the solid S is the larger of its *depth*, how deep the surface of S comes
inside CH, and its *reach*, how far the surface of CH leads from S; inside S that is 0. Its concavity is ``max(H, 0.3
R_v)``, where ``R_v = cbrt(3 (|CH| - |S in CH|) / 4 pi)`` is the radius of a ball with the volume that S leaves of CH.
CoACD compares CH with one part instead, by ``H_b``, the Hausdorff distance between the surfaces of the two, which it
samples (Wei et al., "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree Search",
SIGGRAPH 2022); here both terms are bounded, and what other parts fill of a hull is no error of it. What limits on
vertices and triangles add to a hull counts for ``H`` only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from rlacd import _native
from rlacd.criteria.criterion import Criterion, CriterionSummary
from rlacd.fit import ANY, LengthFit, Unit
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Part
from rlacd.solid.solid import Solid

VOLUME_WEIGHT = 0.3
"""The weight of ``R_v``, as in the original definition."""


@dataclass(frozen=True)
class ConcavityValue:
    """A measured concavity or distance; every length is a certified interval ``(lower, upper)``.

    Attributes
    ----------
    value
        The concavity or distance; the interval is at most as wide as the tolerance.
    depth
        Greatest depth of the solid's surface inside the hull.
    reach
        Greatest distance of the hull's surface from the solid.
    volume_radius
        ``R_v``; 0 for a distance.

    The interval of a single length may be wider than the tolerance if another decides the value.
    """

    value: tuple[float, float]
    depth: tuple[float, float]
    reach: tuple[float, float]
    volume_radius: float


def volume_radius(volume: float, hull_volume: float) -> float:
    """``R_v``: the radius of a ball with the volume that is left of a hull."""
    return float(_native.cube_roots(np.array([max(0.0, 3 * (hull_volume - volume) / (4 * math.pi))]))[0])


@dataclass(frozen=True)
class Distance(Criterion):
    """The criterion "hull and solid lie at most ``threshold`` apart".

    Parameters
    ----------
    threshold
        In the frame where the input's bounding box is centred and its longest side is 2.
    unit
        In which warnings tell lengths of the frame.

    Notes
    -----
    Inside a convex polytope, the distance to its surface is the least distance to a facet's plane; the distance to the
    solid is the least distance to one of its triangles or to a ball inside it. Both are minima of convex functions
    ``f_w``, so over a triangle ``T`` and for weights ``l_w >= 0`` that sum to 1, the distance is at most the greatest
    value of ``sum l_w f_w`` at the corners of ``T``. Branch and bound over the triangles with this bound, for single
    witnesses and pairs of them, closes the interval around the maximum; sampling decides nothing but an early "no".
    Facet planes of the hull are moved out to its farthest corner, so that the inexact normal of a sliver can make a
    distance larger, never smaller. Rounding errors are about 1e-8 of the lengths involved.
    """

    threshold: float = 0.05
    unit: Unit = ANY

    name: ClassVar[str] = "distance"
    weight: ClassVar[float] = 0.0
    """The weight of ``R_v``."""
    eliminates: ClassVar[bool] = True
    """A third more time saves a tenth of the parts, and the parts around a hole need not be 8, 16 or 32."""

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Distance:
        """Make the criterion."""
        return cls(options.threshold, solid.frame.unit)

    def volume_error(self, volume: float, hull_volume: float) -> float:
        """``0.3 R_v``."""
        return self.weight * volume_radius(volume, hull_volume) if self.weight else 0.0

    def joint_volumes(
        self, whole: Component, hulls: Sequence[_native.ConvexBody], pairs: IntArray, volumes: FloatArray, threads: int
    ) -> FloatArray:
        """Hold a few corners and points of the joint hulls against the solid."""
        return whole.against.feasible_volumes(hulls, pairs, self.threshold, threads)

    def scaled(self, factor: float) -> Distance:
        """The same criterion with ``factor`` times the threshold."""
        return replace(self, threshold=self.threshold * factor)

    @property
    def outward_deviation(self) -> float:
        """The threshold."""
        return self.threshold

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """The error of each part, and how many exceed the threshold."""
        if errors is None:
            sentence = f"There was no time to measure the {self.name} of the parts."
            return CriterionSummary({self.name: LengthFit(None, None, self.threshold)}, (sentence,))
        exceeding = [error for error in errors if error > self.threshold]
        worst, threshold = self.unit.apart(max(errors), self.threshold)
        exceed = f"{len(exceeding)} of {len(errors)} parts exceed the {self.name} {threshold}"
        warning = f"{exceed}; the worst has at most {worst}."
        found = LengthFit(tuple(errors), max(errors), self.threshold)
        return CriterionSummary({self.name: found}, (warning,) if exceeding else ())

    def error(self, part: Part) -> float:
        """Upper bound of the error; at most the threshold if the part certainly meets it."""
        measured = self.measure(part, tolerance=self.threshold / 50).value[1]
        if not self.threshold < measured <= 1.02 * self.threshold:
            return measured
        return self.threshold if self.is_met(part) else self.measure(part, tolerance=self.threshold / 5000).value[1]

    def is_met(self, part: Part) -> bool:
        """Whether the part's error is certainly at most the threshold.

        False if it is larger, or if it is within 0.1% of the threshold and branch and bound cannot decide.
        """
        against, body = part.whole.against, part.hull.body
        if against.comes_deeper(body, self.threshold) or not self._is_full(part):  # quickly seen
            return False
        return not against.leads_farther(body, self.threshold)

    def _is_full(self, part: Part) -> bool:
        """Whether ``0.3 R_v`` is at most the threshold, if it counts; the part's own volume mostly shows it."""
        hull = part.exact or part.hull
        radius = self.threshold / self.weight if self.weight else math.inf
        free = hull.volume - 4 / 3 * math.pi * radius**3
        return free <= part.volume or free <= part.filled

    def measure(self, part: Part, tolerance: float = 1e-3, floor: float = 0.0) -> ConcavityValue:
        """Measure the distance or concavity to within ``tolerance`` (same frame as the threshold).

        Values up to ``floor`` need not be resolved: for them the interval may be as wide as ``(0, floor)``. That is
        much faster for nearly convex parts with many faces, which otherwise need cells as small as the tolerance.
        """
        radius = volume_radius(part.filled, (part.exact or part.hull).volume) if self.weight else 0.0
        by_volume = self.weight * radius
        lengths = part.whole.against.measure(part.hull.body, tolerance, max(floor, by_volume + tolerance))
        lower, upper = (max(by_volume, *ends) for ends in zip(*lengths, strict=True))
        return ConcavityValue((lower, upper), *lengths, radius)


@dataclass(frozen=True)
class Concavity(Distance):
    """The criterion "CoACD concavity at most ``threshold``"."""

    name: ClassVar[str] = "concavity"
    weight: ClassVar[float] = VOLUME_WEIGHT
    eliminates: ClassVar[bool] = False
    """A pass is cuts and merging, as in CoACD."""


@dataclass(frozen=True)
class Filled(Distance):
    """The criterion "the solid fills all but a share of the hull", for pieces of exact bodies.

    The threshold bounds which hulls are looked at; no length is certified, which takes far longer.
    """

    share: float = 0.0

    def is_met(self, part: Part) -> bool:
        """Whether the part, or else all that the solid fills of its hull, is large enough."""
        least = (1 - self.share) * part.hull.volume
        return least <= part.volume or least <= part.filled
