"""How far a part and its hull may be apart, decided strictly: by distance, or by CoACD's concavity.

The distance of a part with convex hull CH is ``H_b``, the two-sided Hausdorff distance between the *surfaces* of the
part and of its hull. Its concavity is ``max(H_b, 0.3 R_v)``, where ``R_v = cbrt(3 (|CH| - |part|) / 4 pi)`` is the
radius of a ball with the volume between them (Wei et al., "Approximate Convex Decomposition for 3D Meshes with
Collision-Aware Concavity and Tree Search", SIGGRAPH 2022). CoACD samples ``H_b``; here it is bounded. What limits on
vertices and triangles add to a hull counts for ``H_b`` only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from rlacd import _native
from rlacd.criteria.criterion import Criterion, CriterionSummary, EarlyOut
from rlacd.errors import OptionError
from rlacd.fit import ANY, LengthFit, Unit
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull
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
    part_to_hull
        Greatest distance from the part's surface to the hull's surface.
    hull_to_part
        Greatest distance from the hull's surface to the part's surface.
    volume_radius
        ``R_v``; 0 for a distance.

    The interval of a one-sided distance may be wider than the tolerance if another term decides the value.
    """

    value: tuple[float, float]
    part_to_hull: tuple[float, float]
    hull_to_part: tuple[float, float]
    volume_radius: float


@dataclass(frozen=True)
class DistanceEarlyOut(EarlyOut):
    """Necessary conditions for a distance or concavity of at most `threshold`.

    The reach is twice the threshold: if parts are farther apart, the middle of the joint hull is too far from both.

    Attributes
    ----------
    threshold : float
    weight : float
        Weight of ``R_v``, which the volumes give; 0 for a distance.
    """

    threshold: float
    weight: float

    looks_inside: ClassVar[bool] = True

    def filled(self, part: Part) -> float:
        """The part's volume: the rest of the hull is the volume between the two surfaces."""
        return part.volume

    def least_error(self, volume: float, hull_volume: float) -> float:
        """``0.3 R_v``, a lower bound of the concavity."""
        return self.weight * _native.volume_radius(volume, hull_volume)

    def excludes(self, volume: FloatArray | float, hull_volume: FloatArray | float) -> BoolArray:
        """Whether ``0.3 R_v`` alone exceeds the threshold."""
        radius = self.threshold / self.weight if self.weight else math.inf
        ball = 4 / 3 * math.pi * radius * radius * radius
        return np.asarray(hull_volume - volume > ball)

    def is_feasible(self, filling: _native.Filling, hull: Hull) -> bool:
        """Test the solid's corners and points of the hull."""
        return filling.is_feasible(hull.body, self.threshold)

    def feasible_volumes(
        self, filling: _native.Filling, hulls: Sequence[_native.ConvexBody], pairs: IntArray, threads: int
    ) -> FloatArray:
        """Test the solid's corners and points of the joint hulls."""
        return filling.feasible_volumes(hulls, pairs, self.threshold, threads)


@dataclass(frozen=True)
class Distance(Criterion):
    """The criterion "the surfaces of a part and its hull lie at most ``threshold`` apart".

    Parameters
    ----------
    threshold
        In the frame where the input's bounding box is centred and its longest side is 2.
    unit
        In which warnings tell lengths of the frame.

    Raises
    ------
    OptionError
        The threshold is not positive.

    Notes
    -----
    Inside a convex polytope, the distance to its surface is the least distance to a facet's plane; the distance to the
    part is the least distance to one of its triangles. Both are minima of convex functions ``f_w``, so over a triangle
    ``T`` and for weights ``l_w >= 0`` that sum to 1, the distance is at most the greatest value of ``sum l_w f_w`` at
    the corners of ``T``. Branch and bound over the triangles with this bound, for single witnesses and pairs of them,
    closes the interval around the maximum; sampling decides nothing but an early "no". Facet planes of the hull are
    moved out to its farthest corner, so that the inexact normal of a sliver can make a distance larger, never smaller.
    Rounding errors are about 1e-8 of the lengths involved.
    """

    threshold: float = 0.05
    unit: Unit = ANY

    name: ClassVar[str] = "distance"
    weight: ClassVar[float] = 0.0
    """The weight of ``R_v``."""
    eliminates: ClassVar[bool] = True
    """A third more time saves a tenth of the parts, and the parts around a hole need not be 8, 16 or 32."""

    def __post_init__(self) -> None:
        if not self.threshold > 0:
            raise OptionError(f"The {self.name} threshold must be positive, not {self.threshold}; 0.05 is usual.")

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Distance:
        """Make the criterion."""
        return cls(options.threshold, solid.frame.unit)

    @cached_property
    def early_out(self) -> DistanceEarlyOut:
        """Tests of the solid's corners, and of volumes if they count."""
        return DistanceEarlyOut(2 * self.threshold, self.threshold, self.weight)

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

        False if it is larger, or if it is within 0.1 % of the threshold and branch and bound cannot decide.
        """
        volumes = self._volumes(part)
        return _native.meets_concavity(part.vertices, part.faces, part.hull.body, *volumes, self.threshold, part.tree)

    def measure(self, part: Part, tolerance: float = 1e-3, floor: float = 0.0) -> ConcavityValue:
        """Measure the distance or concavity to within ``tolerance`` (same frame as the threshold).

        Values up to ``floor`` need not be resolved: for them the interval may be as wide as ``(0, floor)``. That is
        much faster for nearly convex parts with many faces, which otherwise need cells as small as the tolerance.
        """
        if not tolerance > 0:
            raise OptionError(f"The tolerance must be positive, not {tolerance}; 0.001 is usual.")
        volumes = self._volumes(part)
        found = _native.concavity(part.vertices, part.faces, part.hull.body, *volumes, tolerance, floor, part.tree)
        return ConcavityValue(*found)

    def _volumes(self, part: Part) -> tuple[float, float]:
        """Volumes of the part and its exact hull, as far as they matter: equal ones make ``R_v`` 0."""
        hull = part.exact or part.hull
        return part.volume if self.weight else hull.volume, hull.volume


@dataclass(frozen=True)
class Concavity(Distance):
    """The criterion "CoACD concavity at most ``threshold``"."""

    name: ClassVar[str] = "concavity"
    weight: ClassVar[float] = VOLUME_WEIGHT
    eliminates: ClassVar[bool] = False
    """A pass is cuts and merging, as in CoACD."""
