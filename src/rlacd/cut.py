"""Cutting: components are judged, split and cut, all unfinished ones of a round together."""

from __future__ import annotations

from collections.abc import Sequence

from rlacd import _native
from rlacd.clock import Clock
from rlacd.criteria import Criterion
from rlacd.policies import Policy
from rlacd.solid.component import Component
from rlacd.workers import Workers

FILM = 2e-4
"""Mean thickness (twice the volume over the area) below which a piece may be a shaving; sheets are 10 times thicker."""

MISSED = 1e-3
"""No point of a shaving is farther than this from the solid that stands for it."""


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
        self._across: dict[Component, Component] = {}  # the other side of the last cut

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
                frontier += self._children[component]
                if not self._children[component]:
                    left.append(component)
        return done, left

    def _divide(self, components: Sequence[Component]) -> None:
        """Split components into their connected pieces, and cut those that are in one piece already."""
        pieces = [component.pieces() for component in components]
        whole = [c for c, own in zip(components, pieces, strict=True) if len(own) == 1]
        threads = self._workers.share(len(whole))
        planes = self._workers.map(lambda c: self._policy.choose(c, threads), whole)
        for component, own in zip(components, pieces, strict=True):
            if len(own) > 1:
                across = self._across.get(component)
                kept = [piece for piece in own if across is None or not is_shaving(piece, across)]
                self._children[component] = kept
                self._across.update((piece, across) for piece in kept if across is not None)
        for component, plane in zip(whole, planes, strict=True):
            below, above = component.cut(plane) if plane is not None else (None, None)
            if below is None or above is None:  # no plane leaves a volume on both sides
                self._children[component] = []
                continue
            self._across[below], self._across[above] = above, below
            self._children[component] = [side for side in (below, above) if not is_shaving(side, self._across[side])]


def is_shaving(piece: Component, across: Component) -> bool:
    """Tell whether a piece is a film that a cut nearly parallel to the surface has taken off the solid across it.

    Films have ragged outlines that hardly any number of cuts makes convex, and the solid they came from stands for
    them: every point of a shaving is within `MISSED` of it.
    """
    if 2 * piece.volume > FILM * _native.mesh_area(piece.vertices, piece.faces):
        return False
    surface = _native.Surface(across.vertices, across.faces)
    _, farthest = _native.directed_hausdorff(piece.vertices, piece.faces, surface, MISSED / 4, 1)
    return farthest <= MISSED
