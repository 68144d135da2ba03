"""The interface of criteria: judging parts, strictly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from rlacd.criteria.screen import Screen
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.balls import Balls
from rlacd.solid.component import Part
from rlacd.solid.solid import Solid


@dataclass(frozen=True)
class CriterionSummary:
    """A criterion's contribution to the report.

    Attributes
    ----------
    entries
        Keys and plain values for the report.
    warnings
        One sentence for everything that falls short.
    """

    entries: dict[str, Any]
    warnings: tuple[str, ...] = ()


class Criterion(Protocol):
    """When a component is close enough to its hull to be a part; what most criteria share is stated here."""

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Criterion:
        """Make the criterion that options ask for, for a solid; without a run there is no time to look at that."""
        ...

    @property
    def eliminates(self) -> bool:
        """Whether a pass also tries to divide each part among those around it."""
        return False

    @property
    def is_hereditary(self) -> bool:
        """Whether no union that contains a part that fails the criterion can meet it."""
        return False

    @property
    def screen(self) -> Screen:
        """Cheap tests that reject unions which cannot meet the criterion."""
        ...

    def is_met(self, part: Part) -> bool:
        """Decide strictly whether the part meets the criterion."""
        ...

    def settled(self, parts: Sequence[Part]) -> Criterion:
        """Get the criterion to use after cutting, given the parts that cutting has reached.

        If no cut could make a part meet it, a criterion may relax, and must report that.
        """
        return self

    def error(self, part: Part) -> float:
        """Tight upper bound of the error that the criterion compares with its threshold."""
        ...

    def scaled(self, factor: float) -> Criterion:
        """Get the same criterion with a threshold larger by `factor`."""
        ...

    @property
    def overhang(self) -> float:
        """How far the hull of a part that meets the criterion may reach beyond the part's surface."""
        return math.inf

    @property
    def obstacles(self) -> Balls | None:
        """Balls that no hull may touch, if the criterion is defined by balls."""
        return None

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """Summarise how well finished parts meet the criterion; `errors` holds that of each part, None if unknown."""
        ...
