"""Merging: pairs of parts whose union still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import Boxes, Stopped
from rlacd.criteria.criterion import Criterion
from rlacd.merge.numbered import NumberedParts
from rlacd.run import Begun, Run, Work, work
from rlacd.solid.component import Part

FEW_TO_PAIR = 100
"""Up to this many parts, any pair may be united across other parts; with more, only pairs near each other or a third
part."""

PAIRS_AT_ONCE = 512
"""Number of pairs tested against the solid between two checks of the run."""

FIRST_REACH = 0.05
"""Where few hulls are asked for, parts within this (the longest side is 2) are united before all others."""


class _Pair(NamedTuple):
    cost: float  # volume of the joint hull minus what the criterion counts as filled for each part
    first: int
    second: int


def merge_parts(parts: Sequence[Part], criterion: Criterion, run: Run, across: bool = True) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    First neighbours, then parts across what lies between them. Pairs are tested in batches on all workers and united in
    order of cost, for any number of threads.

    Parameters
    ----------
    parts : sequence of Part
        Parts; their hulls may overlap.
    criterion : Criterion
        Every union meets it.
    run : Run
        When it stops, the parts reached so far are returned.
    across : bool
        Whether parts are united across others, too.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece.
    """
    near = _Merging(parts, criterion, run, across=False).united()
    return _Merging(near, criterion, run, across=True).united() if across else near


def joint_part(first: Part, second: Part, criterion: Criterion) -> tuple[Part | None, float]:
    """Unite two parts if the union meets the criterion; also returns the work of deciding."""
    union = Part.joint(first, second)
    return union if criterion.is_met(union) else None, work.uniting(len(union.hull.vertices))


class _Merging:
    """Parts that are being united."""

    def __init__(self, parts: Sequence[Part], criterion: Criterion, run: Run, across: bool) -> None:
        self._alive = NumberedParts(parts, criterion)
        self._criterion = criterion
        self._run = run
        self._across = across
        self._origin = list(range(len(parts)))  # the number of the first piece
        self._queue: list[_Pair] = []
        self._next: list[_Pair] = []  # cheapest first
        self._begun: dict[_Pair, Begun[tuple[Part | None, float]]] = {}  # tests under way, begun ahead of need

    def united(self) -> list[Part]:
        """Unite pairs until none is left that may be united."""
        run, alive = self._run, self._alive.parts
        count = len(alive)
        try:
            self._find(range(count))
            while run.step(count - len(alive), None, len(alive)):
                self._begin()
                if not self._next:
                    break
                pair = self._next.pop(0)
                union, price = run.result(self._begun.pop(pair))
                # Pay in the order of the pairs: how many are begun, which depends on the threads, must not matter.
                if not run.work.pay(price):
                    break
                if union is not None:
                    self._replace(pair, union)
        except Stopped:  # raised between two unions
            run.note_stop()
        finally:
            run.drop(self._begun.values())
        return [alive[i] for i in sorted(alive, key=self._origin.__getitem__)]

    def _begin(self) -> None:
        """Begin the cheapest pairs whose parts both still exist."""
        alive, threads = self._alive.parts, self._run.threads
        while self._queue and len(self._next) < (threads if threads == 1 else threads + 1):  # none waits for the next
            pair = heapq.heappop(self._queue)
            if pair.first in alive and pair.second in alive:
                self._next.append(pair)
                if pair not in self._begun:
                    self._begun[pair] = self._run.start(
                        partial(joint_part, alive[pair.first], alive[pair.second], self._criterion)
                    )

    def _replace(self, pair: _Pair, union: Part) -> None:
        """Replace the parts of a pair by their union, and look for pairs that it makes."""
        self._alive.remove(pair[1:])
        newest = self._alive.add(union)
        self._origin.append(min(self._origin[pair.first], self._origin[pair.second]))
        for waiting in self._next:
            heapq.heappush(self._queue, waiting)
        self._next = []
        self._find([newest])

    def _find(self, new: Sequence[int]) -> None:
        """Find the pairs of a new part and another that may be united; not all of them if the run's work runs out."""
        alive, criterion, run = self._alive, self._criterion, self._run
        is_any = self._across and len(alive.parts) <= FEW_TO_PAIR
        pairs = alive.boxes.pairs(new, np.inf if is_any else criterion.reach, across=self._across)
        for begin in range(0, len(pairs), PAIRS_AT_ONCE):
            some = pairs[begin : begin + PAIRS_AT_ONCE]
            vertices, volumes, credits = alive.sums(some)
            price = work.screening if self._across else work.joining
            if not run.may_continue() or not run.work.pay(price(vertices.sum(), len(some))):
                break
            if self._across:
                joint = criterion.joint_volumes(alive.whole, alive.bodies, some, volumes, run.threads)
            else:  # most neighbours may be united, or are gone before it is their turn
                joint = _native.joint_hull_volumes(alive.bodies, some, run.threads)
            may = np.isfinite(joint)
            for pair in map(_Pair, (joint - credits)[may].tolist(), *some[may].T.tolist()):
                heapq.heappush(self._queue, pair)


def feasible_unions(part: Part, others: Sequence[Part], criterion: Criterion, account: Work) -> list[tuple[int, float]]:
    """Find which of other parts within reach may be united with a part, and the volumes of the joint hulls.

    Returns
    -------
    list of (int, float)
        Index and volume. Empty if the account holds too little work.
    """
    hulls = [part.hull, *(other.hull for other in others)]
    bodies = [hull.body for hull in hulls]
    pairs = Boxes(bodies).pairs([0], criterion.reach)
    near = pairs[:, 1]
    vertices = sum(len(part.hull.vertices) + len(hulls[i].vertices) for i in near.tolist())
    if not account.pay(work.screening(vertices, len(near))):
        return []
    filled = part.volume + np.array([others[i - 1].volume for i in near.tolist()])
    joint = criterion.joint_volumes(part.whole, bodies, pairs, filled, 1)
    may = np.isfinite(joint)
    return [*zip((near[may] - 1).tolist(), joint[may].tolist(), strict=True)]


def united_in_turn(
    parts: Sequence[Part], criterion: Criterion, account: Work, run: Run
) -> Iterator[tuple[list[Part], float]]:
    """Unite parts, always the pair whose union has the least error, until one is left; yield each state and its error.

    Errors are measured in the order of what the volumes alone tell of them (lazy best-first search), first among
    neighbours, then among all parts.

    Parameters
    ----------
    parts : sequence of Part
    criterion : Criterion
        Measures the errors; unions need not meet it.
    account : Work
        Pays for measuring. When it is spent, or the run ends, nothing is united any more.
    run : Run
    """
    numbered = NumberedParts(parts, criterion)
    alive, origin = numbered.parts, list(range(len(parts)))
    try:
        errors = dict(zip(alive, run.map(criterion.error, parts), strict=True))
        reach = FIRST_REACH
        queue = _bounded_pairs(numbered, list(alive), reach, criterion, run)
        while True:
            yield [alive[i] for i in sorted(alive, key=origin.__getitem__)], max(errors.values())
            pair = _pop_least(queue, alive, criterion, account)
            if pair is None and math.isfinite(reach):
                reach = math.inf
                queue = _bounded_pairs(numbered, list(alive), reach, criterion, run)
                pair = _pop_least(queue, alive, criterion, account)
            if pair is None or pair.union is None or not run.step(len(parts) - len(alive), len(parts), len(alive)):
                return
            numbered.remove([pair.first, pair.second])
            newest = numbered.add(pair.union)
            origin.append(min(origin[pair.first], origin[pair.second]))
            errors = {i: errors[i] for i in alive if i in errors} | {newest: pair.error}
            for bounded in _bounded_pairs(numbered, [newest], reach, criterion, run):
                heapq.heappush(queue, bounded)
    except Stopped:  # between two unions
        run.note_stop()


class _BoundedPair(NamedTuple):
    error: float  # of the union: a lower bound, or the value once there is one
    first: int
    second: int
    union: Part | None  # once it is measured


def _bounded_pairs(
    alive: NumberedParts, new: Sequence[int], reach: float, criterion: Criterion, run: Run
) -> list[_BoundedPair]:
    pairs = alive.boxes.pairs(new, reach)
    volumes, hulls = alive.sums(pairs)[1], _native.joint_hull_volumes(alive.bodies, pairs, run.threads)
    errors = map(criterion.volume_error, volumes.tolist(), hulls.tolist())
    queue = [_BoundedPair(error, i, j, None) for error, (i, j) in zip(errors, pairs.tolist(), strict=True)]
    heapq.heapify(queue)
    return queue


def _pop_least(
    queue: list[_BoundedPair],
    alive: dict[int, Part],
    criterion: Criterion,
    account: Work,
) -> _BoundedPair | None:
    """Pop the pair whose union has the least error; None if no pair is left, or too little work to find it."""
    while queue:
        pair = heapq.heappop(queue)
        if pair.first not in alive or pair.second not in alive:
            continue
        if pair.union is not None:
            return pair
        union = Part.joint(alive[pair.first], alive[pair.second])
        if not account.pay(work.uniting(len(union.hull.vertices))):
            return None
        heapq.heappush(queue, pair._replace(error=criterion.error(union), union=union))
    return None
