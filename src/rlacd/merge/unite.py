"""Uniting pairs of parts, always the pair of least cost: merging.

Lazy best-first search: a pair waits by a bound of its cost, and is united for real only once that makes it the first.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import Boxes
from rlacd.criteria.criterion import Criterion
from rlacd.merge.numbered import NumberedParts
from rlacd.run import Begun, Run, Work, work
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Part

FEW_TO_PAIR = 100
"""Up to this many parts, any pair may be united across other parts; with more, only pairs near each other or a third
part."""

PAIRS_AT_ONCE = 512
"""Number of pairs tested against the solid between two checks of the run."""


class _Pair(NamedTuple):
    cost: float  # of uniting the two: a lower bound of it as long as there is no union
    first: int
    second: int
    union: Part | None = None


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
    alive = NumberedParts(parts, criterion)
    with run.until_stopped():
        for is_across in (False, True)[: 1 + across]:
            for _ in united(alive, ByGrowth(criterion, is_across), run.work, run):
                pass
    return alive.in_order()


@dataclass(frozen=True)
class ByGrowth:
    """The volume of the joint hull minus what the criterion credits to both parts; a union has to meet the criterion.

    Pairs across other parts are screened: most may not be united. Most neighbours may, or are gone before it is their
    turn.
    """

    criterion: Criterion
    across: bool

    def pairs(self, alive: NumberedParts, new: Sequence[int]) -> IntArray:
        """Pairs [P, 2] of a new part and any other that may be united."""
        is_any = self.across and len(alive.parts) <= FEW_TO_PAIR
        return alive.boxes.pairs(new, math.inf if is_any else self.criterion.reach, across=self.across)

    def bounds(self, alive: NumberedParts, pairs: IntArray, account: Work, threads: int) -> FloatArray | None:
        """Lower bounds [P] of the costs; infinite for pairs that may not be united. None if that cannot be paid."""
        vertices, volumes, credits = alive.sums(pairs)
        if not account.pay(work.screening(vertices.sum(), len(pairs))):
            return None
        if self.across:
            joint = self.criterion.joint_volumes(alive.whole, alive.bodies, pairs, volumes, threads)
        else:
            joint = _native.joint_hull_volumes(alive.bodies, pairs, threads)
        return np.asarray(joint - credits)

    def cost(self, union: Part, bound: float) -> float:
        """The cost of a union; infinite if it may not be."""
        return bound if self.criterion.is_met(union) else math.inf


def united(alive: NumberedParts, rule: ByGrowth, account: Work, run: Run) -> Iterator[tuple[_Pair, int]]:
    """Unite the pair of least cost again and again; yield each and its union's number.

    Ends when no pair is left, the run is over or the account spent: unions are paid in their order, so that how many
    are made ahead, which depends on the threads, does not matter.
    """
    begun: dict[_Pair, Begun[tuple[Part, float]]] = {}
    ahead = run.threads + (run.threads > 1)  # none waits for the next
    count, queue = len(alive.parts), _bounded(alive, rule, list(alive.parts), account, run)

    def first() -> _Pair | None:
        """The first pair in the queue; those that may be next are united on other threads."""
        some: list[_Pair] = []
        while queue and len(some) < ahead:
            pair = heapq.heappop(queue)
            if pair.first in alive.parts and pair.second in alive.parts:
                some.append(pair)
                if pair.union is None and pair not in begun:
                    begun[pair] = run.start(partial(joint, alive.parts[pair.first], alive.parts[pair.second], pair))
        for pair in some[1:]:
            heapq.heappush(queue, pair)
        return some[0] if some else None

    def joint(one: Part, other: Part, pair: _Pair) -> tuple[Part, float]:
        union = Part.joint(one, other)
        return union, rule.cost(union, pair.cost)

    try:
        while run.step(count - len(alive.parts), len(alive.parts)) and (pair := first()) is not None:
            if pair.union is None:
                union, cost = run.result(begun.pop(pair))
                if not account.pay(work.uniting(len(union.hull.vertices))):
                    return
                if cost < math.inf:
                    heapq.heappush(queue, _Pair(cost, pair.first, pair.second, union))
                continue
            number = alive.unite(pair.first, pair.second, pair.union)
            yield pair, number
            for found in _bounded(alive, rule, [number], account, run):
                heapq.heappush(queue, found)
    finally:
        run.drop(begun.values())


def _bounded(alive: NumberedParts, rule: ByGrowth, new: Sequence[int], account: Work, run: Run) -> list[_Pair]:
    """Pairs of a new part and another, as a heap; not all of them if the run ends or the account is spent."""
    found: list[_Pair] = []
    pairs = rule.pairs(alive, new)
    for begin in range(0, len(pairs), PAIRS_AT_ONCE):
        some = pairs[begin : begin + PAIRS_AT_ONCE]
        if not run.may_continue() or (bounds := rule.bounds(alive, some, account, run.threads)) is None:
            break
        may = np.isfinite(bounds)
        found += map(_Pair, bounds[may].tolist(), *some[may].T.tolist())
    heapq.heapify(found)
    return found


def joint_part(criterion: Criterion, account: Work, *parts: Part) -> Part | None:
    """Unite parts if the union meets the criterion and the account pays for deciding that."""
    union = Part.joint(*parts)
    return union if account.pay(work.uniting(len(union.hull.vertices))) and criterion.is_met(union) else None


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
