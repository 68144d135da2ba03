"""The model that is cut for a solid: the solid, or a simpler copy of a dense one, whose parts are transferred.

Hulls grow to take in the surface of the solid that they miss (`Filling.uncovered`), so that together they cover the
solid. The part of a hull is the solid clipped to it; a part that fails the criterion is cut on the solid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rlacd._native import Stopped
from rlacd.criteria import Criterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import merge_transferred
from rlacd.policies import Policy
from rlacd.proxy.simplify import Proxy, simplify
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import DENSE, Component, Part
from rlacd.solid.frame import GROWTH_TO_SPARE, HALF_THICKNESS
from rlacd.solid.hull import TOLERANCE, Hull, limit_hull
from rlacd.solid.solid import Shape

SIMPLE_FIRST = 2 * HALF_THICKNESS
"""The hulls of a proxy's parts are simplified within this first: they have to grow anyway. Grown hulls are simplified
within half of it: noise gives them many corners."""

MOST_CUTS = 2
"""Most cuts of a part on the solid: hulls of its pieces may grow to cover the surface until they fail again."""


@dataclass
class _Transferred:
    """A part being transferred to the solid.

    Attributes
    ----------
    hull : Hull
    part : Part or None
        The solid clipped to this hull, once it has been.
    is_met : bool
        Whether that is known to meet the goal.
    cuts : int
        How often it was cut on the solid; 0 if it comes from the proxy.
    """

    hull: Hull
    part: Part | None = None
    is_met: bool = False
    cuts: int = 0

    @property
    def on_solid(self) -> Part:
        """The solid clipped to the hull; only once it has been."""
        assert self.part is not None, "clipped first"
        return self.part

    def grow(self, points: FloatArray, simple: bool) -> None:
        """Take in points, with a `simple` hull if there is time.

        A part that was cut on the solid stays what it is, without the slivers that were left out, and its hull is not
        simplified: there may be no room for it below the threshold. The points are in no piece of it, so it has no
        members any more.
        """
        grown = Hull.of(np.concatenate([self.hull.vertices, points]))
        assert grown is not None, "a hull stays solid when it grows"
        self.hull = limit_hull(grown, tolerance=TOLERANCE if self.cuts else SIMPLE_FIRST / 2) if simple else grown
        cut = self.part if self.cuts else None
        self.part = cut and Part(cut.vertices, cut.faces, cut.volume, self.hull, cut.piece_hulls)
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
        When it stops, the hulls cover the solid, and their parts have no faces: there was no time to clip it to them.
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
        covering: list[Hull] = []
        try:
            moved = [_Transferred(limit_hull(part.hull, tolerance=SIMPLE_FIRST)) for part in parts]
            self._cover(moved)
            covering = [each.hull for each in moved]
            return self._tested(moved)
        except Stopped:
            self.run.note_stop()
        with self.run.shielded():
            hulls = covering or self._covering(parts)
        return [Part.unclipped(hull) for hull in hulls], 1.0

    def _covering(self, parts: Sequence[Part]) -> list[Hull]:
        """Get hulls that cover the solid, when there is no time to simplify them."""
        moved = [_Transferred(part.hull) for part in parts]
        self._cover(moved, simple=False)
        return [each.hull for each in moved]

    def _tested(self, moved: list[_Transferred]) -> tuple[list[Part], float]:
        """Clip the solid to the hulls, and cut it there where one fails, until none is left to cut (see `_failing`)."""
        self._clip(moved)
        while failing := self._failing(moved):
            for i in reversed(failing):
                moved[i : i + 1] = self._cut_again(moved[i])
            self._cover(moved)
            self._clip(moved)
        errors = self.run.map(self.goal.error, [each.on_solid for each in moved if not each.is_met])
        return [each.on_solid for each in moved], max([1.0, *(error / self.goal.outward_deviation for error in errors)])

    def _cut_again(self, failing: _Transferred) -> list[_Transferred]:
        """Cut a part on the solid; the second time to a tighter goal, as the hulls of its pieces may grow."""
        part, tighter = failing.on_solid, 1 - failing.cuts * self.proxy.margin(self.goal)
        tree = CutTree(Component((part.vertices, part.faces)), self.policy, self.run)
        new = cut_and_merge(tree, self.goal.scaled(tighter), self.run).parts
        cuts = failing.cuts + 1
        return [_Transferred(part.hull, part, True, cuts) for part in new] or [replace(failing, cuts=cuts)]

    def confirmed(self, hull: Hull) -> Part | None:
        """Get what the solid fills of a hull; None if it does not meet the goal."""
        part = self.solid.filled(hull)
        return part if self.goal.is_met(part) else None

    def _cover(self, moved: Sequence[_Transferred], simple: bool = True) -> None:
        """Grow hulls where necessary to cover the solid's surface; those that need not grow stay the same."""
        points = self.solid.filling.uncovered(
            [each.hull.body for each in moved],
            2 * self.proxy.deviation + SIMPLE_FIRST,
            GROWTH_TO_SPARE,
            self.run.threads,
        )
        for each, own in zip(moved, points, strict=True):
            if len(own):
                each.grow(own, simple)

    def _clip(self, moved: Sequence[_Transferred]) -> None:
        """Get what the solid fills of hulls that have changed."""
        changed = [each for each in moved if each.part is None]
        for each, part in zip(changed, self.run.map(self.solid.filled, [each.hull for each in changed]), strict=True):
            each.part = part

    def _failing(self, moved: list[_Transferred]) -> list[int]:
        """Indices of the parts that fail on the solid, but for those that were cut there `MOST_CUTS` times."""
        asked = [i for i, each in enumerate(moved) if each.cuts < MOST_CUTS and not each.is_met]
        for i, met in zip(asked, self.run.map(self._met, [moved[i] for i in asked]), strict=True):
            if met is not None:
                moved[i] = replace(moved[i], hull=met.hull, part=met, is_met=True)
        return [i for i in asked if not moved[i].is_met]

    def _met(self, moved: _Transferred) -> Part | None:
        """Its part of the solid if that meets the goal, with its simple hull or else its exact one."""
        part = moved.on_solid
        if self.goal.is_met(part):
            return part
        exact = Hull.of(part.vertices) if moved.cuts == 0 else None
        return tight if exact is not None and self.goal.is_met(tight := part.with_hull(exact)) else None


@dataclass(frozen=True)
class Model:
    """A solid, and the proxy that is cut in its place if it is dense.

    Attributes
    ----------
    solid : Component
    proxy : Proxy or None
    """

    solid: Component
    proxy: Proxy | None

    @classmethod
    def of(cls, solid: Component, pieces: Sequence[Shape], goal: Criterion, run: Run) -> Model:
        """Make the model of a solid; `pieces` are closed solids whose union it is (see `simplify`)."""
        proxy = None
        if math.isfinite(goal.outward_deviation) and len(solid.faces) >= DENSE:
            try:
                with run.stage("simplify"):
                    proxy = simplify(solid, goal.outward_deviation, run.threads, pieces)
            except Stopped:
                run.note_stop()
        return cls(solid, proxy)

    @property
    def component(self) -> Component:
        """The component that is cut: the proxy, or else the solid."""
        return self.solid if self.proxy is None else self.proxy.component

    def tighter(self, goal: Criterion, factor: float = 1.0) -> Criterion:
        """Get the tighter goal for parts of the model, so that those of the solid meet the goal, scaled by a factor."""
        if self.proxy is None:
            return goal if factor == 1.0 else goal.scaled(factor)
        return goal.alone.scaled(factor - self.proxy.margin(goal))

    def transfer(
        self, parts: list[Part], goal: Criterion, factor: float, policy: Policy, run: Run, *, merge: bool
    ) -> list[Part]:
        """Transfer parts of the model to the solid, where they meet the goal, scaled by a factor."""
        assert self.proxy is not None
        scaled = goal if factor == 1.0 else goal.scaled(factor)
        with run.stage("transfer"):
            moving = Transfer(self.solid, self.proxy, scaled, policy, run)
            parts, worst = moving(parts)
            if merge and run.stopped_by is None:  # the margin may have kept some from merging
                moving = replace(moving, goal=scaled.scaled(worst))
                looser = moving.goal.alone.scaled(1 + self.proxy.margin(goal))
                parts = merge_transferred(parts, self.component, looser, moving.confirmed, run)
        return parts
