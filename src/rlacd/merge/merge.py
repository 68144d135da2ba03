"""Merging: pairs of parts whose union still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import Boxes, Stopped
from rlacd.criteria.criterion import Criterion
from rlacd.merge.numbered import NumberedParts
from rlacd.run import Begun, Run, Work, work
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import LOST_VOLUME, ClippedPart, Component, Part
from rlacd.solid.hull import Hull

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


def merge_parts(
    parts: Sequence[Part],
    criterion: Criterion,
    run: Run,
    solid: Component | None = None,
) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    First the criterion judges the glued union of each pair. When no more pairs can be united this way and `solid` is
    given, parts are united across what lies between them: there it judges the solid clipped to the joint hull
    (`ClippedPart`). Pairs are tested in batches on all workers and united in order of cost, for any number of threads.

    Parameters
    ----------
    parts : sequence of Part
        Parts; they may overlap where the solid was clipped.
    criterion : Criterion
        Every union meets it.
    run : Run
        When it stops, the parts reached so far are returned.
    solid : Component, optional
        The solid that was decomposed.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece.
    """
    alive = _Merging(parts, _Adjoining(criterion, run), run).united()
    return alive if solid is None else _Merging(alive, _Bridged(criterion, run, solid), run).united()


def merge_transferred(
    parts: Sequence[Part],
    proxy: Component,
    rehearsal: Criterion,
    confirmed: Callable[[Hull], Part | None],
    run: Run,
) -> list[Part]:
    """Unite pairs of parts transferred from a proxy to a solid, if their joint hull is tight on both.

    Parameters
    ----------
    parts : sequence of Part
        They may overlap, and need not consist of components.
    proxy : Component
        Rejects most pairs quickly.
    rehearsal : Criterion
        The criterion for the proxy clipped to a joint hull.
    confirmed : callable
        Returns the solid clipped to a hull, or None if it does not meet the criterion.
    run : Run
    """
    return _Merging(parts, _Bridged(rehearsal, run, proxy, few=0, confirmed=confirmed), run).united()


@dataclass(frozen=True)
class _Adjoining:
    """Pairs within the criterion's reach, judged by their glued union."""

    criterion: Criterion
    run: Run

    def pairs(self, alive: NumberedParts, new: Sequence[int]) -> list[_Pair]:
        """Pairs of a new part and another that may be united, by a bound on volumes.

        Incomplete if the run's work runs out.
        """
        early_out = self.criterion.early_out
        pairs = alive.boxes.pairs(new, early_out.reach)
        vertices, volumes, filled = alive.sums(pairs)
        if not self.run.work.pay(work.joining(vertices.sum(), len(pairs))):
            return []
        hulls = _native.joint_hull_volumes(alive.bodies, pairs, self.run.threads)
        kept = ~early_out.excludes(volumes, hulls)
        return _priced(pairs[kept], (hulls - filled)[kept])

    def unite(self, first: Part, second: Part) -> tuple[Part | None, float]:
        """Unite two parts if the union meets the criterion; also returns the work of deciding."""
        union, price = Part.glued(first, second), price_of_uniting(first, second)
        is_met = union.size > 0 and self.criterion.is_met(union)  # without faces: it could not be clipped
        return union if is_met else None, price


@dataclass(frozen=True)
class _Bridged(_Adjoining):
    """All pairs (see `FEW_TO_PAIR`), judged by the solid clipped to their joint hull.

    Unions on a proxy are then `confirmed` on the solid that it stands for.
    """

    solid: Component
    few: int = FEW_TO_PAIR
    confirmed: Callable[[Hull], Part | None] | None = None

    def pairs(self, alive: NumberedParts, new: Sequence[int]) -> list[_Pair]:
        """Pairs whose joint hulls the solid may fill well enough, by an early-out test."""
        early_out, run = self.criterion.early_out, self.run
        reach = np.inf if len(alive.parts) <= self.few else early_out.reach
        pairs = alive.boxes.pairs(new, reach, across=True)
        found: list[_Pair] = []
        for begin in range(0, len(pairs), PAIRS_AT_ONCE):
            some = pairs[begin : begin + PAIRS_AT_ONCE]
            vertices, _, filled = alive.sums(some)
            if not run.may_continue() or not run.work.pay(work.screening(vertices.sum(), len(some))):
                break
            volumes = early_out.feasible_volumes(self.solid.filling, alive.bodies, some, run.threads)
            may = np.isfinite(volumes)
            found += _priced(some[may], (volumes - filled)[may])
        return found

    def unite(self, first: Part, second: Part) -> tuple[Part | None, float]:
        """Test the joint hull more thoroughly, and clip the solid to it."""
        hull = Hull.around(first.hull, second.hull)
        price = work.testing(len(hull.vertices))
        if not self.criterion.early_out.is_feasible(self.solid.filling, hull):
            return None, price
        union: Part | None = _clipped(first, second, hull, self.criterion, self.solid)
        if union is not None and self.confirmed is not None:
            union = self.confirmed(hull)
        return union, price + price_of_uniting(first, second, is_clipped=True)


def _priced(pairs: IntArray, costs: FloatArray) -> list[_Pair]:
    return list(map(_Pair, costs.tolist(), *pairs.T.tolist()))


class _Merging:
    """Parts that are being united."""

    def __init__(self, parts: Sequence[Part], pairing: _Adjoining, run: Run) -> None:
        self._alive = NumberedParts(parts, pairing.criterion.early_out)
        self._pairing = pairing
        self._run = run
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
        alive, unite, threads = self._alive.parts, self._pairing.unite, self._run.threads
        while self._queue and len(self._next) < (threads if threads == 1 else threads + 1):  # none waits for the next
            pair = heapq.heappop(self._queue)
            if pair.first in alive and pair.second in alive:
                self._next.append(pair)
                if pair not in self._begun:
                    self._begun[pair] = self._run.start(partial(unite, alive[pair.first], alive[pair.second]))

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
        for pair in self._pairing.pairs(self._alive, new):
            heapq.heappush(self._queue, pair)


@dataclass(frozen=True)
class Uniter:
    """Unites parts of a solid, two at a time, glued or across what lies between them.

    Attributes
    ----------
    criterion : Criterion
        Every union meets it.
    solid : Component
        The solid that was decomposed.
    account : Work
        Pays for the work; when too little is left, nothing is united any more.
    """

    criterion: Criterion
    solid: Component
    account: Work

    def feasible(self, part: Part, others: Sequence[Part]) -> list[tuple[int, float]]:
        """Find which of other parts within reach may be united with a part, and the volumes of the joint hulls.

        Returns
        -------
        list of (int, float)
            Index and volume. Empty if too little work is left.
        """
        early_out = self.criterion.early_out
        hulls = [part.hull, *(other.hull for other in others)]
        bodies = [hull.body for hull in hulls]
        pairs = Boxes(bodies).pairs([0], early_out.reach)
        near = pairs[:, 1].tolist()
        vertices = sum(len(part.hull.vertices) + len(hulls[i].vertices) for i in near)
        if not self.account.pay(work.screening(vertices, len(near))):
            return []
        if early_out.looks_inside:
            volumes = early_out.feasible_volumes(self.solid.filling, bodies, pairs, 1)
        else:
            volumes = _native.joint_hull_volumes(bodies, pairs, 1)
        return [(i - 1, volume) for i, volume in zip(near, volumes.tolist(), strict=True) if math.isfinite(volume)]

    def unite_feasible(self, first: Part, second: Part) -> Part | None:
        """Unite two parts that may be united; None if no union meets the criterion after all."""
        hull = Hull.around(first.hull, second.hull)
        early_out = self.criterion.early_out
        if is_alone(first) and is_alone(second):  # otherwise they may overlap
            if not self.account.pay(price_of_uniting(first, second)):
                return None
            union = Part.glued(first, second, hull)
            if not early_out.excludes(union.volume, hull.volume) and self.criterion.is_met(union):
                return union
        if not early_out.looks_inside or not self.account.pay(price_of_uniting(first, second, is_clipped=True)):
            return None
        return _clipped(first, second, hull, self.criterion, self.solid)


def price_of_uniting(first: Part, second: Part, is_clipped: bool = False) -> float:
    """The work of gluing two parts, or clipping the solid to their joint hull, and of judging the union."""
    faces, hull_faces = first.size + second.size, len(first.hull.faces) + len(second.hull.faces)
    return (work.filling(faces, hull_faces) if is_clipped else work.gluing(faces)) + work.judging(faces, hull_faces)


def is_alone(part: Part) -> bool:
    """Whether a part consists only of its members and shares nothing with other parts."""
    return part.volume <= (1 + LOST_VOLUME) * sum(member.volume for member in part.members)


def _clipped(first: Part, second: Part, hull: Hull, criterion: Criterion, solid: Component) -> ClippedPart | None:
    clipped = ClippedPart(solid, (first, second), hull)
    fits = clipped.is_whole and not criterion.early_out.excludes(clipped.volume, hull.volume)
    return clipped if fits and criterion.is_met(clipped) else None


def united_in_turn(
    parts: Sequence[Part],
    unite: Callable[[Part, Part], Part],
    criterion: Criterion,
    account: Work,
    run: Run,
) -> Iterator[tuple[list[Part], float]]:
    """Unite parts, always the pair whose union has the least error, until one is left; yield each state and its error.

    Errors are measured only for pairs whose lower bound could make them the best (lazy best-first search), first among
    neighbours, then among all parts.

    Parameters
    ----------
    parts : sequence of Part
    unite : callable
        Returns the union of two parts.
    criterion : Criterion
        Measures the errors; unions need not meet it.
    account : Work
        Pays for measuring. When it is spent, or the run ends, nothing is united any more.
    run : Run
    """
    numbered = NumberedParts(parts, criterion.early_out)
    alive, origin = numbered.parts, list(range(len(parts)))
    try:
        errors = dict(zip(alive, run.map(criterion.error, parts), strict=True))
        reach = FIRST_REACH
        queue = _bounded_pairs(numbered, list(alive), reach, criterion, run)
        while True:
            yield [alive[i] for i in sorted(alive, key=origin.__getitem__)], max(errors.values())
            pair = _pop_least(queue, alive, unite, criterion, account)
            if pair is None and math.isfinite(reach):
                reach = math.inf
                queue = _bounded_pairs(numbered, list(alive), reach, criterion, run)
                pair = _pop_least(queue, alive, unite, criterion, account)
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
    errors = map(criterion.early_out.least_error, volumes.tolist(), hulls.tolist())
    queue = [_BoundedPair(error, i, j, None) for error, (i, j) in zip(errors, pairs.tolist(), strict=True)]
    heapq.heapify(queue)
    return queue


def _pop_least(
    queue: list[_BoundedPair],
    alive: dict[int, Part],
    unite: Callable[[Part, Part], Part],
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
        if not account.pay(price_of_uniting(alive[pair.first], alive[pair.second])):
            return None
        union = unite(alive[pair.first], alive[pair.second])
        heapq.heappush(queue, pair._replace(error=max(criterion.error(union), pair.error), union=union))
    return None
