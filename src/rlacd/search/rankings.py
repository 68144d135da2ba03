"""Rankings of planes, by which a search cuts."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rlacd.planes.views import Views
from rlacd.policies import Greedy, Policy

Ranking: TypeAlias = Callable[[Views], Policy]
"""Makes the policy that takes the plane it likes best of those that the views offer."""


def by_score(name: str) -> Ranking:
    """Get the ranking by one of the greedy policy's scores."""
    return lambda views: Greedy(name, views=views)
