"""What all functions of a search share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from rlacd.criteria.criterion import Criterion
from rlacd.planes.sweep import SweepCache
from rlacd.policies import Greedy, Policy
from rlacd.solid.component import Component

Ranking: TypeAlias = Callable[[SweepCache], Policy]
"""Makes a policy that takes the best-ranked plane of a component's sweep."""

PLANES_PER_AXIS = 12
"""Neighbourhoods are small: half the planes give results as good in half the time."""

CONCAVE_EDGES = 2
"""Zero, two and four make little difference: 0.82, 0.81 and 0.81 of the parts after 4 s (nine meshes, one seed)."""

FEW_PARTS = 20
"""With more parts than this, searching around the first pass gains more per unit of work than another pass, and trials
begin without waiting for the least number of parts."""


def by_score(name: str) -> Ranking:
    """Get a ranking by one of the greedy policy's scores."""
    return lambda sweeps: Greedy(name, sweeps=sweeps)


PORTFOLIO = (by_score("excess-norm"), by_score("hull-sum"), by_score("max-excess"))
"""Rankings for further passes over the whole solid, best first."""


@dataclass(frozen=True)
class SearchContext:
    """The problem that a search solves and the tools it solves it with.

    Attributes
    ----------
    root : Component
        The solid.
    criterion : Criterion
        Every new part meets it.
    seed : int
    sweeps : SweepCache
        Sweeps of the solid's components, including those of the first pass.
    rankings : sequence of Ranking
        Used to cut neighbourhoods and, if time allows, for further passes over the whole solid; the more successful
        ones are used more often.
    enough : callable
        Returns the least number of parts of any decomposition: the search ends there. May wait for that.
    near_sweeps : SweepCache
        Coarser sweeps of components in neighbourhoods.
    """

    root: Component
    criterion: Criterion
    seed: int = 0
    sweeps: SweepCache = field(default_factory=SweepCache)
    rankings: Sequence[Ranking] = PORTFOLIO
    enough: Callable[[], int] = lambda: 1
    near_sweeps: SweepCache = field(default_factory=lambda: SweepCache(PLANES_PER_AXIS, CONCAVE_EDGES))
