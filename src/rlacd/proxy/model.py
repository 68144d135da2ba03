"""What is cut in place of a solid: the solid itself, or a simpler copy of a dense one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rlacd._native import Stopped
from rlacd.criteria import Criterion
from rlacd.merge import merge_lifted
from rlacd.policies import Policy
from rlacd.proxy.lift import Lift
from rlacd.proxy.simplify import FEW_TRIANGLES, Proxy, simplify
from rlacd.run import Run
from rlacd.solid.component import Component, Part
from rlacd.solid.solid import Shape

MARGIN = 1.5
"""Parts of a proxy have to be tighter by this share of its deviation: their hulls still have to grow to the solid."""


@dataclass(frozen=True)
class Model:
    """A solid, and the proxy that is cut in its place if it is dense.

    Attributes
    ----------
    solid : Component
    proxy : Proxy or None
    threshold : float
        Of the criterion, which the proxy's deviation is a share of.
    """

    solid: Component
    proxy: Proxy | None
    threshold: float

    @classmethod
    def of(cls, solid: Component, pieces: Sequence[Shape], goal: Criterion, run: Run) -> Model:
        """Make the model of a solid; `pieces` are closed solids whose union it is (see `simplify`)."""
        proxy = None
        if math.isfinite(goal.overhang) and len(solid.faces) >= FEW_TRIANGLES:
            try:
                with run.stage("simplify"):
                    proxy = simplify(solid, goal.overhang, run.threads, pieces)
            except Stopped:
                run.note_stop()
        return cls(solid, proxy, goal.overhang)

    @property
    def component(self) -> Component:
        """What is cut."""
        return self.solid if self.proxy is None else self.proxy.component

    def tighter(self, goal: Criterion, factor: float = 1.0) -> Criterion:
        """Get what parts of the model have to meet so that those of the solid meet the goal, scaled by a factor."""
        return goal.scaled(factor - self._margin) if self.proxy is not None or factor != 1.0 else goal

    def lift(self, parts: list[Part], goal: Criterion, policy: Policy, run: Run, *, merge: bool) -> list[Part]:
        """Carry parts of the model to the solid, where they meet the goal; nothing to do where it is the solid."""
        if self.proxy is None:
            return parts
        with run.stage("lift"):
            lift = Lift(self.solid, self.proxy.deviation, goal, self.tighter(goal), policy, run)
            parts = lift(parts, mend=run.stopped_by is None)
            if merge and run.stopped_by is None:  # the margin may have kept some apart
                looser = goal.scaled(1 + self._margin)
                parts = merge_lifted(parts, self.component, looser, lift.confirmed, run)
        return parts

    @property
    def _margin(self) -> float:
        return 0.0 if self.proxy is None else MARGIN * self.proxy.deviation / self.threshold
