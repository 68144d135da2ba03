"""The transfer of a proxy's parts to the dense solid that it stands for.

Hulls grow to take in the surface of the solid that they miss (`Against.uncovered`), so that together they cover the
solid. What the solid fills of a hull that fails the criterion is cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rlacd.criteria import Criterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import merge_parts
from rlacd.policies import Policy
from rlacd.proxy.simplify import Proxy
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part
from rlacd.solid.frame import GROWTH_TO_SPARE, HALF_THICKNESS
from rlacd.solid.hull import TOLERANCE, Hull, limit_hull

SIMPLE_FIRST = 2 * HALF_THICKNESS
"""The hulls of a proxy's parts are simplified within this first: they have to grow anyway. Grown hulls are simplified
within half of it: noise gives them many corners."""

MOST_CUTS = 2
"""Most cuts of a part on the solid: hulls of its pieces may grow to cover the surface until they fail again."""


@dataclass
class _Moved:
    """A part on its way to the solid.

    Attributes
    ----------
    part : Part
    is_met : bool
        Whether it is known to meet the goal.
    cuts : int
        How often it was cut on the solid; 0 if it comes from the proxy.
    """

    part: Part
    is_met: bool = False
    cuts: int = 0

    def grow(self, points: FloatArray, simple: bool) -> None:
        """Take in points, with a `simple` hull if there is time.

        The points are in no piece of the part, so its pieces are not known any more. The hull of a part that was cut on
        the solid is not simplified: there may be no room for it below the threshold.
        """
        grown = Hull.of(np.concatenate([self.part.hull.vertices, points]))
        assert grown is not None, "a hull stays solid when it grows"
        tolerance = TOLERANCE if self.cuts else SIMPLE_FIRST / 2
        self.part = Part(limit_hull(grown, tolerance=tolerance) if simple else grown, (), self.part.whole)
        self.is_met = False


@dataclass(frozen=True)
class Transfer:
    """Transfers parts of a proxy to the solid.

    Attributes
    ----------
    solid : Component
    proxy : Proxy
    goal : Criterion
        Tests the parts on the solid.
    policy : Policy
        Chooses the planes where parts are cut again.
    run : Run
        When it stops, the hulls cover the solid.
    """

    solid: Component
    proxy: Proxy
    goal: Criterion
    policy: Policy
    run: Run

    def __call__(self, parts: Sequence[Part]) -> tuple[list[Part], float]:
        """Get parts that cover the solid, and the factor of the goal that they meet: 1 if stopped.

        Parameters
        ----------
        parts : sequence of Part
            They cover the proxy. Those that meet their criterion on it only are cut again.
        """
        reached: tuple[list[Part], float] | None = None
        with self.run.until_stopped():
            moved = [self._begun(limit_hull(part.hull, tolerance=SIMPLE_FIRST)) for part in parts]
            self._cover(moved)
            reached = [each.part for each in moved], 1.0
            reached = self._tested(moved)
        with self.run.shielded():
            return reached or (self._covering(parts), 1.0)

    def moved(self, parts: Sequence[Part], *, merge: bool) -> list[Part]:
        """Transfer parts, and merge those that the proxy's tighter goal may have kept from it."""
        with self.run.stage("transfer"):
            moved, worst = self(parts)
            if merge and self.run.stopped_by is None:
                moved = merge_parts(moved, self.goal.scaled(worst), self.run)
        return moved

    def _begun(self, hull: Hull) -> _Moved:
        return _Moved(Part(hull, (), self.solid))

    def _covering(self, parts: Sequence[Part]) -> list[Part]:
        """Get parts that cover the solid, when there is no time to simplify their hulls."""
        moved = [self._begun(part.hull) for part in parts]
        self._cover(moved, simple=False)
        return [each.part for each in moved]

    def _tested(self, moved: list[_Moved]) -> tuple[list[Part], float]:
        """Cut the solid within hulls that fail, until none is left to cut (see `_failing`)."""
        while failing := self._failing(moved):
            for i in reversed(failing):
                moved[i : i + 1] = self._cut_again(moved[i])
            self._cover(moved)
        errors = self.run.map(self.goal.error, [each.part for each in moved if not each.is_met])
        return [each.part for each in moved], max([1.0, *(error / self.goal.outward_deviation for error in errors)])

    def _cut_again(self, failing: _Moved) -> list[_Moved]:
        """Cut a part on the solid; the second time to a tighter goal, as the hulls of its pieces may grow.

        What the solid fills of its hull may have a hull that is tight enough: then it takes no cut.
        """
        inside = self.solid.inside(failing.part.hull)
        cuts = failing.cuts + 1
        if inside is None:
            return [replace(failing, cuts=cuts)]
        tree = CutTree(inside, self.policy, self.run)
        tighter = 1 - failing.cuts * self.proxy.margin(self.goal)
        new = cut_and_merge(tree, self.goal.scaled(tighter), self.run).parts
        return [_Moved(part, True, cuts) for part in new]

    def _cover(self, moved: Sequence[_Moved], simple: bool = True) -> None:
        """Grow hulls where necessary to cover the solid's surface; those that need not grow stay the same."""
        points = self.solid.against.uncovered(
            [each.part.hull.body for each in moved],
            2 * self.proxy.deviation + SIMPLE_FIRST,
            GROWTH_TO_SPARE,
            self.run.threads,
        )
        for each, own in zip(moved, points, strict=True):
            if len(own):
                each.grow(own, simple)

    def _failing(self, moved: list[_Moved]) -> list[int]:
        """Indices of the parts that fail on the solid, but for those that were cut there `MOST_CUTS` times."""
        asked = [i for i, each in enumerate(moved) if each.cuts < MOST_CUTS and not each.is_met]
        for i, is_met in zip(asked, self.run.map(self.goal.is_met, [moved[i].part for i in asked]), strict=True):
            moved[i].is_met = is_met
        return [i for i in asked if not moved[i].is_met]
