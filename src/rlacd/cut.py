"""Cutting: all unfinished components of a round are judged, split and cut together."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rlacd.criteria import Criterion
from rlacd.policies import Policy
from rlacd.run import Run, work
from rlacd.solid.component import Component, is_thin
from rlacd.solid.frame import HALF_THICKNESS

MANY_COMPONENTS = 1000
"""With more components than this, a second policy is tried: there are solids that one policy breaks into thousands of
parts and another into tens (research/learning.md)."""

FAR_FEWER = 1 / 2
"""The second policy is abandoned at this share of the components, or of the work done for them."""


class CutTree:
    """The tree of cuts that a policy makes of a solid, computed on demand.

    Which plane cuts a component does not depend on the criterion's threshold, so a coarser criterion only stops higher
    up in the same tree. Only with more than `MANY_COMPONENTS` components, a second policy may take over for good.

    Parameters
    ----------
    root : Component
        The solid.
    policy : Policy
        Chooses the planes.
    run : Run
    second : Policy, optional
        Takes over if it leaves far fewer components (`FAR_FEWER`).
    """

    def __init__(self, root: Component, policy: Policy, run: Run, second: Policy | None = None) -> None:
        self.root = root
        self._policy = policy
        self._run = run
        self._children: dict[Component, list[Component]] = {}
        self._second = None if second is None else CutTree(root, second, run)

    def cut_until(
        self, criterion: Criterion, most: float = math.inf, units: float = math.inf
    ) -> tuple[list[Component], list[Component]]:
        """Cut the solid until each component meets the criterion.

        Parameters
        ----------
        most : float
            Stop as soon as it is clear that there will be more components than this.
        units : float
            Stop after a round in which more units of work than this have been done (see `rlacd.run.work`).

        Returns
        -------
        done : list of Component
            Components that meet the criterion.
        left : list of Component
            Components that do not: no plane cuts them, the run ended, or there would be more than `most`.
        """
        run, many = self._run, float(MANY_COMPONENTS)
        begin = run.work.done
        done: list[Component] = []
        left: list[Component] = []
        frontier = [self.root]
        with run.until_stopped():
            while frontier:
                if not run.work.pay(sum(work.judging(c.size, len(c.hull.faces)) for c in frontier)):
                    break
                verdicts = dict(zip(frontier, run.map(criterion.is_met, frontier), strict=True))
                done += [c for c in frontier if verdicts[c]]
                frontier = [c for c in frontier if not verdicts[c]]
                if not run.step(len(done), len(done) + len(left) + len(frontier)):
                    break
                count, spent = len(done) + len(left) + 2 * len(frontier), run.work.done - begin  # each becomes two
                if count > most or spent > units:
                    break
                if frontier and count > many:
                    if (parts := self._by_second(criterion, FAR_FEWER * count, FAR_FEWER * spent)) is not None:
                        return parts, []
                    many = math.inf
                new = [c for c in frontier if c not in self._children]
                if not run.work.pay(sum(work.choosing(c.size) + work.cutting(c.size) for c in new)):
                    break
                self._divide(new)
                left += [c for c in frontier if not self._children[c]]
                frontier = [child for c in frontier for child in self._children[c]]
        return done, left + frontier

    def _by_second(self, criterion: Criterion, most: float, units: float) -> list[Component] | None:
        """Cut by the second policy, which takes over if it finishes within the limits; None if it does not."""
        second = self._second
        if second is None:
            return None
        done, left = second.cut_until(criterion, most, units)
        if left:
            return None
        self._policy, self._children, self._second = second._policy, second._children, None
        return done

    def _divide(self, components: Sequence[Component]) -> None:
        """Split components into their connected pieces, and cut those that are connected."""
        prices = {c: work.choosing(c.size) for c in components}
        each = self._run.threads / max(sum(prices.values()), 1)
        costliest = sorted(components, key=prices.__getitem__, reverse=True)
        divided = self._run.map(lambda c: self._divided(c, math.ceil(each * prices[c])), costliest)
        self._children.update(zip(costliest, divided, strict=True))

    def _divided(self, component: Component, threads: int) -> list[Component]:
        """The connected pieces of a component, or the sides of the plane that cuts it; empty if none does.

        A sliver that no plane cuts is halved until it is small.
        """
        pieces = component.pieces()
        if len(pieces) > 1:
            return pieces
        plane = self._policy.choose(component, threads)
        if plane is None:
            if not is_thin(component) or np.ptp(component.box, axis=0).max() <= HALF_THICKNESS:
                return []
            # What is inside out has no volume, but its hull covers the surface: a side without volume is kept.
            return component.halved(0.5, principal=False, least=-math.inf)
        below, above = component.cut(plane)
        return [] if below is None or above is None else [below, above]
