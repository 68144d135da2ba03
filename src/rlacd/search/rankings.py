"""Rankings of planes for the search."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import Greedy, Policy

Ranking: TypeAlias = Callable[[SweepCache], Policy]
"""Makes a policy that takes the best-ranked plane of a component's sweep."""


def by_score(name: str) -> Ranking:
    """Get a ranking by one of the greedy policy's scores."""
    return lambda sweeps: Greedy(name, sweeps=sweeps)
