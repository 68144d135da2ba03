"""Merging: pairs of parts whose union still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np

from rlacd import _native
from rlacd._native import Boxes, Stopped
from rlacd.criteria.criterion import Criterion, Feasibility
from rlacd.run import Run, Work, work
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import LOST_VOLUME, ClippedPart, Component, Part
from rlacd.solid.hull import Hull

FEW_TO_PAIR = 100
"""Up to this many parts, any pair may be united across other parts; with more, only pairs near each other or near a
common third part."""

PAIRS_AT_ONCE = 512
"""Number of pairs tested against the solid between two checks of the run."""


class _Pair(NamedTuple):
    cost: float  # volume of the joint hull minus what the criterion counts as filled for each part
    first: int
    second: int


def merge_parts(
    parts: Sequence[Part],
    criterion: Criterion,
    run: Run,
    beside: Sequence[Part] = (),
    solid: Component | None = None,
) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    First the criterion judges the glued union of each pair. When no more pairs can be united this way and `solid` is
    given, parts are united across what lies between them: there it judges the solid clipped to the joint hull
    (`ClippedPart`). Pairs are tested in batches on all workers and united in order of their cost, whatever the number
    of threads.

    Parameters
    ----------
    parts : sequence of Part
        Parts with disjoint interiors.
    criterion : Criterion
        Every union meets it.
    run : Run
        When it stops, the parts reached so far are returned.
    beside : sequence of Part
        More parts. No two of them are united with each other: that has been tried before.
    solid : Component, optional
        The solid that was decomposed.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece, those from `beside` last.
    """
    pairs = _Adjoining(criterion, run)
    alive = _unite_pairs([*parts, *beside], len(parts), pairs, run)
    if solid is None:
        return alive
    waiting = {id(part) for part in beside}
    new = [part for part in alive if id(part) not in waiting]
    old = [part for part in alive if id(part) in waiting]
    return _unite_pairs([*new, *old], len(new), _Bridged(criterion, run, solid), run)


def merge_lifted(
    parts: Sequence[Part],
    proxy: Component,
    rehearsal: Criterion,
    confirmed: Callable[[Hull], Part | None],
    run: Run,
) -> list[Part]:
    """Unite pairs of parts that were carried from a proxy to a solid, if their joint hull is tight on both.

    Parameters
    ----------
    parts : sequence of Part
        They may overlap, and need not consist of components.
    proxy : Component
        Most pairs are rejected here, quickly.
    rehearsal : Criterion
        What the proxy clipped to a joint hull has to meet.
    confirmed : callable
        Returns the solid clipped to a hull, or None if it does not meet the criterion.
    run : Run
    """
    return _unite_pairs(parts, len(parts), _Lifted(rehearsal, run, proxy, few=0, confirmed=confirmed), run)


class _Verdict(NamedTuple):
    """On a pair of parts.

    Attributes
    ----------
    union : Part or None
        None if it does not meet the criterion.
    price : float
        The work of finding out.
    for_good : bool
        No larger union can meet the criterion either.
    """

    union: Part | None
    price: float
    for_good: bool = False


class _Pairing(Protocol):
    """A way to find pairs of parts that may be united, and to unite them."""

    def pairs(
        self, alive: Mapping[int, Part], boxes: Boxes, new: Sequence[int]
    ) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Pairs of a new part and another in the boxes that may be united, with costs; and pairs that never can be.

        Incomplete if the run's work runs out.
        """

    def unite(self, first: Part, second: Part) -> _Verdict:
        """Unite two parts if that meets the criterion."""


def _unite_pairs(parts: Sequence[Part], new: int, pairing: _Pairing, run: Run) -> list[Part]:
    """Unite pairs of which at least one is among the first `new` parts or made from them."""
    alive: dict[int, Part] = dict(enumerate(parts))
    origin = {i: i for i in alive}
    refused: dict[int, set[int]] = {i: set() for i in alive}  # parts that a part can never be united with

    def refuse(first: int, second: int) -> None:
        refused[first].add(second)
        refused[second].add(first)

    def begin(pair: _Pair) -> Future[_Verdict]:
        return run.start(partial(pairing.unite, alive[pair.first], alive[pair.second]))

    begun: dict[_Pair, Future[_Verdict]] = {}  # more than are needed, if an earlier one takes their parts away
    try:
        boxes = _boxes(alive)
        queue, never = pairing.pairs(alive, boxes, range(new))
        heapq.heapify(queue)
        for first, second in never:
            refuse(first, second)
        next_ones: list[_Pair] = []  # the cheapest, in their order
        count = newest = len(alive)
        while run.step(count - len(alive), None, len(alive)):
            next_ones += _cheapest(queue, alive, run.at_once - len(next_ones))
            if not next_ones:
                break
            begun |= {pair: begin(pair) for pair in next_ones if pair not in begun}
            pair = next_ones.pop(0)
            union, price, for_good = run.result(begun.pop(pair))
            # Pay in the order of the pairs: how many are begun, which depends on the threads, must not matter.
            if not run.work.pay(price):
                break
            if union is None:
                if for_good:
                    refuse(pair.first, pair.second)
                continue
            origin[newest] = min(origin[pair.first], origin[pair.second])
            del alive[pair.first], alive[pair.second]
            alive[newest] = union
            boxes = boxes.without([pair.first, pair.second])
            boxes.add(newest, union.hull.corners)
            refused[newest] = refused.pop(pair.first) | refused.pop(pair.second)
            never_with = refused[newest] & alive.keys()
            for i in never_with:
                refused[i].add(newest)
            found, never = pairing.pairs(alive, boxes.without([*never_with]), [newest])
            for first, second in never:
                refuse(first, second)
            for other in [*next_ones, *found]:
                heapq.heappush(queue, other)
            next_ones = []
            newest += 1
    except Stopped:  # raised between two unions
        run.note_stop()
    finally:
        run.drop(begun.values())
    return [alive[i] for i in sorted(alive, key=origin.__getitem__)]


def _cheapest(queue: list[_Pair], alive: dict[int, Part], most: int) -> list[_Pair]:
    """Pop the cheapest pairs whose parts both still exist."""
    batch: list[_Pair] = []
    while queue and len(batch) < most:
        pair = heapq.heappop(queue)
        if pair.first in alive and pair.second in alive:
            batch.append(pair)
    return batch


@dataclass(frozen=True)
class _Adjoining:
    """Pairs within the criterion's reach, judged by their glued union."""

    criterion: Criterion
    run: Run

    def pairs(
        self, alive: Mapping[int, Part], boxes: Boxes, new: Sequence[int]
    ) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Pairs that the volume bound allows."""
        screen = self.criterion.screen
        pairs = boxes.pairs(new, screen.reach)
        if not self.run.work.pay(_price(alive, pairs, work.joining)):
            return [], []
        volumes, hulls = joint_volumes(alive, pairs, self.run.threads)
        kept = ~screen.excludes(volumes, hulls)
        costs = hulls - _sums(alive, pairs, screen.filled)
        return _queue(pairs[kept], costs[kept]), []

    def unite(self, first: Part, second: Part) -> _Verdict:
        """Glue the two parts."""
        union, price = Part.glued(first, second), price_of_gluing(first, second)
        if union.size and self.criterion.is_met(union):  # without faces: it could not be clipped
            return _Verdict(union, price)
        return _Verdict(None, price, self.criterion.is_hereditary)


@dataclass(frozen=True)
class _Bridged:
    """All pairs (see `FEW_TO_PAIR`), judged by the solid clipped to their joint hull."""

    criterion: Criterion
    run: Run
    solid: Component
    few: int = FEW_TO_PAIR

    def pairs(
        self, alive: Mapping[int, Part], boxes: Boxes, new: Sequence[int]
    ) -> tuple[list[_Pair], list[tuple[int, int]]]:
        """Pairs that may be feasible: how much of the joint hull the solid fills is not known yet."""
        screen = self.criterion.screen
        reach = np.inf if len(boxes) <= self.few else screen.reach
        pairs = boxes.pairs(new, reach, across=True)
        found: list[_Pair] = []
        never: list[tuple[int, int]] = []
        for some in np.split(pairs, range(PAIRS_AT_ONCE, len(pairs), PAIRS_AT_ONCE)):
            if not self.run.may_continue() or not self.run.work.pay(_price(alive, some, work.screening)):
                break
            used, places = _places(some)
            hulls = [alive[i].hull for i in used]
            volumes, verdicts = screen.feasibilities(self.solid.filling, hulls, places, self.run.threads)
            may = verdicts == Feasibility.MAYBE
            found += _queue(some[may], volumes[may] - _sums(alive, some[may], screen.filled))
            never += map(tuple, some[verdicts == Feasibility.NEVER].tolist())
        return found, never

    def unite(self, first: Part, second: Part) -> _Verdict:
        """Test the joint hull more thoroughly, and clip the solid to it."""
        hull = Hull.around(first.hull, second.hull)
        price = work.testing(len(hull.vertices))
        if self.criterion.screen.feasibility(self.solid.filling, hull) is not Feasibility.MAYBE:
            return _Verdict(None, price)
        return _Verdict(self._united(first, second, hull), price + price_of_clipping(first, second))

    def _united(self, first: Part, second: Part, hull: Hull) -> Part | None:
        return _clipped(first, second, hull, self.criterion, self.solid)


@dataclass(frozen=True)
class _Lifted(_Bridged):
    """Pairs within reach, judged the same way on a proxy; unions are then confirmed on the solid it stands for."""

    confirmed: Callable[[Hull], Part | None] = lambda hull: None

    def _united(self, first: Part, second: Part, hull: Hull) -> Part | None:
        rehearsed = super()._united(first, second, hull)
        return None if rehearsed is None else self.confirmed(hull)


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
        hulls, screen = [part.hull, *(other.hull for other in others)], self.criterion.screen
        corners = [hull.corners for hull in hulls]
        pairs = Boxes(corners).pairs([0], screen.reach)
        near = pairs[:, 1].tolist()
        own = len(part.hull.vertices)
        if not self.account.pay(sum(work.screening(own + len(hulls[i].vertices)) for i in near)):
            return []
        if not screen.looks_inside:
            volumes = _native.joint_hull_volumes(corners, pairs, 1)
            return [(i - 1, volume) for i, volume in zip(near, volumes.tolist(), strict=True)]
        volumes, verdicts = screen.feasibilities(self.solid.filling, hulls, pairs, 1)
        found = zip(near, volumes.tolist(), verdicts.tolist(), strict=True)
        return [(i - 1, volume) for i, volume, verdict in found if verdict == Feasibility.MAYBE]

    def unite_feasible(self, first: Part, second: Part) -> Part | None:
        """Unite two parts that may be united; None if no union meets the criterion after all."""
        hull = Hull.around(first.hull, second.hull)
        screen = self.criterion.screen
        if is_alone(first) and is_alone(second):  # otherwise they may overlap
            if not self.account.pay(price_of_gluing(first, second)):
                return None
            union = Part.glued(first, second, hull)
            if not screen.excludes(union.volume, hull.volume) and self.criterion.is_met(union):
                return union
        if not screen.looks_inside or not self.account.pay(price_of_clipping(first, second)):
            return None
        return _clipped(first, second, hull, self.criterion, self.solid)


def price_of_gluing(first: Part, second: Part) -> float:
    """The work of gluing two parts and judging the union."""
    faces, hull_faces = first.size + second.size, len(first.hull.faces) + len(second.hull.faces)
    return work.gluing(faces) + work.judging(faces, hull_faces)


def price_of_clipping(first: Part, second: Part) -> float:
    """The work of clipping the solid to the joint hull of two parts, and judging the result."""
    faces, hull_faces = first.size + second.size, len(first.hull.faces) + len(second.hull.faces)
    return work.filling(faces, hull_faces) + work.judging(faces, hull_faces)


def is_alone(part: Part) -> bool:
    """Whether a part consists only of its members and shares nothing with other parts."""
    return part.volume <= (1 + LOST_VOLUME) * sum(member.volume for member in part.members)


def _clipped(first: Part, second: Part, hull: Hull, criterion: Criterion, solid: Component) -> ClippedPart | None:
    clipped = ClippedPart(solid, (first, second), hull)
    fits = clipped.is_whole and not criterion.screen.excludes(clipped.volume, hull.volume)
    return clipped if fits and criterion.is_met(clipped) else None


def neighbours(
    alive: Mapping[int, Part], new: Sequence[int], reach: float, threads: int
) -> Iterator[tuple[int, int, float, float]]:
    """Pairs of a new part and any other with boxes within reach: (first, second, volume, joint hull's volume)."""
    pairs = _boxes(alive).pairs(new, reach)
    return zip(*pairs.T.tolist(), *(own.tolist() for own in joint_volumes(alive, pairs, threads)), strict=True)


def joint_volumes(alive: Mapping[int, Part], pairs: IntArray, threads: int) -> tuple[FloatArray, FloatArray]:
    """The volume of both parts of each pair [P, 2], and that of their joint hull."""
    used, places = _places(pairs)
    hulls = _native.joint_hull_volumes([alive[i].hull.corners for i in used], places, threads)
    return _sums(alive, pairs, lambda part: part.volume), hulls


def _boxes(alive: Mapping[int, Part]) -> Boxes:
    return Boxes([part.hull.corners for part in alive.values()], list(alive))


def _places(pairs: IntArray) -> tuple[list[int], IntArray]:
    """The distinct ids in pairs [P, 2], and the pairs as indices into them."""
    used = np.unique(pairs)
    return used.tolist(), np.searchsorted(used, pairs).astype(np.int32)


def _sums(alive: Mapping[int, Part], pairs: IntArray, of: Callable[[Part], float]) -> FloatArray:
    """Sums [P] of something over the two parts of each pair [P, 2]."""
    used, places = _places(pairs)
    first, second = np.array([of(alive[i]) for i in used], dtype=np.float64)[places.T]
    return np.asarray(first + second)


def _price(alive: Mapping[int, Part], pairs: IntArray, price: Callable[[int], float]) -> float:
    """Total price of pairs [P, 2], each priced by the number of vertices of its two hulls."""
    return sum(map(price, _sums(alive, pairs, lambda part: len(part.hull.vertices)).astype(int).tolist()))


def _queue(pairs: IntArray, costs: FloatArray) -> list[_Pair]:
    return list(map(_Pair, costs.tolist(), *pairs.T.tolist()))


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
    alive: dict[int, Part] = dict(enumerate(parts))
    origin = {i: i for i in alive}
    try:
        errors = dict(zip(alive, run.map(criterion.error, parts), strict=True))
        reach = criterion.screen.reach
        queue = _bounded_pairs(alive, list(alive), reach, criterion, run)
        while True:
            yield [alive[i] for i in sorted(alive, key=origin.__getitem__)], max(errors.values())
            pair = _pop_least(queue, alive, unite, criterion, account)
            if pair is None and math.isfinite(reach):
                reach = math.inf
                queue = _bounded_pairs(alive, list(alive), reach, criterion, run)
                pair = _pop_least(queue, alive, unite, criterion, account)
            if pair is None or not run.step(len(parts) - len(alive), len(parts), len(alive)):
                return
            newest = len(origin)
            origin[newest] = min(origin[pair.first], origin[pair.second])
            alive[newest] = unite(alive.pop(pair.first), alive.pop(pair.second))
            errors = {i: errors[i] for i in alive if i in errors} | {newest: pair.error}
            for bounded in _bounded_pairs(alive, [newest], reach, criterion, run):
                heapq.heappush(queue, bounded)
    except Stopped:  # between two unions
        run.note_stop()


class _BoundedPair(NamedTuple):
    error: float  # of the union: a lower bound, or the value if `measured`
    first: int
    second: int
    measured: bool


def _bounded_pairs(
    alive: dict[int, Part], new: Sequence[int], reach: float, criterion: Criterion, run: Run
) -> list[_BoundedPair]:
    screen = criterion.screen
    queue = [
        _BoundedPair(screen.least_error(volume, hull_volume), first, second, False)
        for first, second, volume, hull_volume in neighbours(alive, new, reach, run.threads)
    ]
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
        if pair.measured:
            return pair
        if not account.pay(price_of_gluing(alive[pair.first], alive[pair.second])):
            return None
        error = criterion.error(unite(alive[pair.first], alive[pair.second]))
        heapq.heappush(queue, _BoundedPair(max(error, pair.error), pair.first, pair.second, True))
    return None
