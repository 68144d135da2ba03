"""Criteria with one more condition: passages that hulls keep open, hulls inside limits on vertices and faces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rlacd import _native
from rlacd.criteria.concavity import Concavity, Distance
from rlacd.criteria.criterion import Criterion, Joined
from rlacd.criteria.navigable import Intrusions, Navigable
from rlacd.criteria.volume import AddedVolume
from rlacd.options import Options
from rlacd.options.presets import HullLimits
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.frame import ROUNDING
from rlacd.solid.hull import keeps, limit_hull
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
        return not self._intrusions.any_beyond(part, ROUNDING) and self.criterion.is_met(part)

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


CRITERIA: dict[str, type[Criterion]] = {
    "concavity": Concavity,
    "distance": Distance,
    "volume": AddedVolume,
    "navigable": Navigable,
}
"""By the name that options give them."""

FEWEST = (24, 44)
"""Vertices and triangles. Under lower limits, parts are found without them; those that then break the criterion are cut
on. Cut for 8 vertices from the start, a cup is 40 hulls instead of 25."""

BOX = (8, 12)
"""Under limits lower than those of a box no part is cut on: next to no solid can be cut into such hulls."""


@dataclass(frozen=True)
class LimitedCriterion(Joined):
    """A criterion that must hold for the limited hull too.

    Attributes
    ----------
    criterion : Criterion
    limits : HullLimits
    """

    limits: HullLimits

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Criterion:
        """The criterion that the options name, with their passages, within their limits if cutting can meet those."""
        criterion = CRITERIA[options.criterion_name].prepare(options, solid, run)
        if run is not None and (options.keep_open is not None or options.keep_open_abs is not None):
            criterion = KeptOpen.around(criterion, options, solid, run)
        limits = options.hull_limits
        return cls(criterion, limits) if any(limits) and limits.allow(*FEWEST) else criterion

    def is_met(self, part: Part) -> bool:
        """Decide for the exact hull first, then for the limited one."""
        return self.criterion.is_met(part) and (
            keeps(part.hull, self.limits) or self.criterion.is_met(self._limited(part))
        )

    def error(self, part: Part) -> float:
        """Measure the part against its limited hull."""
        return self.criterion.error(self._limited(part))

    def settled(self, parts: Sequence[Part]) -> LimitedCriterion:
        """Settle the underlying criterion with the limited hulls."""
        return LimitedCriterion(self.criterion.settled([self._limited(part) for part in parts]), self.limits)

    def scaled(self, factor: float) -> LimitedCriterion:
        """Get the same limits with a larger threshold."""
        return LimitedCriterion(self.criterion.scaled(factor), self.limits)

    def _limited(self, part: Part) -> Part:
        return part if keeps(part.hull, self.limits) else part.with_hull(limit_hull(part.hull, self.limits))
