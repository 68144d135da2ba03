"""Cutting: components are judged, split and cut, all unfinished ones of a round together."""

from __future__ import annotations

from collections.abc import Sequence

from rlacd.clock import Clock
from rlacd.criteria import Criterion
from rlacd.policies import Policy
from rlacd.solid.component import Component
from rlacd.workers import Workers


class CutTree:
    """The cuts a policy makes of a solid, made when first asked for.

    Which plane cuts a component does not depend on the criterion, so a coarser criterion only stops higher up in the
    same tree.

    Parameters
    ----------
    root : Component
        The solid.
    policy : Policy
        Chooses the planes.
    workers : Workers
        Runs the kernels.
    """

    def __init__(self, root: Component, policy: Policy, workers: Workers) -> None:
        self._root = root
        self._policy = policy
        self._workers = workers
        self._children: dict[Component, list[Component]] = {}

    def cut_until(self, criterion: Criterion, clock: Clock) -> tuple[list[Component], list[Component]]:
        """Cut the solid until each component meets the criterion.

        Returns
        -------
        done : list of Component
            Components that meet the criterion.
        left : list of Component
            Components that do not: no plane cuts them, or the clock ran out first.
        """
        done: list[Component] = []
        left: list[Component] = []
        frontier = [self._root]
        while frontier:
            verdicts = self._workers.map(criterion.is_met, frontier)
            done += [c for c, met in zip(frontier, verdicts, strict=True) if met]
            unmet = [c for c, met in zip(frontier, verdicts, strict=True) if not met]
            if not clock.step(len(done), None, len(done) + len(left) + len(unmet)):
                return done, left + unmet
            self._divide([c for c in unmet if c not in self._children])
            frontier = []
            for component in unmet:
                children = self._children[component]
                frontier += children
                if not children:
                    left.append(component)
        return done, left

    def _divide(self, components: Sequence[Component]) -> None:
        """Split components into their connected pieces, and cut those that are in one piece already."""
        pieces = [component.pieces() for component in components]
        whole = [c for c, own in zip(components, pieces, strict=True) if len(own) == 1]
        threads = self._workers.share(len(whole))
        planes = dict(zip(whole, self._workers.map(lambda c: self._policy.choose(c, threads), whole), strict=True))
        for component, own in zip(components, pieces, strict=True):
            if len(own) == 1:
                plane = planes[component]
                own = [side for side in component.cut(plane) if side is not None] if plane is not None else []
            # A single side is what is left when the other one has no volume: cutting gets nowhere.
            self._children[component] = own if len(own) > 1 else []
