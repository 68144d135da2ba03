"""Rankings of planes, and what a search does with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rlacd.planes.sweep import Sweep
from rlacd.planes.views import Views
from rlacd.policies.greedy import SCORES, cheapest
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

Ranking: TypeAlias = Callable[[Component, Sweep], FloatArray]
"""What every plane of a component's sweep costs, the less the better [K * M]."""


def by_score(name: str) -> Ranking:
    """Get the ranking by one of the greedy policy's scores."""
    score = SCORES[name]
    return lambda component, seen: score(seen)


class Ranked:
    """The policy that takes the valid plane a ranking likes best.

    Parameters
    ----------
    ranking : Ranking
    views : Views
        Where the sweeps come from.
    """

    def __init__(self, ranking: Ranking, views: Views) -> None:
        self._ranking = ranking
        self._views = views

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None when every candidate misses it or shaves off a film."""
        seen = self._views.of(component, threads)
        return cheapest(seen, self._ranking(component, seen))
