"""Criteria with one more condition: passages that hulls keep open, meshes that they avoid, limits on their corners."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rlacd import _native
from rlacd.criteria.concavity import Concavity, Distance
from rlacd.criteria.criterion import Criterion, CriterionSummary
from rlacd.options import Options
from rlacd.options.presets import HullLimits
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.balls import NO_BALLS, Balls
from rlacd.solid.component import Component, Part
from rlacd.solid.frame import ROUNDING
from rlacd.solid.hull import NO_LIMITS, NO_SIDES, TOLERANCE, keeps, limit_hull
from rlacd.solid.passages import passage_balls
from rlacd.solid.resting import within_reach
from rlacd.solid.solid import Solid

if TYPE_CHECKING:
    from rlacd.extras.criteria.avoided import Avoided
    from rlacd.extras.criteria.navigable import Intrusions

SPACING = 0.125
"""Distance between balls, and between the points from which they start, as a share of their radius: an edge that comes
between two reaches 1% of the radius deeper than into either."""

FEWEST_STARTS, MOST_STARTS = 5000, 50_000
"""Fewest and most points from which balls start."""

PLAY = 1.01
"""Passages narrower than this multiple of a ball need not let it through: hulls around them are not exact."""


def _passages(criterion: Criterion, options: Options, solid: Solid, run: Run) -> tuple[Balls, Balls]:
    """The largest balls in passages that hulls could narrow too much, and how large they have to stay."""
    scale = solid.frame.scale
    share, ball = options.keep_open or 0.0, (options.keep_open_abs or 0.0) * scale
    most = min((ball + criterion.outward_deviation) / (1 - share), 2.0)
    least = least_kept(options, scale)
    dense = _native.mesh_area(solid.vertices, solid.faces.astype(np.int64)) / (2 * SPACING * least) ** 2
    starts = int(np.clip(dense, FEWEST_STARTS, MOST_STARTS))
    with run.stage("space"):
        surface = _native.Surface(*solid.mesh, run.threads)
        free = passage_balls(solid.mesh, surface, (least, most), starts, SPACING, run.threads)
    return free, Balls(free.centres, np.minimum(share * free.radii + ball, free.radii))


def least_kept(options: Options, scale: float) -> float:
    """Least radius, in the frame, of passages that stay open; `scale` is frame units per unit of the input."""
    if options.keep_open_abs is not None:
        return PLAY * options.keep_open_abs * scale
    return math.inf if options.keep_open is None else options.threshold


def _named(name: str) -> type[Criterion]:
    """The criterion that options give this name."""
    if name == "volume":
        from rlacd.extras.criteria.volume import AddedVolume

        return AddedVolume
    if name == "navigable":
        from rlacd.extras.criteria.navigable import Navigable

        return Navigable
    return Distance if name == "distance" else Concavity


CLEARLY = 0.99
"""Share of the allowed distance that limits may use, since criteria are decided to 0.1% of it."""


def limited_part(
    part: Part, limits: HullLimits, enough: float = math.inf, tolerance: float = TOLERANCE, sides: FloatArray = NO_SIDES
) -> Part:
    """Get the part with a hull within limits; the same part if nothing changes (see `limit_hull`)."""
    hull = limit_hull(part.hull, limits, tolerance, sides, CLEARLY * enough)
    if hull is part.hull:
        return part
    return Part(hull, part.members, part.whole, part.exact if keeps(part.hull, limits) else part.hull)


@dataclass(frozen=True)
class LimitedCriterion(Criterion):
    """A criterion that limited hulls also have to meet, and whose hulls keep passages open and avoid meshes.

    Attributes
    ----------
    criterion : Criterion
        The underlying criterion, which decides all else.
    limits : HullLimits
    free, kept : Balls
        The largest balls that fit in the solid's passages, and the balls that stay free of hulls.
    avoided : Avoided or None
        The meshes that hulls may not enter.
    sides : float64 [P, 4]
        Half-spaces in which limited hulls stay, on whose planes the solid can rest.
    """

    criterion: Criterion
    limits: HullLimits = NO_LIMITS
    free: Balls = NO_BALLS
    kept: Balls = NO_BALLS
    avoided: Avoided | None = None
    sides: FloatArray = field(default_factory=lambda: NO_SIDES)

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Criterion:
        """Make the named criterion with its passages; tighter limits apply only after cutting (`extras/limit.py`)."""
        criterion = _named(options.criterion_name).prepare(options, solid, run)
        made = cls(criterion)
        if options.avoid:
            from rlacd.extras.criteria.avoided import Avoided

            threads = 1 if run is None else run.threads
            made = replace(made, avoided=Avoided.of(options.avoid, solid, options.threshold, threads))
        if run is not None and (options.keep_open is not None or options.keep_open_abs is not None):
            free, kept = _passages(criterion, options, solid, run)
            return replace(made, free=free, kept=kept)
        return criterion if made.avoided is None else made

    @property
    def eliminates(self) -> bool:
        """Whether the underlying criterion eliminates."""
        return self.criterion.eliminates

    @property
    def reach(self) -> float:
        """That of the underlying criterion."""
        return self.criterion.reach

    def credit(self, part: Part) -> float:
        """That of the underlying criterion."""
        return self.criterion.credit(part)

    def volume_error(self, volume: float, hull_volume: float) -> float:
        """That of the underlying criterion."""
        return self.criterion.volume_error(volume, hull_volume)

    def joint_volumes(
        self, whole: Component, hulls: Sequence[_native.ConvexBody], pairs: IntArray, volumes: FloatArray, threads: int
    ) -> FloatArray:
        """Those of the underlying criterion: what it forbids is forbidden here too."""
        return self.criterion.joint_volumes(whole, hulls, pairs, volumes, threads)

    @property
    def outward_deviation(self) -> float:
        """That of the underlying criterion."""
        return self.criterion.outward_deviation

    @property
    def obstacles(self) -> Balls | None:
        """Those of the underlying criterion."""
        return self.criterion.obstacles

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """That of the underlying criterion."""
        return self.criterion.summary(errors)

    @cached_property
    def _intrusions(self) -> Intrusions:
        from rlacd.extras.criteria.navigable import Intrusions

        return Intrusions(self.kept)

    def is_met(self, part: Part) -> bool:
        """Decide for the exact hull first, then for the limited one."""
        if not self._is_met(part, part):
            return False
        return keeps(part.hull, self.limits) or self.of_facets._is_met(self._limited(part), part)

    @cached_property
    def of_facets(self) -> LimitedCriterion:
        """The same for the underlying criterion's `of_facets`, without limits."""
        return replace(self, criterion=self.criterion.of_facets, limits=NO_LIMITS)

    def _is_met(self, part: Part, exact: Part) -> bool:
        if len(self.kept) > 0 and self._intrusions.any_beyond(part, ROUNDING):
            return False
        if self.avoided is not None and self.avoided.is_in_the_way(part.hull, exact):
            return False
        return self.criterion.is_met(part)

    def error(self, part: Part) -> float:
        """The error of the part with the limited hull it ends with: off the sides, where the one on them fails."""
        limited = self._limited(part)
        if len(self.sides) and limited is not part and not self.of_facets.is_met(limited):
            limited = replace(self, sides=NO_SIDES)._limited(part)
        return self.criterion.error(limited)

    def settled(self, parts: Sequence[Part]) -> LimitedCriterion:
        """Settle it with the limited hulls; balls become as small as parts that cannot be cut leave them."""
        limited = [part if keeps(part.hull, self.limits) else self._limited(part) for part in parts]
        kept = Balls(self.free.centres, np.maximum(self._intrusions.radii_left(limited), 0.0))
        return replace(self, criterion=self.criterion.settled(limited), kept=kept)

    def scaled(self, factor: float) -> LimitedCriterion:
        """The coarser criterion: hulls may take more of balls, and coarser parts enter meshes, by that factor."""
        radii = np.maximum(self.free.radii - factor * (self.free.radii - self.kept.radii), 0.0)
        avoided = self.avoided and self.avoided.scaled(factor)
        kept = Balls(self.free.centres, radii)
        return replace(self, criterion=self.criterion.scaled(factor), kept=kept, avoided=avoided)

    @property
    def alone(self) -> Criterion:
        """The same criterion without meshes to avoid."""
        return replace(self, avoided=None)

    def _limited(self, part: Part) -> Part:
        reach = self.of_facets.outward_deviation
        return limited_part(part, self.limits, reach, sides=within_reach(self.sides, part.hull, reach))
