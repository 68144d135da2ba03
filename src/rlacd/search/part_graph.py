"""The parts of a decomposition, which of them touch, and which clusters are worth recutting."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from rlacd import _native
from rlacd.criteria.criterion import Criterion
from rlacd.merge.numbered import NumberedParts
from rlacd.run import Run, work
from rlacd.search.operators import Exchange
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import TOUCHING_FACES, Part, touch

Cluster = tuple[int, ...]
"""Ids of parts, ascending."""

SPREAD = 0.6
"""Amount of randomness in drawing clusters: without any, all would contain the same pair."""


class PartGraph:
    """Parts under ids that are never reused, and the pairs of parts that touch face to face.

    A pair's *gap* is the cube root of the volume its joint hull adds to what may be filled for free: the smaller the
    gap, the closer the two are to being one part.

    Parameters
    ----------
    parts : sequence of Part
        They get the ids 0, 1, ...
    criterion : Criterion
        Decides what may be filled for free.
    run : Run
        Pays for looking which parts touch.
    """

    def __init__(self, parts: Sequence[Part], criterion: Criterion, run: Run) -> None:
        self._numbered = NumberedParts((), criterion.screen)
        self._run = run
        self._gaps: dict[int, dict[int, float]] = {}
        self.replace((), parts)

    @property
    def parts(self) -> dict[int, Part]:
        """The parts under their ids."""
        return self._numbered.parts

    def replace(self, gone: Collection[int], new: Sequence[Part]) -> None:
        """Replace parts by others, which get new ids."""
        for i in gone:
            for j in self._gaps.pop(i):
                del self._gaps[j][i]
        self._numbered.remove(gone)
        self._meet([self._numbered.add(part) for part in new])
        self._ids = np.array(list(self.parts), dtype=np.int64)
        self._boxes = np.array([part.box for part in self.parts.values()]).reshape(-1, 2, 3)
        self._pairs = [(i, j) for i, gaps in self._gaps.items() for j in gaps if i < j]
        self._pair_gaps = np.array([self._gaps[i][j] for i, j in self._pairs])

    def _meet(self, new: Sequence[int]) -> None:
        """Find the parts that new ones touch."""
        parts, numbered, run = self.parts, self._numbered, self._run
        self._gaps.update((i, {}) for i in new)
        near = numbered.boxes.pairs(new, TOUCHING_FACES)
        gluing = sum(work.gluing(parts[i].size + parts[j].size) for i, j in near.tolist())
        run.work.pay(work.joining(numbered.sums(near)[0].sum(), len(near)) + gluing)
        do_touch = run.map(lambda pair: touch(parts[pair[0]], parts[pair[1]]), near.tolist())
        touching = near[np.array(do_touch, dtype=bool)]
        added = _native.joint_hull_volumes(numbered.corners, touching, run.threads) - numbered.sums(touching)[2]
        for (i, j), gap in zip(touching.tolist(), _native.cube_roots(np.maximum(added, 0.0)).tolist(), strict=True):
            self._gaps[i][j] = self._gaps[j][i] = gap

    def apply(self, exchange: Exchange) -> bool:
        """Apply an exchange; False if some of the parts it takes out are already gone."""
        ids = {id(part): i for i, part in self.parts.items()}
        if any(id(part) not in ids for part in exchange.out):
            return False
        self.replace([ids[id(part)] for part in exchange.out], exchange.into)
        return True

    def of(self, ids: Iterable[int]) -> list[Part]:
        """Get the parts of some ids."""
        return [self.parts[i] for i in ids]

    def around(self, cluster: Cluster) -> Cluster:
        """Get the parts that touch a cluster, in ascending order."""
        return tuple(sorted({j for i in cluster for j in self._gaps[i]} - set(cluster)))

    def near(self, which: int, reach: float) -> Cluster:
        """Get the parts whose boxes are within reach of a part's box along every axis, in ascending order."""
        box = self.parts[which].box
        gaps = np.maximum(box[0] - self._boxes[:, 1], self._boxes[:, 0] - box[1]).max(axis=1)
        return tuple(self._ids[(gaps <= reach) & (self._ids != which)].tolist())

    def draw(self, size: int, random: np.random.Generator) -> Cluster | None:
        """Draw a connected cluster: a pair with a small gap, extended by the neighbours with the smallest gaps.

        Each gap is multiplied by a random factor between 1 - `SPREAD` and 1 + `SPREAD` before comparing. None if the
        connected parts around the pair are too few.
        """
        if not self._pairs:
            return None
        cluster = list(self._pairs[_least(self._pair_gaps, random)])
        while len(cluster) < size:
            near: dict[int, float] = {}
            for i in cluster:
                for j, gap in self._gaps[i].items():
                    if j not in cluster:
                        near[j] = min(gap, near.get(j, np.inf))
            if not near:
                return None
            cluster.append(list(near)[_least(np.array(list(near.values())), random)])
        return tuple(sorted(cluster))


def _least(gaps: FloatArray, random: np.random.Generator) -> int:
    return int(np.argmin(gaps * random.uniform(1 - SPREAD, 1 + SPREAD, len(gaps))))
