"""Labels: states of a mesh's cut tree, and the final number of parts for some planes of each.

The label of a state and a plane: cut, let the policy finish both sides, merge, and count the parts. This is what the
policy would reach in the end, except that parts of this component are not merged with others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from manifold3d import Manifold

from rlacd.criteria import Concavity
from rlacd.learn.ranker.rollout import Cost, Rollouts, RolloutState
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.planes.sweep import Sweep
from rlacd.policies.features import DIRECTIONS, measures, tables
from rlacd.policies.greedy import excess_norm, hull_sum, max_excess
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component

ROOM = 1.6
"""A rollout is given up at this multiple of the first one's parts (plus `SPARE`)."""

SPARE = 3

USUAL = 8
"""States that end in more parts are labelled less often, in proportion to the cost of a rollout."""

RANKED = 4
"""Number of planes labelled from the top of the ranking."""


@dataclass
class Labels:
    """States of one mesh, and labels for some of their planes.

    As arrays (see `arrays`): ``grid`` [S, 6, M, 10], ``edges`` [S, 12, 10] (see `rlacd.policies.features.tables`),
    ``whole`` [S, 4] and ``scale`` [S] of the S states; ``state``, ``plane``, ``parts`` (merged; where given up, more
    than any other of the state) and ``given_up`` [L] of the labels.
    """

    grid: list[FloatArray] = field(default_factory=list)
    edges: list[FloatArray] = field(default_factory=list)
    whole: list[FloatArray] = field(default_factory=list)
    scale: list[float] = field(default_factory=list)
    state: list[int] = field(default_factory=list)
    plane: list[int] = field(default_factory=list)
    parts: list[int] = field(default_factory=list)
    given_up: list[bool] = field(default_factory=list)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all arrays; empty if there are no labels."""
        if not self.parts:
            return {}
        kinds = {"state": np.int32, "plane": np.int16, "parts": np.int16, "given_up": np.bool_}
        return {k: np.asarray(getattr(self, k), kinds.get(k, np.float32)) for k in self.__dataclass_fields__}


def label(
    manifold: Manifold,
    threshold: float,
    cost: Cost,
    budget: int,
    rng: np.random.Generator,
    most: int = 40,
) -> Labels:
    """Label states visited while a policy cuts a solid.

    Parameters
    ----------
    manifold : Manifold
        The solid.
    threshold : float
        Threshold of the concavity criterion.
    cost : Cost
        The policy that rollouts follow; its planes of least cost are labelled.
    budget : int
        Number of sweeps after which no new state is started.
    most : int
        States that end in more parts than this are not labelled.
    """
    rollouts = Rollouts(Concavity(threshold), cost)
    waiting = list(rollouts.settle(Component(manifold)).open)
    labels = Labels()
    while waiting and rollouts.sweeps < budget:
        state = waiting.pop(int(rng.integers(len(waiting))))
        rollouts.sweeps += 1
        chosen = state.choose(cost)
        if chosen < 0:
            continue
        onward = chosen
        base = rollouts.complete(rollouts.cut(state, chosen), most)
        count = 0 if base is None else len(base)
        if base is not None and rng.random() * count < USUAL:
            planes = _candidates(state, cost, rng)
            _add(labels, rollouts, state, planes, int(ROOM * count) + SPARE)
            if rng.random() < 0.25:
                onward = planes[int(rng.integers(len(planes)))]
        waiting += rollouts.cut(state, onward).open
        state.outcomes = {onward: state.outcomes[onward]}
    return labels


def _add(labels: Labels, rollouts: Rollouts, state: RolloutState, planes: list[int], most: int) -> None:
    finished = [rollouts.complete(rollouts.cut(state, plane), most) for plane in planes]
    counts = [None if parts is None else rollouts.merged(parts) for parts in finished]
    worst = max(count for count in counts if count is not None)
    labels.plane += planes
    labels.state += [len(labels.scale)] * len(planes)
    labels.parts += [worst + 1 if count is None else count for count in counts]
    labels.given_up += [count is None for count in counts]
    grid, edges = tables(state.sweep)
    labels.grid.append(grid)
    labels.edges.append(edges)
    labels.whole.append(measures(state.component))
    labels.scale.append(rollouts.criterion.threshold)


def _candidates(state: RolloutState, cost: Cost, rng: np.random.Generator) -> list[int]:
    """The policy's plane, the best of its ranking and of each greedy score, and some random ones."""
    planes: list[int] = []
    costs = cost(state.component, state.sweep)
    scores = [score(state.sweep) for score in (excess_norm, hull_sum, max_excess)]
    noisy = np.log(scores[0] + 1e-12) + rng.gumbel(size=len(costs))
    drawn = rng.random(len(costs))
    edges = np.arange(len(costs)) >= DIRECTIONS * OFFSETS_PER_AXIS
    wanted = [(costs, RANKED), *((score, 1) for score in scores), (noisy, 1), (drawn, 1)]
    wanted += [(np.where(edges, x, np.inf), n) for x, n in ((costs, 2), (scores[0], 1), (drawn, 1))]
    for wanting, count in wanted:
        for plane in shortlist(np.where(state.valid, wanting, np.inf), count, OFFSETS_PER_AXIS):
            if not any(_same(state.sweep, plane, other) for other in planes):
                planes.append(plane)
    return planes


def shortlist(cost: FloatArray, count: int, per_axis: int) -> list[int]:
    """Pick the `count` planes of least cost, no two of them neighbours; planes of infinite cost are excluded.

    Parameters
    ----------
    cost : float64 [6 * per_axis + E]
    per_axis : int
        Planes along each direction.
    """
    left = cost.copy()
    picked: list[int] = []
    while len(picked) < count and np.isfinite(left).any():
        best = int(np.argmin(left))
        picked.append(best)
        first = best if best >= DIRECTIONS * per_axis or best % per_axis == 0 else best - 1
        last = best if best >= DIRECTIONS * per_axis or best % per_axis == per_axis - 1 else best + 1
        left[first : last + 1] = np.inf
    return picked


def _same(s: Sweep, i: int, j: int) -> bool:
    """Tell whether two planes coincide, one along a coordinate axis and one along a principal axis."""
    return i == j or (
        s.hull_below[i] == s.hull_below[j]
        and s.hull_above[i] == s.hull_above[j]
        and s.thickness_below[i] == s.thickness_below[j]
    )
