"""The shipped policy: of the most promising planes, the one after which the fewest parts are to be expected.

An ensemble of small networks ranks planes by what the sweep gives for them. It was trained on the numbers of parts that
greedy ends in after each of several planes (`learned.md` beside the weights).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from rlacd.planes.sweep import SLIVERS, SweepCache
from rlacd.policies.greedy import Greedy, excess_norm, hull_sum
from rlacd.policies.network import Network, load_network
from rlacd.policies.plane_features import FEATURES, plane_features
from rlacd.solid.component import Component, Plane

KIND = "learned"

NAMES = tuple(f"learned_{number}.npz" for number in range(4))
"""Files of the ensemble's networks."""

PROMISING = 40
"""Number of planes of least excess, and of least hull sum, among which the networks choose: training saw few others."""

LEAST_GAIN = 0.02
"""Predicted saving in log(parts) for which the plane of least hull sum is given up: below it, predictions are noise."""

SIMPLE = 9.0
"""Excess of the component's hull, as the edge of a cube over the criterion's length, below which greedy decides: a
sweep takes three times as long as greedy's bounds. Of 68 meshes of `train/`, 8 and 11 leave 0.950 and 0.960 of the raw
parts of the least hull sum, in 1.6 and 1.3 times the time."""

TYPICAL_LENGTH = 0.06
"""Length of a criterion without one. With `SIMPLE` 8, lengths of 0.05, 0.07 and 0.09 leave 0.92, 0.90 and 0.93 of the
raw parts on 58 meshes of `train/` in navigable space (2.5%, 5%), in 2.0, 1.6 and 1.2 times the time."""


class Learned:
    """Chooses the plane of least predicted parts.

    Parameters
    ----------
    sweeps : SweepCache, optional
        Provides the 150 planes and those of reflex edges.
    scale : float, optional
        The criterion's length in the frame, if it has one.
    networks : sequence of Network, optional
        In place of the shipped ones.
    """

    def __init__(
        self,
        sweeps: SweepCache | None = None,
        scale: float | None = None,
        networks: Sequence[Network] | None = None,
    ) -> None:
        self._sweeps = sweeps or SweepCache()
        self._scale = scale
        self._networks = networks or shipped_networks()
        self._greedy = Greedy("hull-sum", sweeps=self._sweeps)

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose the plane to cut a component by; None if every candidate misses it or leaves a sliver."""
        excess = max(component.hull.volume - component.volume, 0.0)
        wide = SIMPLE * (self._scale or TYPICAL_LENGTH)
        if excess < wide * wide * wide:
            return self._greedy.choose(component, threads)
        scored = self._sweeps.of(component, threads)
        valid = next(filter(np.any, map(scored.valid, SLIVERS)), None)
        if valid is None:
            return None
        costs = [np.where(valid, score(scored), np.inf) for score in (hull_sum, excess_norm)]
        orders = [np.argsort(cost, kind="stable")[: min(PROMISING, int(valid.sum()))] for cost in costs]
        planes = np.array(list(dict.fromkeys(np.concatenate(orders).tolist())))  # that of least hull sum comes first
        volumes = component.hull.volume, component.volume
        features = plane_features(scored, valid, *volumes, np.ptp(component.box, axis=0), self._scale)[planes]
        predicted = np.mean([network(features.astype(np.float32))[:, 0] for network in self._networks], axis=0)
        best = int(predicted.argmin())
        return scored.candidates.plane(int(planes[best if predicted[best] < predicted[0] - LEAST_GAIN else 0]))


@lru_cache(maxsize=1)
def shipped_networks() -> list[Network]:
    """The networks in the package."""
    found = []
    for name in NAMES:
        with as_file(files("rlacd.policies") / name) as path:
            found += networks_in(path.parent, [name])
    return found


def networks_in(folder: Path, names: Sequence[str] = NAMES) -> list[Network]:
    """Read the networks that benchmarks/learned/fit.py wrote to a folder; raises as `load_network`."""
    return [load_network(folder / name, KIND, FEATURES, 1) for name in names]
