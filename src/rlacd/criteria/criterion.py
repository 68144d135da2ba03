"""The interface of criteria: strict tests of parts, and early-out tests of unions that certainly fail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from rlacd import _native
from rlacd.criteria.avoided import Avoided
from rlacd.options import Options
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull
from rlacd.solid.primitive import Balls
from rlacd.solid.solid import Solid


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
    def early_out(self) -> EarlyOut:
        """Early-out tests, which reject unions that cannot meet the criterion."""
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


@dataclass(frozen=True)
class EarlyOut:
    """Early-out tests: necessary conditions for a union to meet a criterion.

    The defaults suit a criterion that judges hulls alone. It needs no solid clipped to a joint hull: the glued union of
    the pair, which has the same hull, has been judged already.

    Attributes
    ----------
    reach : float
        Distance beyond which the union of two components cannot meet the criterion.
    """

    reach: float

    looks_inside: ClassVar[bool] = False
    """Whether the criterion judges what fills a hull, not the hull alone."""

    def filled(self, part: Part) -> float:
        """Volume credited to a part; a pair costs |CH| - the credits of both, and the cheapest merges first."""
        return part.piece_hulls

    def least_error(self, volume: float, hull_volume: float) -> float:
        """Lower bound of the criterion's error, from the volumes of a part and its hull alone."""
        return 0.0

    def excludes(self, volume: FloatArray | float, hull_volume: FloatArray | float) -> BoolArray:
        """Whether the volumes alone show that a part, or each of several, cannot meet the criterion."""
        return np.zeros(np.shape(volume), dtype=bool)

    def is_feasible(self, filling: _native.Filling, hull: Hull) -> bool:
        """Decide whether a solid clipped to a hull may meet the criterion."""
        return False

    def feasible_volumes(
        self, filling: _native.Filling, hulls: Sequence[_native.ConvexBody], pairs: IntArray, threads: int
    ) -> FloatArray:
        """Volumes [P] of the joint hulls of pairs [P, 2] of hulls, infinite where one is not feasible, decided less
        thoroughly."""
        return np.full(len(pairs), np.inf)
