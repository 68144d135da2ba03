"""Rankings of planes, by which a search cuts."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import Greedy, Policy

Ranking: TypeAlias = Callable[[SweepCache], Policy]
"""Makes the policy that takes the plane it likes best of those that the views offer."""


def by_score(name: str) -> Ranking:
    """Get the ranking by one of the greedy policy's scores."""
    return lambda sweeps: Greedy(name, sweeps=sweeps)
