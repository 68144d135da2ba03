"""From a mesh to the parts of its solid: repair, cut until every component meets the criterion, merge, search.

A dense solid is cut, merged and searched as a simpler copy (`rlacd.proxy`), and its parts are carried to the solid.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import Stopped
from rlacd.criteria import AddedVolume, Concavity, Criterion, NavigableSpace
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import LimitedCriterion, best_within, drop_slivers, merge_lifted, with_limits
from rlacd.options import VOLUME, Options
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import AS_PUBLISHED, Greedy, make_policy
from rlacd.proxy import FEW, Lift, Proxy, simplify
from rlacd.repair.repair import repair
from rlacd.repair.tangles import TangledError, refuse_tangles
from rlacd.report import HONEST_WITHIN
from rlacd.run import Run
from rlacd.search import SearchContext, SearchSummary, eliminate_parts, search
from rlacd.solid.component import Component, Part
from rlacd.solid.cover import cover
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Shape, Solid
from rlacd.solid.topology import IntArray

FEW_TO_DOUBT = 2000
"""Solids of at most this many triangles are sampled at as many points after a stop: do the hulls cover them?"""

MARGIN = 1.5
"""Parts of a proxy have to be tighter by this share of its deviation: their hulls still have to grow to the solid."""


class Reached(NamedTuple):
    """The decomposition reached: complete, or the state when it was stopped.

    Attributes
    ----------
    solid : Solid
        The repaired mesh.
    options : Options
        Those given, with lengths relative to the solid's size.
    goal : Criterion
        What the parts meet, unless a stop or `max_hulls` forbade it.
    parts : list of Part
    found : SearchSummary, optional
        What the search found, if there was one.
    root : Component, optional
        The solid as it was cut; None if the parts cover the solid without cuts.
    """

    solid: Solid
    options: Options
    goal: Criterion
    parts: list[Part]
    found: SearchSummary | None = None
    root: Component | None = None


def find_parts(source: InputMesh, options: Options, run: Run) -> Reached:
    """Repair, cut, merge and search, until done or stopped by the run.

    Bodies that cross too much of their own surface to be cut are repaired once more, another way.
    """
    try:
        return _repaired_and_cut(source, options, run, None)
    except TangledError as tangle:
        return _repaired_and_cut(source, options, run, tangle.bodies)


def _repaired_and_cut(source: InputMesh, options: Options, run: Run, tangled: IntArray | None) -> Reached:
    """Make one attempt.

    Raises
    ------
    TangledError
        Some bodies cannot be cut as they are; never if `tangled` names any.
    """
    try:
        with run.stage("repair"):
            solid = repair(
                source,
                resolution=options.resolution,
                open_bodies=options.open,
                gap=options.gap,
                threads=run.threads,
                keep_cavities=isinstance(options.criterion, NavigableSpace) and options.criterion.sees_cavities,
                tangled=tangled,
            )
        options = options.at_scale(solid.frame.scale)
        goal = _prepared(options, solid, run)
        root = Component(solid.shape, run.threads)
    except Stopped:
        run.note_stop()
        solid, parts = cover(source, run)
        options = options.at_scale(solid.frame.scale)
        return Reached(solid, options, _unprepared(options, solid), parts)
    goal = with_limits(goal, options.max_vertices, options.max_faces)
    if options.max_hulls == 1:
        pieces = drop_slivers(root.pieces(), run)
        return Reached(solid, options, goal, pieces if len(pieces) == 1 else [root], None, root)
    doubt = None if tangled is not None else partial(refuse_tangles, solid, run.threads)
    proxy = _proxy(root, solid.pieces, goal, options, run)
    solid.pieces.clear()
    parts, goal, found = _Pipeline(root, proxy, goal, options, run, doubt).at_most(options.max_hulls)
    if _lost_in_cuts(solid, parts, run):
        solid, parts = cover(source, run)
        return Reached(solid, options, _unprepared(options, solid), parts)
    return Reached(solid, options, goal, parts, found, root)


def _lost_in_cuts(solid: Solid, parts: Sequence[Part], run: Run) -> bool:
    """Whether a stop leaves parts that miss some of a small solid, as happens to one that crosses itself."""
    if run.stopped_by is None or len(solid.faces) > FEW_TO_DOUBT:
        return False
    with run.shielded():
        inner, _ = _native.sample_surface(solid.vertices, solid.faces, FEW_TO_DOUBT, 0)
        hulls = hull_union([part.hull for part in parts], run.threads)
        away = hulls.distance(np.concatenate([solid.vertices, inner]), run.threads)
        return bool(away.max() > HONEST_WITHIN)


def _proxy(root: Component, pieces: Sequence[Shape], goal: Criterion, options: Options, run: Run) -> Proxy | None:
    """A simpler solid to decompose in place of a dense one."""
    if not math.isfinite(goal.overhang) or len(root.faces) < FEW:
        return None
    try:
        with run.stage("simplify"):
            return simplify(root, options.threshold, run.threads, pieces)
    except Stopped:
        run.note_stop()
        return None


@dataclass
class _Pipeline:
    """Cuts, merges and searches a solid, or a proxy of it; under coarser and coarser goals, on the same tree of cuts.

    Attributes
    ----------
    root : Component
        The solid.
    proxy : Proxy, optional
    goal : Criterion
        What parts of the solid have to meet.
    options : Options
    run : Run
    doubt : callable, optional
        See `CutTree`.
    """

    root: Component
    proxy: Proxy | None
    goal: Criterion
    options: Options
    run: Run
    doubt: Callable[[bool], None] | None

    @cached_property
    def _sweeps(self) -> SweepCache:
        return SweepCache()

    @cached_property
    def _tree(self) -> CutTree:
        second = Greedy("hull-sum", sweeps=self._sweeps) if self.options.policy == "greedy" else None
        body, goal = (self.root, self.goal) if self.proxy is None else (self.proxy.component, self._on_proxy(1.0))
        policy = make_policy(self.options.policy, self._sweeps, _scale(goal))
        return CutTree(body, policy, self.run, doubt=self.doubt, second=second)

    def at_most(self, most: int | None) -> tuple[list[Part], Criterion, SearchSummary | None]:
        """At most so many parts, the criterion as settled on them, and a summary of the search."""
        parts, goal, found = self._parts(1.0)
        with self.run.shielded():
            if most is None or len(parts) <= most or len(drop_slivers(parts, self.run)) <= most:
                return parts, goal, found
        self.goal = goal
        measured = LimitedCriterion(goal, self.options.max_vertices, self.options.max_faces)

        def coarser(factor: float) -> list[Part]:
            return self._parts(factor)[0]

        def unite(first: Part, second: Part) -> Part:
            if self.proxy is None:
                return Part.glued(first, second)
            return self.root.inside(Hull.around(first.hull, second.hull))

        parts = best_within(parts, most, self.root, coarser, unite, measured, self.run)
        return parts, goal, found

    def _parts(self, factor: float) -> tuple[list[Part], Criterion, SearchSummary | None]:
        """The same under a threshold larger by a factor, whatever was done before."""
        with self.run.limited(math.inf):
            if self.proxy is None:
                return self._cut_and_searched(self.goal.scaled(factor), factor)
            parts, _, found = self._cut_and_searched(self._on_proxy(factor), factor)
            return self._lifted(parts, factor), self.goal, found

    def _on_proxy(self, factor: float, sign: int = -1) -> Criterion:
        """The goal, tighter by a margin, or looser."""
        assert self.proxy is not None
        return self.goal.scaled(factor + sign * MARGIN * self.proxy.deviation / self.options.threshold)

    def _lifted(self, parts: list[Part], factor: float) -> list[Part]:
        """Carry parts of the proxy to the solid."""
        assert self.proxy is not None
        goal, run = self.goal.scaled(factor), self.run
        policy = make_policy(self.options.policy, SweepCache(), _scale(self.goal))
        with run.stage("lift"):
            lift = Lift(self.root, self.proxy.deviation, goal, self._on_proxy(factor), policy, self.run)
            parts = lift(parts, mend=run.stopped_by is None)
            if self.options.merge and run.stopped_by is None:  # the margin may have kept some apart
                rehearsal = self._on_proxy(factor, 1)
                parts = merge_lifted(parts, self.proxy.component, rehearsal, lift.confirmed, self.run)
        return parts

    def _cut_and_searched(self, goal: Criterion, factor: float) -> tuple[list[Part], Criterion, SearchSummary | None]:
        options, run = self.options, self.run
        done = cut_and_merge(self._tree, goal, run, merge=options.merge)
        parts, goal = done.parts, done.criterion
        policy = options.policy if isinstance(options.policy, str) else ""
        may_be_divided = options.merge and goal.obstacles is not None and policy not in AS_PUBLISHED
        context = SearchContext(self._tree.root, goal, options.seed, self._sweeps)
        found = None
        try:
            if may_be_divided and run.stopped_by is None:
                with run.stage("search"):
                    parts = eliminate_parts(context, parts, run)
            assert options.quality is not None
            if options.quality != "fast" and run.stopped_by is None:
                own = (options.quality, options.budget, options.search_steps) if factor == 1 else ("balanced",)
                with run.stage("search"):
                    parts, found = search(context, parts, run, *own)
        except Stopped:
            run.note_stop()
        return parts, goal, found


def _scale(criterion: Criterion) -> float | None:
    """How far a hull may reach beyond its part, if the criterion bounds that: an input of networks."""
    return criterion.overhang if math.isfinite(criterion.overhang) else None


def _prepared(options: Options, solid: Solid, run: Run) -> Criterion:
    if isinstance(options.criterion, NavigableSpace):
        with run.stage("space"):
            return options.criterion.prepare(solid, run.threads)
    if options.criterion == VOLUME:
        return AddedVolume.of(options.volume_tolerance, options.volume_of, solid)
    return Concavity(options.threshold, _unit(options, solid))


def _unprepared(options: Options, solid: Solid) -> Criterion:
    if isinstance(options.criterion, NavigableSpace):
        return options.criterion.unprepared(solid.frame.scale)
    if options.criterion == VOLUME:
        return AddedVolume(options.volume_tolerance, None, 0.0)
    return Concavity(options.threshold, _unit(options, solid))


def _unit(options: Options, solid: Solid) -> float:
    """Length of the unit in which the threshold was given."""
    return 1.0 if options.threshold_abs is None else solid.frame.scale
