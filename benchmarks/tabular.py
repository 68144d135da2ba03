"""Tabular dual-state Q-learning on cut trees small enough to solve exactly (the paper's appendix A).

A *cut tree* holds everything that a few planes can make of a solid in a few cuts. Either every node is its own state,
or all nodes that look alike share one: a partial observation sees a component's shape but not its size, so a component
and a piece of it can be the same state, and the process has loops although every solid is finite. With discounts that
add up to less than 1 the Bellman operator is a contraction in the maximum norm, and Q-learning converges; for shares of
the hull volume that holds wherever a cut saves volume. With constant discounts that add up to more than 1 values grow
along the loops without bound; at exactly 1 they grow as long as a loop has a positive reward.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rlacd.criteria import Criterion
from rlacd.learn.environment import CutEnv
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component

MIDDLE = OFFSETS_PER_AXIS // 2

DIVERGED = 1e100
"""Values beyond this have diverged."""

UNKNOWN = -1
"""A child below the tree's last level that looks like no known state: its value is 0."""


@dataclass(frozen=True)
class TabularOutcome:
    """Outcome of cutting a node by a plane.

    Attributes
    ----------
    action : int
    saved : float
        r_1, relative to the node's own hull.
    finished : float
        r_2 of the process whose solid is the node.
    children : list of Node
        The unfinished children.
    discounts : list of float
        Eq. 9.
    """

    action: int
    saved: float
    finished: float
    children: list[Node]
    discounts: list[float]


@dataclass(eq=False)
class Node:
    """A component and its outcomes for a few planes; empty at the last level.

    Attributes
    ----------
    looks : tuple of int
        A coarse partial observation: shape, not size.
    """

    hull_volume: float
    looks: tuple[int, ...]
    outcomes: list[TabularOutcome] = field(default_factory=list)


def middle_planes(axes: Sequence[int] = (0, 1, 2)) -> list[int]:
    """Indices of the candidates that halve a component's extent along the given directions (of 6)."""
    return [axis * OFFSETS_PER_AXIS + MIDDLE for axis in axes]


def grow(solid: Component, criterion: Criterion, planes: Sequence[int], depth: int, bins: int = 3) -> list[Node]:
    """Try all of `planes` on a solid's unfinished components, then on their pieces, and so on, `depth` cuts deep.

    Returns
    -------
    list of Node
        The unfinished components of the solid.
    """
    return [_grow(component, criterion, planes, depth, bins) for component in CutEnv(solid, criterion).unfinished]


def _grow(component: Component, criterion: Criterion, planes: Sequence[int], depth: int, bins: int) -> Node:
    node = Node(component.hull.volume, _looks(component, bins))
    for action, plane in enumerate(planes if depth > 0 else ()):
        cutting = CutEnv(component, criterion)
        if not cutting.unfinished:
            break
        cut = cutting.step(component, cutting.candidates(component).plane(plane))
        if cut.left.stuck != [component]:
            children = [_grow(child, criterion, planes, depth - 1, bins) for child in cut.left.unfinished]
            node.outcomes.append(TabularOutcome(action, cut.saved, cut.finishes, children, cut.discounts))
    return node


def _looks(component: Component, bins: int) -> tuple[int, ...]:
    extent = np.sort(np.ptp(component.box, axis=0))
    shape = [component.volume / component.hull.volume, extent[0] / extent[2], extent[1] / extent[2]]
    return tuple(min(int(bins * s), bins - 1) for s in shape)


def all_nodes(roots: Sequence[Node]) -> list[Node]:
    """All nodes, parents before their children."""
    found, waiting = [], list(roots)
    while waiting:
        node = waiting.pop()
        found.append(node)
        waiting += [child for outcome in node.outcomes for child in outcome.children]
    return found


@dataclass(frozen=True, eq=False)
class Process:
    """A finite decision process: every (state, action) leads to one of its samples, all equally likely.

    Attributes
    ----------
    State * actions + action of each sample.
        Of each sample, state * actions + action.
    reward : float64 [N]
    owner, child : int64 [C]
        Sample and state of each child; `UNKNOWN` for a child of value 0.
    discount : float64 [C]
    states, actions : int
    """

    pair: NDArray[np.int64]
    reward: FloatArray
    owner: NDArray[np.int64]
    child: NDArray[np.int64]
    discount: FloatArray
    states: int
    actions: int

    @property
    def possible(self) -> NDArray[np.bool_]:
        """Which (state, action) pairs have a sample [S, A]."""
        seen: NDArray[np.bool_] = np.zeros(self.states * self.actions, dtype=bool)
        seen[self.pair] = True
        return seen.reshape(self.states, self.actions)

    def values(self, q: FloatArray) -> FloatArray:
        """V(s) = max_a Q(s, a) over possible actions [S], followed by 0 for `UNKNOWN` [S + 1]."""
        best = np.where(self.possible, q, -np.inf).max(axis=1)
        return np.append(np.where(np.isfinite(best), best, 0.0), 0.0)

    def targets(self, q: FloatArray) -> FloatArray:
        """Right-hand side of eq. 8 for every sample [N]."""
        target = self.reward.copy()
        np.add.at(target, self.owner, self.discount * self.values(q)[self.child])
        return target

    def backup(self, q: FloatArray) -> FloatArray:
        """Bellman operator: expected targets [S, A]."""
        pairs = self.states * self.actions
        total = np.bincount(self.pair, self.targets(q), pairs)
        backed: FloatArray = (total / np.maximum(np.bincount(self.pair, minlength=pairs), 1)).reshape(q.shape)
        return backed

    def solve(self, iterations: int = 10_000, tolerance: float = 1e-10) -> FloatArray | None:
        """Exact dynamic programming: Q* [S, A]; None if it does not converge."""
        q = np.zeros((self.states, self.actions))
        for _ in range(iterations):
            backed = self.backup(q)
            change, size = float(np.abs(backed - q).max()), float(np.abs(backed).max())
            q = backed
            if size > DIVERGED:
                break
            if change <= tolerance * max(1.0, size):
                return q
        return None


def process_of(
    roots: Sequence[Node],
    *,
    alike: bool,
    static_discount: float | None = None,
    volume_reward: float = 1.0,
    finish_reward: float = 1.0,
) -> Process:
    """Build a process from cut trees.

    Parameters
    ----------
    alike : bool
        Whether nodes that look alike share a state; otherwise each node is its own.
    static_discount : float, optional
        Constant discount of each child, instead of its share of the hull volume (eq. 9).
    """
    nodes = [node for node in all_nodes(roots) if node.outcomes]
    key: Callable[[Node], object] = (lambda node: node.looks) if alike else id
    number: dict[object, int] = {}
    for node in nodes:
        number.setdefault(key(node), len(number))
    actions = 1 + max(outcome.action for node in nodes for outcome in node.outcomes)
    samples = [(number[key(node)], outcome) for node in nodes for outcome in node.outcomes]
    links = [(i, c, d) for i, (_, o) in enumerate(samples) for c, d in zip(o.children, o.discounts, strict=True)]
    return Process(
        np.array([state * actions + outcome.action for state, outcome in samples]),
        np.array([volume_reward * o.saved + finish_reward * o.finished for _, o in samples]),
        np.array([i for i, _, _ in links], dtype=np.int64),
        np.array([number.get(key(child), UNKNOWN) for _, child, _ in links], dtype=np.int64),
        np.array([d if static_discount is None else static_discount for _, _, d in links], dtype=np.float64),
        len(number),
        actions,
    )


def q_learning(
    process: Process, steps: int, rng: np.random.Generator, *, every: int = 1000, rate: float = 0.51
) -> list[FloatArray]:
    """Learn Q from one sample at a time, all pairs equally likely; the step size is (visits of the pair) ** -rate.

    Step sizes with a rate in (1/2, 1] meet the conditions of stochastic approximation.

    Returns
    -------
    list of float64 [S, A]
        Q before the first step, and after every `every` steps; the last ones may be infinite.
    """
    q = np.zeros((process.states, process.actions))
    possible = process.possible
    visits = np.zeros(q.shape)
    starts = np.searchsorted(process.owner, np.arange(len(process.pair) + 1))
    history = [q.copy()]
    by_pair = np.argsort(process.pair, kind="stable")
    _, first, count = np.unique(process.pair[by_pair], return_index=True, return_counts=True)
    pairs = rng.integers(len(first), size=steps)
    draws = by_pair[first[pairs] + rng.integers(count[pairs])]
    for step, sample in enumerate(draws, start=1):
        target = process.reward[sample]
        for link in range(starts[sample], starts[sample + 1]):
            child = process.child[link]
            if child != UNKNOWN:
                target += process.discount[link] * q[child][possible[child]].max()
        state, action = divmod(process.pair[sample], process.actions)
        visits[state, action] += 1
        q[state, action] += visits[state, action] ** -rate * (target - q[state, action])
        if step % every == 0:
            history.append(q.copy())
    return history
