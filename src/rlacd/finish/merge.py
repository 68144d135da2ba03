"""Merging: pairs of parts whose joint hull still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.solid.component import Part
from rlacd.workers import Workers


class _Pair(NamedTuple):
    cost: float  # volume of the joint hull - what the criterion counts as filled by each
    first: int
    second: int


def merge_parts(
    parts: Sequence[Part], criterion: Criterion, workers: Workers, clock: Clock, beside: Sequence[Part] = ()
) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    The test looks at the glued union: its own surface against its own hull, both ways. Pairs are tested a batch at a
    time on all workers, and taken in the order of their cost whatever the number of workers.

    Parameters
    ----------
    parts : sequence of Part
        Solids with disjoint interiors.
    beside : sequence of Part
        More of them, of which no two are to be united with each other: that has been tried before.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece, those beside last.
    """
    alive: dict[int, Part] = dict(enumerate([*parts, *beside]))
    origin = {i: i for i in alive}
    queue = _pairs(alive, range(len(parts)), criterion, workers)
    heapq.heapify(queue)
    refused: dict[int, set[int]] = {i: set() for i in alive}  # whom a part, or a piece of it, was not united with
    unions: dict[_Pair, Part | None] = {}  # verdicts on pairs that are back in the queue
    count = newest = len(alive)
    while queue and clock.step(count - len(alive), None, len(alive)):
        batch = _cheapest(queue, alive, 2 * workers.threads)
        new = [pair for pair in batch if pair not in unions]
        unions.update(
            zip(new, workers.map(lambda p: _unite(alive[p.first], alive[p.second], criterion), new), strict=True)
        )
        for taken, pair in enumerate(batch, start=1):
            union = unions.pop(pair)
            if union is None:
                refused[pair.first].add(pair.second)
                refused[pair.second].add(pair.first)
                continue
            origin[newest] = min(origin[pair.first], origin[pair.second])
            del alive[pair.first], alive[pair.second]
            alive[newest] = union
            refused[newest] = refused.pop(pair.first) | refused.pop(pair.second) if criterion.is_hereditary else set()
            for i in refused[newest] & alive.keys():
                refused[i].add(newest)
            asked = {i: part for i, part in alive.items() if i not in refused[newest]}
            for other in [*batch[taken:], *_pairs(asked, [newest], criterion, workers)]:
                heapq.heappush(queue, other)
            newest += 1
            break
    return [alive[i] for i in sorted(alive, key=origin.__getitem__)]


def _cheapest(queue: list[_Pair], alive: dict[int, Part], most: int) -> list[_Pair]:
    """Take the cheapest pairs of parts that are still there off the queue."""
    batch: list[_Pair] = []
    while queue and len(batch) < most:
        pair = heapq.heappop(queue)
        if pair.first in alive and pair.second in alive:
            batch.append(pair)
    return batch


def _unite(first: Part, second: Part, criterion: Criterion) -> Part | None:
    union = Part.glued(first, second)
    return union if criterion.is_met(union) else None


def _pairs(alive: Mapping[int, Part], new: Sequence[int], criterion: Criterion, workers: Workers) -> list[_Pair]:
    """Pairs of a new part with any other that the criterion's reach and volume bound allow, and their costs."""
    return [
        _Pair(hull_volume - (criterion.filled(alive[first]) + criterion.filled(alive[second])), first, second)
        for first, second, volume, hull_volume in neighbours(alive, new, criterion.reach, workers)
        if not criterion.excludes(volume, hull_volume)
    ]


def neighbours(
    alive: Mapping[int, Part], new: Sequence[int], reach: float, workers: Workers
) -> list[tuple[int, int, float, float]]:
    """Pairs of a new part with any other whose boxes lie within reach: (first, second, volume, joint hull's volume)."""
    ids, parts, among = list(alive), list(alive.values()), set(new)
    is_new = np.array([i in among for i in ids])
    rows = np.flatnonzero(is_new)
    boxes = np.array([part.box for part in parts])
    gap = np.maximum(boxes[rows, None, 0] - boxes[:, 1], boxes[:, 0] - boxes[rows, None, 1])
    k, other = np.nonzero(np.sqrt(np.square(np.maximum(gap, 0.0)).sum(axis=2)) <= reach)
    once = (rows[k] < other) | ~is_new[other]  # two new parts find each other twice
    pairs = np.sort(np.stack([rows[k], other], axis=1)[once], axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    corners = [part.hull.vertices for part in parts]
    hulls = _native.joint_hull_volumes(corners, pairs.astype(np.int32), workers.threads)
    return [
        (ids[i], ids[j], parts[i].volume + parts[j].volume, hull)
        for (i, j), hull in zip(pairs.tolist(), hulls.tolist(), strict=True)
    ]


def merge_to_count(
    parts: Sequence[Part],
    count: int,
    criterion: Criterion,
    workers: Workers,
    clock: Clock,
    worst: float = np.inf,
) -> list[Part] | None:
    """Unite parts, the pair with the least error of its union first, until no more than `count` are left.

    Errors are measured only for pairs whose lower bound could make them the best (lazy best-first search), first among
    neighbours, then among all parts.

    Parameters
    ----------
    worst : float
        Give up (None) as soon as a union is needed whose error is not below this.

    Raises
    ------
    ValueError
        `count` is less than 1.
    """
    if count < 1:
        raise ValueError("at least one part has to be left")
    alive: dict[int, Part] = dict(enumerate(parts))
    origin = {i: i for i in alive}
    newest = len(parts)
    reach = criterion.reach
    queue = _bounded_pairs(alive, list(alive), reach, criterion, workers)
    while len(alive) > count and clock.step(len(parts) - len(alive), len(parts) - count, len(alive)):
        pair = _pop_least(queue, alive, criterion)
        if pair is None:
            if reach == np.inf:
                break
            reach = np.inf
            queue = _bounded_pairs(alive, list(alive), reach, criterion, workers)
            continue
        if pair.error >= worst:
            return None
        union = Part.glued(alive.pop(pair.first), alive.pop(pair.second))
        origin[newest] = min(origin[pair.first], origin[pair.second])
        alive[newest] = union
        queue += _bounded_pairs(alive, [newest], reach, criterion, workers)
        heapq.heapify(queue)
        newest += 1
    return [alive[i] for i in sorted(alive, key=origin.__getitem__)]


@dataclass(order=True, frozen=True)
class _BoundedPair:
    error: float  # of the union: a lower bound, or the measured value
    first: int
    second: int
    measured: bool


def _bounded_pairs(
    alive: dict[int, Part], new: Sequence[int], reach: float, criterion: Criterion, workers: Workers
) -> list[_BoundedPair]:
    queue = [
        _BoundedPair(criterion.least_error(volume, hull_volume), first, second, False)
        for first, second, volume, hull_volume in neighbours(alive, new, reach, workers)
    ]
    heapq.heapify(queue)
    return queue


def _pop_least(queue: list[_BoundedPair], alive: dict[int, Part], criterion: Criterion) -> _BoundedPair | None:
    """Take the pair whose union has the least error off the queue; None when there is no pair left."""
    while queue:
        pair = heapq.heappop(queue)
        if pair.first not in alive or pair.second not in alive:
            continue
        if pair.measured:
            return pair
        error = criterion.error(Part.glued(alive[pair.first], alive[pair.second]))
        heapq.heappush(queue, _BoundedPair(max(error, pair.error), pair.first, pair.second, True))
    return None
