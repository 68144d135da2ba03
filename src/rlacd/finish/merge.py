"""Merging: pairs of parts whose joint hull still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from rlacd import _native
from rlacd._native import Stopped, poll_stop
from rlacd.clock import Clock
from rlacd.criteria.criterion import Chance, Criterion
from rlacd.solid.arrays import BoolArray, FloatArray, IntArray
from rlacd.solid.component import LOST, Component, Part, Share
from rlacd.solid.hull import Hull
from rlacd.workers import Workers

FEW = 100
"""Among so many parts every pair may be united across what lies between; among more, those that a third is near to."""


AT_ONCE = 512
"""The clock is asked before so many pairs are held against the solid, or parts against all others."""


class _Pair(NamedTuple):
    cost: float  # volume of the joint hull - what the criterion counts as filled by each
    first: int
    second: int


def merge_parts(
    parts: Sequence[Part],
    criterion: Criterion,
    workers: Workers,
    clock: Clock,
    beside: Sequence[Part] = (),
    solid: Component | None = None,
) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    The test looks at the glued union: its own surface against its own hull, both ways. When no pair is left that meets
    it so, parts are united across what lies between them, where the solid is given: there the test looks at all that
    the solid fills of the joint hull (`Share`). Pairs are tested a batch at a time on all workers, and taken in the
    order of their cost whatever the number of workers.

    Parameters
    ----------
    parts : sequence of Part
        Solids with disjoint interiors.
    beside : sequence of Part
        More of them, of which no two are to be united with each other: that has been tried before.
    solid : Component, optional
        What all of them are parts of.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece, those beside last.
    """
    pairs = _Adjoining(criterion, workers)
    alive = _unite_pairs([*parts, *beside], len(parts), pairs, workers, clock)
    if solid is None:
        return alive
    waiting = {id(part) for part in beside}
    new = [part for part in alive if id(part) not in waiting]
    old = [part for part in alive if id(part) in waiting]
    return _unite_pairs([*new, *old], len(new), _Bridged(criterion, workers, clock, solid), workers, clock)


class _Pairing(Protocol):
    """Which pairs of parts may become one, and how that is found out."""

    def pairs(self, alive: Mapping[int, Part], new: Sequence[int]) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Pairs of a new part with any other that may be united, and their costs; and pairs that can never be."""

    def unite(self, first: Part, second: Part) -> tuple[Part | None, bool]:
        """Their union if it meets the criterion; otherwise None, and whether no larger union will either."""


def _unite_pairs(parts: Sequence[Part], new: int, pairing: _Pairing, workers: Workers, clock: Clock) -> list[Part]:
    """Unite pairs, of which one at least is among the first `new` parts or made of them."""
    alive: dict[int, Part] = dict(enumerate(parts))
    origin = {i: i for i in alive}
    refused: dict[int, set[int]] = {i: set() for i in alive}  # whom a part, or a piece of it, can never be united with

    def refuse(first: int, second: int) -> None:
        refused[first].add(second)
        refused[second].add(first)

    try:
        queue, never = pairing.pairs(alive, range(new))
        heapq.heapify(queue)
        for first, second in never:
            refuse(first, second)
        verdicts: dict[_Pair, tuple[Part | None, bool]] = {}  # on pairs that are back in the queue
        count = newest = len(alive)
        while queue and clock.step(count - len(alive), None, len(alive)):
            batch = _cheapest(queue, alive, 2 * workers.threads)
            fresh = [pair for pair in batch if pair not in verdicts]
            verdicts.update(
                zip(fresh, workers.map(lambda p: pairing.unite(alive[p.first], alive[p.second]), fresh), strict=True)
            )
            for taken, pair in enumerate(batch, start=1):
                union, for_good = verdicts.pop(pair)
                if union is None:
                    if for_good:
                        refuse(pair.first, pair.second)
                    continue
                origin[newest] = min(origin[pair.first], origin[pair.second])
                del alive[pair.first], alive[pair.second]
                alive[newest] = union
                refused[newest] = refused.pop(pair.first) | refused.pop(pair.second)
                for i in refused[newest] & alive.keys():
                    refused[i].add(newest)
                asked = {i: part for i, part in alive.items() if i not in refused[newest]}
                found, never = pairing.pairs(asked, [newest])
                for first, second in never:
                    refuse(first, second)
                for other in [*batch[taken:], *found]:
                    heapq.heappush(queue, other)
                newest += 1
                break
    except Stopped:  # between two unions
        clock.note_stop()
    return [alive[i] for i in sorted(alive, key=origin.__getitem__)]


def _cheapest(queue: list[_Pair], alive: dict[int, Part], most: int) -> list[_Pair]:
    """Take the cheapest pairs of parts that are still there off the queue."""
    batch: list[_Pair] = []
    while queue and len(batch) < most:
        pair = heapq.heappop(queue)
        if pair.first in alive and pair.second in alive:
            batch.append(pair)
    return batch


@dataclass(frozen=True)
class _Adjoining:
    """Pairs within the criterion's reach, judged by themselves."""

    criterion: Criterion
    workers: Workers

    def pairs(self, alive: Mapping[int, Part], new: Sequence[int]) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Those that the volume bound allows."""
        filled = self.criterion.filled
        found = [
            _Pair(hull_volume - (filled(alive[first]) + filled(alive[second])), first, second)
            for first, second, volume, hull_volume in neighbours(alive, new, self.criterion.reach, self.workers)
            if not self.criterion.excludes(volume, hull_volume)
        ]
        return found, []

    def unite(self, first: Part, second: Part) -> tuple[Part | None, bool]:
        """Glue them."""
        union = Part.glued(first, second)
        return (union, False) if self.criterion.is_met(union) else (None, self.criterion.is_hereditary)


@dataclass(frozen=True)
class _Bridged:
    """All pairs (of many parts, those near each other or a third), judged by the solid's share of the joint hull."""

    criterion: Criterion
    workers: Workers
    clock: Clock
    solid: Component

    def pairs(self, alive: Mapping[int, Part], new: Sequence[int]) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Those with a chance: how much the solid fills is not known yet."""
        filled = self.criterion.filled
        reach = np.inf if len(alive) <= FEW else self.criterion.reach
        ids, pairs = _near_pairs(alive, new, reach, across=True)
        hulls = [part.hull for part in alive.values()]
        found: list[_Pair] = []
        never: list[tuple[int, int]] = []
        for some in np.split(pairs, range(AT_ONCE, len(pairs), AT_ONCE)):
            if not self.clock.goes_on():
                break
            volumes, chances = self.criterion.chances(self.solid.filling, hulls, some, self.workers.threads)
            for (i, j), volume, chance in zip(some.tolist(), volumes.tolist(), chances.tolist(), strict=True):
                first, second = ids[i], ids[j]
                if chance == Chance.SOME:
                    found.append(_Pair(volume - (filled(alive[first]) + filled(alive[second])), first, second))
                elif chance == Chance.NEVER:
                    never.append((first, second))
        return found, never

    def unite(self, first: Part, second: Part) -> tuple[Part | None, bool]:
        """Take the solid's share of the joint hull."""
        return _share(first, second, Hull.around(first.hull, second.hull), self.criterion, self.solid), False


def unite(first: Part, second: Part, criterion: Criterion, solid: Component, hull: Hull | None = None) -> Part | None:
    """Unite two parts of a solid, as they are or across what lies between them; None where neither is allowed.

    Their joint hull may be given where it is known.
    """
    hull = hull or Hull.around(first.hull, second.hull)
    chance = criterion.chance(solid.filling, hull)
    if chance is Chance.NONE:
        return None
    if is_alone(first) and is_alone(second):  # otherwise they may overlap each other
        union = Part.glued(first, second, hull)
        if not criterion.excludes(union.volume, hull.volume) and criterion.is_met(union):
            return union
    return _share(first, second, hull, criterion, solid) if chance is Chance.SOME else None


def is_alone(part: Part) -> bool:
    """Tell whether a part is made of its members only, and of nothing that other parts have too."""
    return part.volume <= (1 + LOST) * sum(member.volume for member in part.members)


def _share(first: Part, second: Part, hull: Hull, criterion: Criterion, solid: Component) -> Share | None:
    share = Share(solid, first, second, hull)
    fits = share.is_whole and not criterion.excludes(share.volume, hull.volume)
    return share if fits and criterion.is_met(share) else None


def neighbours(
    alive: Mapping[int, Part], new: Sequence[int], reach: float, workers: Workers
) -> list[tuple[int, int, float, float]]:
    """Pairs of a new part with any other whose boxes lie within reach: (first, second, volume, joint hull's volume)."""
    ids, pairs = _near_pairs(alive, new, reach)
    parts = list(alive.values())
    hulls = _native.joint_hull_volumes([part.hull.vertices for part in parts], pairs, workers.threads)
    return [
        (ids[i], ids[j], parts[i].volume + parts[j].volume, hull)
        for (i, j), hull in zip(pairs.tolist(), hulls.tolist(), strict=True)
    ]


def _near_pairs(
    alive: Mapping[int, Part], new: Sequence[int], reach: float, across: bool = False
) -> tuple[list[int], IntArray]:
    """The ids of all parts, and pairs [P, 2] of places among them: of a new part with any other within reach.

    With `across`, also pairs both of which are within reach of a third.
    """
    ids, parts, among = list(alive), list(alive.values()), set(new)
    is_new = np.array([i in among for i in ids])
    rows = np.flatnonzero(is_new)
    boxes = np.array([part.box for part in parts])
    near = _near(boxes[rows], boxes, reach)
    if across:
        between = near.any(axis=0)
        beyond = _near(boxes[between], boxes, reach).astype(np.float32)
        for some in _rows(len(near)):
            near[some] |= near[some][:, between].astype(np.float32) @ beyond > 0
    k, other = np.nonzero(near)
    once = (rows[k] < other) | ~is_new[other]  # two new parts find each other twice
    pairs = np.sort(np.stack([rows[k], other], axis=1)[once], axis=1)
    return ids, np.ascontiguousarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], dtype=np.int32)


def _near(some: FloatArray, boxes: FloatArray, reach: float) -> BoolArray:
    """Which boxes [N, 2, 3] lie within reach of which others [S, 2, 3]: [S, N]."""
    near = np.empty((len(some), len(boxes)), dtype=bool)
    for rows in _rows(len(some)):
        gap = np.maximum(some[rows, None, 0] - boxes[:, 1], boxes[:, 0] - some[rows, None, 1])
        near[rows] = np.sqrt(np.square(np.maximum(gap, 0.0)).sum(axis=2)) <= reach
    return near


def _rows(count: int) -> Iterator[slice]:
    """Rows of a table, some at a time: between them the work may be stopped."""
    for first in range(0, count, AT_ONCE):
        poll_stop()
        yield slice(first, first + AT_ONCE)


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
    try:
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
            union = Part.glued(alive[pair.first], alive[pair.second])
            del alive[pair.first], alive[pair.second]
            origin[newest] = min(origin[pair.first], origin[pair.second])
            alive[newest] = union
            queue += _bounded_pairs(alive, [newest], reach, criterion, workers)
            heapq.heapify(queue)
            newest += 1
    except Stopped:  # between two unions
        clock.note_stop()
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
