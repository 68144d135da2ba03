"""From the parts of a proxy back to parts of the solid it stands for.

Every hull takes in what of the solid's surface it misses (`Filling.uncovered`), so that together the hulls cover the
solid; its part is then the solid clipped to it. Each part is tested on the solid itself. One that fails is cut again:
on the proxy under a tighter criterion, at last, or where the proxy cannot be cut, on the solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd._native import Stopped
from rlacd.clock import Clock
from rlacd.criteria import Criterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge.limits import limit_hull
from rlacd.policies import Policy
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part
from rlacd.solid.hull import Hull
from rlacd.solid.reunite import reunite
from rlacd.workers import Workers

GRAIN = 5e-4
"""Hulls may grow by this more than they must to cover the solid (the longest side is 2)."""

SMOOTH = 2e-3
"""The hulls of a proxy's parts are simplified within this first: they have to grow anyway."""

TRIM = 1e-3
"""Grown hulls are simplified within this: noise gives them many corners."""

TIGHTER = 0.8
"""Parts that fail on the solid are cut again under a criterion tighter by this factor, and by its powers."""

ROUNDS = 3
"""Number of times that parts are cut again on the proxy."""


@dataclass(frozen=True)
class Lift:
    """Carries parts of a proxy to the solid.

    Attributes
    ----------
    solid : Component
    deviation : float
        Of the proxy.
    goal : Criterion
        Tests the parts on the solid.
    on_proxy : Criterion
        The criterion for parts on the proxy.
    policy : Policy
        Chooses the planes where parts are cut again.
    workers : Workers
    clock : Clock
        When it stops, the parts stay those of the proxy, with hulls that cover the solid.
    """

    solid: Component
    deviation: float
    goal: Criterion
    on_proxy: Criterion
    policy: Policy
    workers: Workers
    clock: Clock

    def __call__(self, parts: Sequence[Part], mend: bool = True) -> list[Part]:
        """Get the parts of the solid; together they cover it.

        Parameters
        ----------
        parts : sequence of Part
            They cover the proxy.
        mend : bool
            Cut parts again if they meet their criterion on the proxy only.
        """
        origins: list[Part | None] = list(parts)  # None for a part that was cut on the solid
        with self.clock.shielded():
            hulls = self._covering([limit_hull(part.hull, tolerance=SMOOTH) for part in parts])
        try:
            return self._tested(hulls, origins) if mend else self.workers.map(self._clipped, hulls)
        except Stopped:
            self.clock.note_stop()
            return [part.with_hull(hull) for part, hull in zip(parts, hulls, strict=True)]

    def _tested(self, hulls: list[Hull], origins: list[Part | None]) -> list[Part]:
        """Clip the solid to the hulls and cut parts again until all meet the goal."""
        known: dict[int, Part] = {}  # by their hulls
        met: set[int] = set()
        criterion = self.on_proxy
        for round_ in range(ROUNDS + 2):
            fresh = [hull for hull in hulls if id(hull) not in known]
            known |= {id(part.hull): part for part in self.workers.map(self._clipped, fresh)}
            lifted = [known[id(hull)] for hull in hulls]
            if round_ > ROUNDS:
                break
            failing = self._failing({i: part for i, part in enumerate(lifted) if id(part) not in met}, origins)
            if not failing:
                break
            met = {id(part) for part in lifted} - {id(lifted[i]) for i in failing}
            known = {id(part.hull): part for part in lifted}  # and keeps the hulls, whose ids stay theirs
            criterion = criterion.scaled(TIGHTER)
            for i in reversed(failing):
                origin = origins[i]
                assert origin is not None
                on_proxy = round_ < ROUNDS and self.on_proxy.is_met(origin)  # else the proxy could not be cut there
                new = self._on_proxy(origin, criterion) if on_proxy else self._on_solid(lifted[i])
                origins[i : i + 1] = new if on_proxy else [None] * len(new)
                hulls[i : i + 1] = [limit_hull(part.hull, tolerance=SMOOTH) for part in new]
            hulls = self._covering(hulls)
        return lifted

    def confirmed(self, hull: Hull) -> Part | None:
        """Get what the solid fills of a hull; None if it does not meet the goal."""
        part = self._clipped(hull)
        return part if self.goal.is_met(part) else None

    def _covering(self, hulls: Sequence[Hull]) -> list[Hull]:
        """The hulls, grown where necessary to cover the solid's surface; those that need not grow are the same."""
        points = self.solid.filling.uncovered(
            [hull.vertices for hull in hulls],
            [hull.faces for hull in hulls],
            2 * self.deviation + SMOOTH,
            GRAIN,
            self.workers.threads,
        )
        return [_grown(hull, own) if len(own) else hull for hull, own in zip(hulls, points, strict=True)]

    def _clipped(self, hull: Hull) -> Part:
        """What the solid fills of a hull; the hull itself if that is nothing."""
        part = self.solid.inside(hull)
        return part if part.size else Part(hull.vertices, hull.faces, hull.volume, hull)

    def _failing(self, lifted: dict[int, Part], origins: Sequence[Part | None]) -> list[int]:
        """Indices of the parts that fail on the solid, but for those that were cut there before."""
        verdicts = self.workers.map(self.goal.is_met, lifted.values())
        return [i for i, met in zip(lifted, verdicts, strict=True) if not met and origins[i] is not None]

    def _on_proxy(self, part: Part, criterion: Criterion) -> list[Part]:
        whole = reunite(part.members)
        roots = [whole] if whole is not None else list(part.members)
        return [new for root in roots for new in self._cut(root, criterion)] or [part]

    def _on_solid(self, part: Part) -> list[Part]:
        return self._cut(Component((part.vertices, part.faces)), self.goal) or [part]

    def _cut(self, root: Component, criterion: Criterion) -> list[Part]:
        return cut_and_merge(CutTree(root, self.policy, self.workers), criterion, self.workers, self.clock).parts


def _grown(hull: Hull, points: FloatArray) -> Hull:
    grown = Hull.of(np.concatenate([hull.vertices, points]))
    assert grown is not None, "a hull stays solid when it grows"
    return limit_hull(grown, tolerance=TRIM)
