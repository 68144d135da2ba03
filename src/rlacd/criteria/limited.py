"""A criterion that holds for hulls inside limits on vertices and faces too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rlacd.criteria.criterion import Criterion, CriterionSummary
from rlacd.criteria.screen import Part, Screen
from rlacd.solid.balls import Balls
from rlacd.solid.limit_hull import limit_hull

FEWEST_VERTICES, FEWEST_FACES = 24, 44
"""Lower limits are applied only at the end, with a warning if a hull then exceeds the threshold: to meet them, round
parts would have to be cut very small (a ball into 75 pieces for 16 vertices at threshold 0.05, into 12 for 32)."""


@dataclass(frozen=True)
class LimitedCriterion:
    """A criterion that must hold for the limited hull too.

    Attributes
    ----------
    criterion : Criterion
    max_vertices, max_faces : int or None
        Limits on the hull's vertices and triangles.
    """

    criterion: Criterion
    max_vertices: int | None
    max_faces: int | None

    @property
    def is_hereditary(self) -> bool:
        """No: limited hulls need not be nested even if the exact ones are."""
        return False

    @property
    def screen(self) -> Screen:
        """That of the underlying criterion: limiting a hull only makes it larger."""
        return self.criterion.screen

    def is_met(self, part: Part) -> bool:
        """Decide for the exact hull first, then for the limited one."""
        return self.criterion.is_met(part) and (self._fits(part) or self.criterion.is_met(self._limited(part)))

    def error(self, part: Part) -> float:
        """Measure the part against its limited hull."""
        return self.criterion.error(self._limited(part))

    def settled(self, parts: Sequence[Part]) -> LimitedCriterion:
        """Settle the underlying criterion with the limited hulls."""
        return LimitedCriterion(
            self.criterion.settled([self._limited(part) for part in parts]), self.max_vertices, self.max_faces
        )

    @property
    def overhang(self) -> float:
        """That of the underlying criterion."""
        return self.criterion.overhang

    @property
    def obstacles(self) -> Balls | None:
        """Those of the underlying criterion."""
        return self.criterion.obstacles

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """That of the underlying criterion."""
        return self.criterion.summary(errors)

    def scaled(self, factor: float) -> LimitedCriterion:
        """Get the same limits with a larger threshold."""
        return LimitedCriterion(self.criterion.scaled(factor), self.max_vertices, self.max_faces)

    def _fits(self, part: Part) -> bool:
        return (self.max_vertices is None or len(part.hull.vertices) <= self.max_vertices) and (
            self.max_faces is None or len(part.hull.faces) <= self.max_faces
        )

    def _limited(self, part: Part) -> Part:
        if self._fits(part):
            return part
        hull = limit_hull(part.hull, self.max_vertices, self.max_faces)
        return part.with_hull(hull)


def with_limits(criterion: Criterion, max_vertices: int | None, max_faces: int | None) -> Criterion:
    """Add limits to a criterion, if there are any and none is too low for cutting to meet."""
    if max_vertices is None and max_faces is None:
        return criterion
    if (max_vertices or FEWEST_VERTICES) < FEWEST_VERTICES or (max_faces or FEWEST_FACES) < FEWEST_FACES:
        return criterion
    return LimitedCriterion(criterion, max_vertices, max_faces)
