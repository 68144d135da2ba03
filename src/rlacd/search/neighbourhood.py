"""Large-neighbourhood search: three neighbouring parts are reunited and cut differently, again and again.

A state is the parts so far, all of them meeting the criterion. A trial takes a cluster of three neighbours, two of
which have a joint hull that fits almost, reunites what they are made of into one solid, cuts that by another first
plane, and merges the pieces with each other and with the parts around. It is accepted when fewer parts are left, or as
many with less volume in their hulls. (P. Shaw, "Using Constraint Programming and Local Search Methods to Solve Vehicle
Routing Problems", CP 1998, is where the idea comes from.)
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
import threading
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from rlacd.clock import Clock
from rlacd.criteria.criterion import Criterion
from rlacd.cut import CutTree
from rlacd.finish.merge import merge_parts, neighbours
from rlacd.planes.views import Views
from rlacd.search.pace import Pace
from rlacd.search.rankings import Ranked, Ranking, diverse
from rlacd.solid.component import Component, Part
from rlacd.solid.reunite import reunite
from rlacd.workers import Workers

TOUCHING = 1e-6
"""Parts whose boxes are no farther apart than this may touch."""

FIRST_PLANES = 6
"""So many different first planes are tried of every cluster."""

SPARE = 4
"""A cluster may be cut into so many pieces more than it had parts, since they are merged again."""

LATER = 0.35
"""What every further first plane of a cluster costs in the queue, in thresholds of the least error of its pair."""

CHANCE = 0.3
"""How much chance orders the queue, in the same unit."""

BATCH = 8
"""Trials made of one state at a time; the same whatever the number of threads, so that the result is too."""

SAME = 1e-6
"""Hulls whose volumes differ by less than this share are as good as each other."""


REMEMBERED = 256
"""Reunited clusters that are kept for their next first planes."""

Cluster: TypeAlias = tuple[int, ...]
Fingerprint: TypeAlias = tuple[int, ...]


@dataclass(order=True)
class _Trial:
    urgency: float
    number: int  # makes the order total
    cluster: Cluster = field(compare=False)
    misfit: float = field(compare=False)
    attempt: int = field(compare=False)


@dataclass(frozen=True)
class _Found:
    old: list[int]
    new: list[Part]


@dataclass(frozen=True)
class Outcome:
    """What a search has done.

    Attributes
    ----------
    parts : list of Part
    steps : int
        Trials made.
    accepted : int
        Trials that were taken over.
    exhausted : bool
        There was nothing left to try.
    """

    parts: list[Part]
    steps: int
    accepted: int
    exhausted: bool


class Neighbourhood:
    """Parts that are being improved.

    Parameters
    ----------
    parts : sequence of Part
        Made of components with disjoint interiors; all that meet the criterion stay so.
    criterion : Criterion
    rankings : sequence of Ranking
        Who ranks planes, in turn.
    views : Views
        Where sweeps come from.
    workers : Workers
    seed : int
    """

    def __init__(
        self,
        parts: Sequence[Part],
        criterion: Criterion,
        rankings: Sequence[Ranking],
        views: Views,
        workers: Workers,
        seed: int,
    ) -> None:
        self._criterion = criterion
        self._rankings = rankings
        self._views = views
        self._workers = workers
        self._alone = Workers(1)
        self._random = random.Random(seed)
        self._alive: dict[int, Part] = {}
        self._beside: dict[int, set[int]] = {}
        self._misfit: dict[tuple[int, int], float] = {}
        overhang = criterion.overhang
        self._scale = overhang / 0.3 * math.cbrt(4 * math.pi / 3) if math.isfinite(overhang) else 1.0
        self._queue: list[_Trial] = []
        self._queued: set[Cluster] = set()
        self._numbers = itertools.count()
        self._ids = itertools.count()
        self._lock = threading.Lock()
        self._partitions: dict[tuple[Cluster, Cluster], set[Fingerprint]] = {}
        self._reunited: OrderedDict[Cluster, Component | None] = OrderedDict()
        self._admit(parts)

    @property
    def parts(self) -> list[Part]:
        """The parts so far."""
        return [self._alive[i] for i in sorted(self._alive)]

    def run(self, pace: Pace, most: float = math.inf, enough: int = 1) -> Outcome:
        """Try until nothing is left to try, the clock says no, `most` trials are made or `enough` parts are left."""
        steps = accepted = 0
        while pace.step(steps, None, len(self._alive)) and steps < most and len(self._alive) > enough:
            batch = self._next_trials(min(BATCH, most - steps))
            if not batch:
                break
            for trial, found in zip(batch, self._made(batch), strict=True):
                steps += 1
                accepted += self._take(trial, found)
                pace.steps += 1
                pace.parts = min(pace.parts, len(self._alive))
                if pace.is_over:
                    break
        exhausted = not any(map(self._is_open, self._queue))
        return Outcome(self.parts, steps, accepted, exhausted)

    def _made(self, batch: Sequence[_Trial]) -> Iterator[_Found | None]:
        """Make trials, all of the same state, so that the number of threads does not matter."""
        scenes = [self._scene(trial) for trial in batch]
        if self._workers.threads == 1:  # a trial whose parts are gone by then is not worth making
            return (
                self._try(trial, scene) if self._is_open(trial) else None
                for trial, scene in zip(batch, scenes, strict=True)
            )
        return iter(self._workers.map(lambda both: self._try(*both), zip(batch, scenes, strict=True)))

    def _scene(self, trial: _Trial) -> dict[int, Part]:
        """The parts of a cluster, and then those around it."""
        around = set().union(*(self._beside[i] for i in trial.cluster)).difference(trial.cluster)
        return {i: self._alive[i] for i in (*trial.cluster, *sorted(around))}

    def _is_open(self, trial: _Trial) -> bool:
        return all(i in self._alive for i in trial.cluster)

    def _next_trials(self, most: float) -> list[_Trial]:
        batch: list[_Trial] = []
        while self._queue and len(batch) < most:
            trial = heapq.heappop(self._queue)
            if self._is_open(trial):
                batch.append(trial)
        return batch

    def _admit(self, parts: Sequence[Part]) -> None:
        """Take in new parts, and queue the clusters they make possible."""
        new = [next(self._ids) for _ in parts]
        self._alive.update(zip(new, parts, strict=True))
        self._beside.update((i, set()) for i in new)
        for first, second, volume, hull_volume in neighbours(self._alive, new, TOUCHING, self._workers):
            self._beside[first].add(second)
            self._beside[second].add(first)
            if not self._criterion.excludes(volume, hull_volume):
                a, b = self._alive[first], self._alive[second]
                waste = hull_volume - self._criterion.filled(a) - self._criterion.filled(b)
                self._misfit[first, second] = math.cbrt(max(waste, 0.0)) / self._scale
        for pair, misfit in self._misfit.items():
            for third in sorted(self._beside[pair[0]] | self._beside[pair[1]]):
                cluster = tuple(sorted({*pair, third}))
                if len(cluster) == 3 and cluster not in self._queued and not set(new).isdisjoint(cluster):
                    self._queued.add(cluster)
                    self._enqueue(cluster, misfit, 0)

    def _enqueue(self, cluster: Cluster, misfit: float, attempt: int) -> None:
        urgency = misfit + CHANCE * self._random.random()
        heapq.heappush(self._queue, _Trial(urgency, next(self._numbers), cluster, misfit, attempt))

    def _remove(self, ids: Iterable[int]) -> None:
        gone = set(ids)
        for i in gone:
            del self._alive[i]
            for other in self._beside.pop(i):
                if other in self._beside:
                    self._beside[other].discard(i)
        self._misfit = {pair: misfit for pair, misfit in self._misfit.items() if gone.isdisjoint(pair)}

    def _try(self, trial: _Trial, scene: dict[int, Part]) -> _Found | None:
        """Cut a cluster in another way; None where that comes to nothing."""
        solid = self._solid(trial.cluster, scene)
        if solid is None:
            return None
        ranking = self._rankings[trial.attempt % len(self._rankings)]
        first = None
        if len(solid.pieces()) == 1:
            seen = self._views.of(solid)
            planes = diverse(seen, ranking(solid, seen), FIRST_PLANES)
            if trial.attempt >= len(planes):
                return None
            first = planes[trial.attempt]
        elif trial.attempt >= len(self._rankings):
            return None
        tree = CutTree(solid, Ranked(ranking, self._views, first), self._alone)
        pieces, left = tree.cut_until(self._criterion, Clock(), most=len(trial.cluster) + SPARE)
        if left or not self._is_new(pieces, trial, scene):
            return None
        others = {i: part for i, part in scene.items() if i not in trial.cluster}
        merged = merge_parts(pieces, self._criterion, self._alone, Clock(), beside=list(others.values()))
        kept = {id(part) for part in merged} & {id(part) for part in others.values()}
        old = [i for i, part in scene.items() if id(part) not in kept]
        new = [part for part in merged if id(part) not in kept]
        better = len(new) < len(old) or (
            len(new) == len(old) and _hulls(new) < (1 - SAME) * _hulls([scene[i] for i in old])
        )
        return _Found(old, new) if better else None

    def _is_new(self, pieces: Sequence[Part], trial: _Trial, scene: dict[int, Part]) -> bool:
        """Whether a cluster among these neighbours has not been in the same pieces before."""
        before = _fingerprint([scene[i] for i in trial.cluster])
        now = _fingerprint(pieces)
        with self._lock:
            known = self._partitions.setdefault((trial.cluster, tuple(scene)), {before})
            is_new = now not in known
            known.add(now)
        return is_new

    def _solid(self, cluster: Cluster, scene: dict[int, Part]) -> Component | None:
        with self._lock:
            if cluster in self._reunited:
                return self._reunited[cluster]
        solid = reunite([member for i in cluster for member in scene[i].members])
        with self._lock:
            self._reunited[cluster] = solid
            if len(self._reunited) > REMEMBERED:
                self._reunited.popitem(last=False)
        return solid

    def _take(self, trial: _Trial, found: _Found | None) -> bool:
        """Take over what a trial has found, unless another has changed the parts it is about meanwhile."""
        if found is None:
            if self._is_open(trial) and trial.attempt + 1 < FIRST_PLANES:
                self._enqueue(trial.cluster, trial.misfit + LATER, trial.attempt + 1)
            return False
        if not all(i in self._alive for i in found.old):
            if self._is_open(trial):
                self._enqueue(trial.cluster, trial.misfit, trial.attempt)
            return False
        self._remove(found.old)
        self._admit(found.new)
        return True


def _fingerprint(parts: Sequence[Part]) -> Fingerprint:
    """Volumes, to six digits or so of the whole: two ways to divide a solid that share them are the same."""
    whole = sum(part.volume for part in parts)
    return tuple(sorted(round(1e6 * part.volume / whole) for part in parts))


def _hulls(parts: Sequence[Part]) -> float:
    return sum(part.hull.volume for part in parts)
