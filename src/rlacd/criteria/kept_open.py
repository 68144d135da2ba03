"""A criterion together with passages that hulls have to keep open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rlacd import _native
from rlacd.criteria.criterion import Criterion, Joined
from rlacd.criteria.navigable import TOUCH, Intrusions
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.passages import passage_balls
from rlacd.solid.primitive import Balls
from rlacd.solid.solid import Solid

STARTS_FOR_ALL = 5000
"""Points from which balls start, one for each 0.02 % of the surface, and as many triangles."""

PLAY = 1.01
"""Passages that are narrower than so many times a ball need not let it through: hulls around them cannot be exact."""


@dataclass(frozen=True)
class KeptOpen(Joined):
    """A criterion whose hulls also stay out of balls, each a share of the largest that fits where it is.

    Attributes
    ----------
    criterion : Criterion
    free : Balls
        The largest that fit in the passages of the solid.
    radii : float64 [B]
        How large they have to stay.
    """

    free: Balls
    radii: FloatArray

    @classmethod
    def around(cls, criterion: Criterion, options: Options, solid: Solid, run: Run) -> KeptOpen:
        """Find the passages of a solid that hulls which meet a criterion could narrow too much."""
        scale = solid.frame.scale
        share, ball = options.keep_open or 0.0, (options.keep_open_abs or 0.0) * scale
        most = min((ball + criterion.overhang) / (1 - share), 2.0)
        with run.stage("space"):
            surface = _native.Surface(*solid.mesh, run.threads)
            free = passage_balls(solid.mesh, surface, (least_kept(options, scale), most), STARTS_FOR_ALL, run.threads)
        return cls(criterion, free, np.minimum(share * free.radii + ball, free.radii))

    @cached_property
    def _intrusions(self) -> Intrusions:
        return Intrusions(Balls(self.free.centres, self.radii))

    def is_met(self, part: Part) -> bool:
        """Whether the hull stays out of the balls, and the criterion is met."""
        return not self._intrusions.any_beyond(part, TOUCH) and self.criterion.is_met(part)

    def scaled(self, factor: float) -> KeptOpen:
        """Coarser: hulls may take more of each ball, by the same factor."""
        radii = np.maximum(self.free.radii - factor * (self.free.radii - self.radii), 0.0)
        return replace(self, criterion=self.criterion.scaled(factor), radii=radii)

    def settled(self, parts: Sequence[Part]) -> KeptOpen:
        """Balls become as small as the hulls of parts that cannot be cut leave them; the report measures those."""
        radii = np.maximum(self._intrusions.radii_left(parts), 0.0)
        return replace(self, criterion=self.criterion.settled(parts), radii=radii)


def least_kept(options: Options, scale: float) -> float:
    """The radius in the frame from which passages have to stay open; `scale` is its units per unit of the input."""
    if options.keep_open_abs is not None:
        return PLAY * options.keep_open_abs * scale
    return math.inf if options.keep_open is None else options.threshold
