"""The loop: load, repair, cut until every component meets the criterion, merge, finish."""

from __future__ import annotations

from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.policies import Policy
from rlacd.solid.component import Component, Plane
from rlacd.workers import Workers


def cut_until_done(
    solid: Component, criterion: Criterion, policy: Policy, workers: Workers, clock: Clock
) -> tuple[list[Component], list[Component]]:
    """Cut a solid until each component meets the criterion.

    All unfinished components of a round are judged, split into connected pieces, and cut together.

    Returns
    -------
    done : list of Component
        Components that meet the criterion.
    left : list of Component
        Components that do not: no plane cuts them, or the clock ran out first.
    """
    done: list[Component] = []
    left: list[Component] = []
    frontier = [solid]
    while frontier:
        verdicts = workers.map(criterion.is_met, frontier)
        done += [c for c, met in zip(frontier, verdicts, strict=True) if met]
        unmet = [c for c, met in zip(frontier, verdicts, strict=True) if not met]
        if not clock.step(len(done), None, len(done) + len(unmet)):
            return done, left + unmet

        frontier, whole = [], []
        for component in unmet:
            pieces = component.pieces()
            if len(pieces) > 1:
                frontier += pieces
            else:
                whole += pieces
        threads = workers.share(len(whole))
        planes = workers.map(lambda c: policy.choose(c, threads), whole)  # noqa: B023
        for component, plane in zip(whole, planes, strict=True):
            children = _cut(component, plane)
            if len(children) < 2:
                left.append(component)
            frontier += children if len(children) == 2 else []
    return done, left


def _cut(component: Component, plane: Plane | None) -> list[Component]:
    if plane is None:
        return []
    return [child for child in component.cut(plane) if child is not None]
