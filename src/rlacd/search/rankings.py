"""Rankings of planes, and what a search does with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from rlacd.planes.sweep import Sweep
from rlacd.planes.views import Views
from rlacd.policies.greedy import SCORES, cheapest
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

Ranking: TypeAlias = Callable[[Component, Sweep], FloatArray]
"""What every plane of a component's sweep costs, the less the better [K * M]."""

APART = 0.15
"""Planes of one direction are different when they are this share of the component's extent apart."""

PARALLEL = 0.999
"""Least cosine between the normals of planes of one direction."""


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
    first : Plane, optional
        The plane of the first component that is asked for, whatever the ranking says.
    """

    def __init__(self, ranking: Ranking, views: Views, first: Plane | None = None) -> None:
        self._ranking = ranking
        self._views = views
        self._first = first

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None when every candidate misses it or shaves off a film."""
        if self._first is not None:
            plane, self._first = self._first, None
            return plane
        seen = self._views.of(component, threads)
        return cheapest(seen, self._ranking(component, seen))


def diverse(seen: Sweep, cost: FloatArray, most: int) -> list[Plane]:
    """Take up to `most` valid planes of least cost that differ in direction or place."""
    valid = seen.valid()
    extent = seen.thickness_below + seen.thickness_above
    normals = np.repeat(seen.candidates.directions, seen.candidates.offsets.shape[1], axis=0)
    offsets = seen.candidates.offsets.ravel()
    taken: list[int] = []
    for index in map(int, np.argsort(np.where(valid, cost, np.inf), kind="stable")):
        if len(taken) == most or not valid[index]:
            break
        cosines = normals[taken] @ normals[index]
        gaps = np.abs(np.sign(cosines) * offsets[taken] - offsets[index])
        if not ((np.abs(cosines) > PARALLEL) & (gaps < APART * extent[index])).any():
            taken.append(index)
    return [seen.candidates.plane(index) for index in taken]
