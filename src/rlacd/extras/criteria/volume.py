"""The volume that a hull adds, as a share: V-HACD's criterion, decided exactly on the solid instead of on voxels.

A part is done when ``|CH| - |part| <= tolerance * max(base, LEAST_PART |CH(solid)|)``, with the volume of the part or
of the whole solid as the base. The least base, a thousandth of the whole's convex hull, stands for V-HACD's voxels:
without it, a shell as thin as a sheet of paper would be cut until each piece is flat to a hundredth of the paper.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from rlacd import _native
from rlacd.criteria.concavity import Distance
from rlacd.criteria.criterion import Criterion, CriterionSummary
from rlacd.fit import VolumeFit, told_apart
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Part
from rlacd.solid.hull import Hull
from rlacd.solid.solid import Solid

LEAST_PART = 1e-3
"""Share of the volume of the whole's convex hull: smaller parts count as this large."""

FACETS_REACH = 0.05
"""How far hulls within limits on vertices and triangles may stick out of their parts: the default threshold."""

REACH = 0.2
"""Parts farther apart than this (the longest side is 2) are not united: their joint hull would bridge the gap."""


FILLED_BY_OTHERS = 2.0
"""Unions across others that add more than so many times the tolerance to their own pieces are not tried. With 1, 12
meshes take 1.4% more hulls by default; without a limit 3% fewer, in 1.3 times the time."""


@dataclass(frozen=True)
class AddedVolume(Criterion):
    """The criterion "the hull adds at most this share of volume".

    Attributes
    ----------
    tolerance
        The share: 0.01 is 1%.
    whole
        Volume of the solid if shares are of that; None if each is of the part's own.
    least
        Smallest base volume.
    """

    tolerance: float
    whole: float | None
    least: float

    reach: ClassVar[float] = REACH

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> AddedVolume:
        """Make the criterion; shares are of each part or of the whole solid, as the options say."""
        if run is None:
            return cls(options.volume_tolerance, None, 0.0)
        hull = Hull.of(solid.vertices) if len(solid.vertices) else None
        whole = float(_native.mesh_volume(*solid.mesh)) if options.volume_of == "whole" else None
        return cls(options.volume_tolerance, whole, LEAST_PART * hull.volume if hull is not None else 0.0)

    def volume_error(self, volume: float, hull_volume: float) -> float:
        """The error itself."""
        base = max(volume if self.whole is None else self.whole, self.least)
        added = max(hull_volume - volume, 0.0)
        return added / base if base > 0 else math.inf if added else 0.0

    def joint_volumes(
        self, whole: Component, hulls: Sequence[_native.ConvexBody], pairs: IntArray, volumes: FloatArray, threads: int
    ) -> FloatArray:
        """Infinite where the joint hulls add so much to the pieces that other parts hardly fill it."""
        joint = super().joint_volumes(whole, hulls, pairs, volumes, threads)
        base = np.maximum(volumes if self.whole is None else self.whole, self.least)
        return np.where(joint - volumes > FILLED_BY_OTHERS * self.tolerance * base, np.inf, joint)

    def is_met(self, part: Part) -> bool:
        """Whether the hull adds at most the tolerance."""
        return self.volume_error(part.volume, part.hull.volume) <= self.tolerance or self.error(part) <= self.tolerance

    def error(self, part: Part) -> float:
        """The share that the hull adds to what the solid fills of it."""
        return self.volume_error(part.filled, part.hull.volume)

    def scaled(self, factor: float) -> AddedVolume:
        """The same criterion with `factor` times the tolerance."""
        return replace(self, tolerance=self.tolerance * factor)

    @property
    def of_facets(self) -> Distance:
        """A distance: the hull of a ball with 64 vertices adds 4% of volume, however small its pieces are cut."""
        return Distance(FACETS_REACH)

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """The share of each part, and how many exceed the tolerance."""
        measured = partial(VolumeFit, tolerance=self.tolerance, relative_to="part" if self.whole is None else "whole")
        if errors is None:
            said = "There was no time to measure what the hulls add."
            return CriterionSummary({"volume": measured(None, None)}, (said,))
        exceeding = [error for error in errors if error > self.tolerance]
        worst, tolerance = told_apart(100 * max(errors), 100 * self.tolerance)
        warning = (
            f"{len(exceeding)} of {len(errors)} hulls add more than {tolerance}% of volume; the worst adds {worst}%."
        )
        found = measured(tuple(errors), max(errors))
        return CriterionSummary({"volume": found}, (warning,) if exceeding else ())
