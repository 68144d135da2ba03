"""A criterion that holds for hulls inside limits on vertices and faces too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rlacd.criteria.concavity import Concavity, Distance
from rlacd.criteria.criterion import Criterion, Joined
from rlacd.criteria.kept_open import KeptOpen
from rlacd.criteria.navigable import Navigable
from rlacd.criteria.volume import AddedVolume
from rlacd.options import Options
from rlacd.options.presets import HullLimits
from rlacd.run import Run
from rlacd.solid.component import Part
from rlacd.solid.hull import keeps, limit_hull
from rlacd.solid.solid import Solid

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
