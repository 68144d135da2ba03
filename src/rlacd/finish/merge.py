"""Merging: pairs of parts whose joint hull still meets the criterion become one part, cheapest pair first."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.workers import Workers


@dataclass(order=True, frozen=True)
class _Pair:
    cost: float  # volume of the joint hull - volume of the two solids: what R_v of their union is made of
    first: int
    second: int


def merge(parts: Sequence[Part], criterion: Criterion, workers: Workers, clock: Clock) -> list[Part]:
    """Unite pairs of parts, the cheapest first, as long as the union meets the criterion.

    The test looks at the glued union: its own surface against its own hull, both ways. Pairs are tested a batch at a
    time on all workers, and taken in the order of their cost whatever the number of workers.

    Parameters
    ----------
    parts : sequence of Part
        Solids with disjoint interiors.

    Returns
    -------
    list of Part
        Parts that could not be united further, in the order of their first piece.
    """
    alive: dict[int, Part] = dict(enumerate(parts))
    origin = {i: i for i in alive}
    queue = _pairs(alive, list(alive), criterion, workers)
    heapq.heapify(queue)
    unions: dict[_Pair, Part | None] = {}
    newest = len(parts)
    while queue:
        pair = heapq.heappop(queue)
        if pair.first not in alive or pair.second not in alive:
            continue
        if pair not in unions:
            batch = [pair, *_next_pairs(queue, alive, unions, 2 * workers.threads - 1)]
            unions.update(
                zip(
                    batch, workers.map(lambda p: _unite(alive[p.first], alive[p.second], criterion), batch), strict=True
                )
            )
        if not clock.step(len(parts) - len(alive), None, len(alive)):
            break
        union = unions.pop(pair)
        if union is None:
            continue
        origin[newest] = min(origin[pair.first], origin[pair.second])
        del alive[pair.first], alive[pair.second]
        alive[newest] = union
        for candidate in _pairs(alive, [newest], criterion, workers):
            heapq.heappush(queue, candidate)
        newest += 1
    return [alive[i] for i in sorted(alive, key=origin.__getitem__)]


def _next_pairs(queue: list[_Pair], alive: dict[int, Part], known: dict[_Pair, Part | None], most: int) -> list[_Pair]:
    """Cheapest pairs of the queue that are not judged yet."""
    candidates = (p for p in queue if p.first in alive and p.second in alive and p not in known)
    return heapq.nsmallest(most, candidates)


def _unite(first: Part, second: Part, criterion: Criterion) -> Part | None:
    union = Part.glued(first, second)
    return union if criterion.is_met(union) else None


def _pairs(alive: dict[int, Part], new: Sequence[int], criterion: Criterion, workers: Workers) -> list[_Pair]:
    """Pairs of a new part with any other that lie within the criterion's reach and that its volume bound allows."""
    ids = np.array(list(alive), dtype=np.int64)
    boxes = np.stack([alive[i].box for i in alive])
    position = {int(i): k for k, i in enumerate(ids)}
    rows = np.array([position[i] for i in new], dtype=np.int64)
    gap = np.maximum(boxes[rows, None, 0] - boxes[None, :, 1], boxes[None, :, 0] - boxes[rows, None, 1])
    near = np.linalg.norm(np.maximum(gap, 0.0), axis=2) <= criterion.reach
    k, other = np.nonzero(near)
    pairs = np.unique(np.sort(np.stack([rows[k], other], axis=1), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    if len(pairs) == 0:
        return []

    corners: list[FloatArray] = [alive[i].hull.vertices for i in alive]
    starts = np.cumsum([0, *map(len, corners)], dtype=np.int32)
    hulls = _native.joint_hull_volumes(np.concatenate(corners), starts, pairs.astype(np.int32), workers.threads)
    volumes = np.array([alive[i].volume for i in alive])
    solids = volumes[pairs].sum(axis=1)
    return [
        _Pair(float(hull - solid), int(ids[i]), int(ids[j]))
        for (i, j), hull, solid in zip(pairs, hulls, solids, strict=True)
        if not criterion.excludes(float(solid), float(hull))
    ]
