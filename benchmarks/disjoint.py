"""What it costs to forbid hulls that overlap: an upper bound, since rlacd has no such option.

The parts of plane cuts lie in cells that planes separate, so their hulls are disjoint. Two of them are united if what
the solid fills of their joint hull meets the criterion and if that hull enters no other; the pair of least added volume
first. rlacd itself also unites parts across others, and searches.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from manifold3d import Manifold

from benchmarks.methods import RawHull
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.io.read.load import load_mesh
from rlacd.policies import make_policy
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component
from rlacd.solid.hull import Hull
from rlacd.solid.manifold import to_manifold

ENTERED = 1e-6
"""Hulls enter each other if they share more than this of the smaller one's volume; rounding makes up to 1e-9."""


def decompose_disjoint(vertices: FloatArray, faces: IntArray, threshold: float, threads: int) -> list[RawHull]:
    """Cut a mesh [V, 3], [F, 3] until each part has at most the concavity `threshold`; unite what stays disjoint."""
    solid = repair(load_mesh((vertices, faces)), threads=threads)
    root, goal = Component(solid.shape), Concavity(threshold)
    with Run(threads) as run:
        tree = CutTree(root, make_policy("greedy"), run)
        pieces = cut_and_merge(tree, goal, run, merge=False).parts
    united = _Uniting(root, goal, [piece.hull for piece in pieces]).run()
    there = [Hull.of(solid.frame.to_input(hull.vertices)) for hull in united]
    return [(hull.vertices, hull.faces) for hull in there if hull is not None]


class _Uniting:
    """Disjoint hulls by number, and the pairs of them that may be united: the joint hull by pair."""

    def __init__(self, root: Component, goal: Concavity, hulls: list[Hull]) -> None:
        self._root, self._goal = root, goal
        self._hulls = dict(enumerate(hulls))
        self._bodies = {number: _body(hull) for number, hull in self._hulls.items()}
        self._joint: dict[tuple[int, int], Hull] = {}
        for pair in combinations(self._hulls, 2):
            self._ask(pair)

    def run(self) -> list[Hull]:
        """Unite pairs until no more can be."""
        while self._joint:
            pair = min(self._joint, key=self._added)
            hull, new = self._joint[pair], max(self._hulls) + 1
            self._hulls[new], self._bodies[new] = hull, _body(hull)
            for old in pair:
                del self._hulls[old], self._bodies[old]
            # A hull that has grown may be in the way of pairs that were free.
            left = {other: joint for other, joint in self._joint.items() if not set(pair) & set(other)}
            self._joint = {other: joint for other, joint in left.items() if not self._enters(joint, new)}
            for number in list(self._hulls)[:-1]:
                self._ask((number, new))
        return list(self._hulls.values())

    def _added(self, pair: tuple[int, int]) -> float:
        return self._joint[pair].volume - sum(self._hulls[number].volume for number in pair)

    def _ask(self, pair: tuple[int, int]) -> None:
        hulls = [self._hulls[number] for number in pair]
        lows, highs = (np.array([pick(hull.vertices, axis=0) for hull in hulls]) for pick in (np.min, np.max))
        if (lows.max(axis=0) > highs.min(axis=0) + self._goal.threshold).any():
            return
        hull = Hull.around(*hulls)
        if not self._goal.early_out.is_feasible(self._root.filling, hull):
            return
        if any(self._enters(hull, number) for number in self._hulls if number not in pair):
            return
        if self._goal.is_met(self._root.inside(hull)):
            self._joint[pair] = hull

    def _enters(self, hull: Hull, number: int) -> bool:
        shared: float = (_body(hull) ^ self._bodies[number]).volume()
        return shared > ENTERED * min(hull.volume, self._hulls[number].volume)


def _body(hull: Hull) -> Manifold:
    return to_manifold(hull.vertices, hull.faces.astype(np.int64))
