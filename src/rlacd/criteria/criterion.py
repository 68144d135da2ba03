"""The interface of criteria: strict tests of parts, and quick ones of unions that certainly fail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from rlacd import _native
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.balls import Balls
from rlacd.solid.component import Component, Part
from rlacd.solid.solid import Solid

if TYPE_CHECKING:
    from rlacd.extras.criteria.avoided import Avoided


@dataclass(frozen=True)
class CriterionSummary:
    """A criterion's contribution to the report.

    Attributes
    ----------
    entries
        Fields of the report.
    warnings
        One sentence for everything that falls short.
    """

    entries: dict[str, Any]
    warnings: tuple[str, ...] = ()


class Criterion(Protocol):
    """Decides when a component is close enough to its hull to be a part; the defaults suit most criteria."""

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Criterion:
        """Make the criterion that options ask for; without a run there is no time to look at the solid."""
        ...

    @property
    def eliminates(self) -> bool:
        """Whether a pass also tries to divide each part among those around it."""
        return False

    @property
    def reach(self) -> float:
        """Distance beyond which two parts cannot be one, unless the solid fills what lies between them.

        By default twice what hulls may reach: in a wider gap, the middle of the joint hull is too far from both.
        """
        return 2 * self.outward_deviation

    def credit(self, part: Part) -> float:
        """Volume credited to a part; a pair costs |CH| - the credits of both, and the cheapest merges first.

        By default the part's own: the rest of its hull is what criteria count.
        """
        return part.volume

    def volume_error(self, volume: float, hull_volume: float) -> float:
        """The error that the volumes of a part and its hull alone give it."""
        return 0.0

    def joint_volumes(
        self, whole: Component, hulls: Sequence[_native.ConvexBody], pairs: IntArray, volumes: FloatArray, threads: int
    ) -> FloatArray:
        """Volumes [P] of the joint hulls of pairs [P, 2] of hulls around so much of the solid [P].

        Infinite where it takes no time to see that the criterion forbids the union.
        """
        return _native.joint_hull_volumes(hulls, pairs, threads)

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
    def outward_deviation(self) -> float:
        """Greatest outward deviation: how far a hull that meets the criterion may reach beyond its part's surface."""
        return math.inf

    @property
    def of_facets(self) -> Criterion:
        """The criterion for a part's limited hull, once its exact hull meets this one."""
        return self

    @property
    def obstacles(self) -> Balls | None:
        """Balls that no hull may touch, if the criterion is defined by balls."""
        return None

    @property
    def avoided(self) -> Avoided | None:
        """Meshes that no hull may enter."""
        return None

    @property
    def alone(self) -> Criterion:
        """The same criterion without meshes to avoid, for a proxy, which may itself enter them."""
        return self

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """Summarise how well finished parts meet the criterion; `errors` holds that of each part, None if unknown."""
        ...
