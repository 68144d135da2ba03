"""From a mesh to the parts of its solid: repair, cut until every component meets the criterion, merge, search.

A dense solid is cut, merged and searched as a simpler copy (`rlacd.proxy`), and its parts are carried to the solid.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd._native import Stopped
from rlacd.criteria import AddedVolume, Concavity, Criterion, NavigableSpace
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import merge_lifted, merge_to_count, with_limits
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
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Shape, Solid
from rlacd.solid.topology import IntArray

COARSER = 1.5
"""With `max_hulls`, thresholds that grow by this factor are tried, and the best decomposition is kept."""

MOST_COARSER = 8e6
"""Units of work after which no coarser pass is tried any more, if the hulls are few enough: those of a tangle only."""

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
        What the parts meet, unless the run ended or `max_hulls` forbade it.
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
    if options.max_hulls is None:  # otherwise the threshold may be exceeded anyway
        goal = with_limits(goal, options.max_vertices, options.max_faces)
    doubt = None if tangled is not None else partial(refuse_tangles, solid, run.threads)
    proxy = _proxy(root, solid.pieces, goal, options, run)
    solid.pieces.clear()
    if proxy is not None:
        return _through_proxy(solid, root, proxy, goal, options, run, doubt)
    parts, goal, found = _cut_and_searched(root, goal, options, run, doubt)
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


def _through_proxy(
    solid: Solid,
    root: Component,
    proxy: Proxy,
    goal: Criterion,
    options: Options,
    run: Run,
    doubt: Callable[[bool], None] | None,
) -> Reached:
    """Decompose a proxy under a tighter criterion, and carry the parts to the solid."""
    share = proxy.deviation / options.threshold
    on_proxy = goal.scaled(1 - MARGIN * share)
    parts, _, found = _cut_and_searched(proxy.component, on_proxy, options, run, doubt)
    policy = make_policy(options.policy, SweepCache(), _scale(goal))
    with run.stage("lift"):
        lift = Lift(root, proxy.deviation, goal, on_proxy, policy, run)
        parts = lift(parts, mend=options.max_hulls is None and run.stopped_by is None)
        if options.merge and run.stopped_by is None:  # the margin may have kept some apart
            rehearsal = goal.scaled(1 + MARGIN * share)
            parts = merge_lifted(parts, proxy.component, rehearsal, lift.confirmed, run)
    return Reached(solid, options, goal, parts, found, root)


def _cut_and_searched(
    root: Component,
    goal: Criterion,
    options: Options,
    run: Run,
    doubt: Callable[[bool], None] | None,
) -> tuple[list[Part], Criterion, SearchSummary | None]:
    """The parts of a solid, the criterion as settled on them, and a summary of the search."""
    sweeps = SweepCache()
    second = Greedy("hull-sum", sweeps=sweeps) if options.policy == "greedy" else None
    tree = CutTree(root, make_policy(options.policy, sweeps, _scale(goal)), run, doubt=doubt, second=second)
    parts, goal = _parts(tree, goal, options, run)
    policy = options.policy if isinstance(options.policy, str) else ""
    may_be_divided = options.merge and goal.obstacles is not None and policy not in AS_PUBLISHED
    context = SearchContext(root, goal, options.seed, sweeps)
    found = None
    try:
        if may_be_divided and run.stopped_by is None:
            with run.stage("search"):
                parts = eliminate_parts(context, parts, run)
        assert options.quality is not None
        if options.quality != "fast" and run.stopped_by is None:
            with run.stage("search"):
                bounds = options.quality, options.budget, options.search_steps
                parts, found = search(context, parts, run, *bounds, options.max_hulls)
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
    return Concavity(options.threshold)


def _unprepared(options: Options, solid: Solid) -> Criterion:
    if isinstance(options.criterion, NavigableSpace):
        return options.criterion.unprepared(solid.frame.scale)
    if options.criterion == VOLUME:
        return AddedVolume(options.volume_tolerance, None, 0.0)
    return Concavity(options.threshold)


def _parts(tree: CutTree, criterion: Criterion, options: Options, run: Run) -> tuple[list[Part], Criterion]:
    """The parts, and the criterion as settled on them."""
    if options.max_hulls == 1:
        return [tree.root], criterion.settled([tree.root])
    parts, criterion = _one_pass(tree, criterion, options, run)
    if options.max_hulls is None or len(parts) <= options.max_hulls:
        return parts, criterion
    best: list[Part] = []
    least = np.inf
    coarser, begin = criterion, run.work.done
    while True:
        with run.stage("merge"):
            few = merge_to_count(parts, options.max_hulls, criterion, run, worst=least)
            try:
                error = max(run.map(criterion.error, few)) if few else np.inf
            except Stopped:
                run.note_stop()
                error = np.inf
        if few and (not best or (len(few) <= options.max_hulls and error < least)):
            best, least = few, error
        enough = len(best) <= options.max_hulls and run.work.done - begin > MOST_COARSER
        if len(parts) <= options.max_hulls or run.stopped_by is not None or enough:
            return best, criterion
        coarser = coarser.scaled(COARSER)
        parts, _ = _one_pass(tree, coarser, options, run)


def _one_pass(tree: CutTree, criterion: Criterion, options: Options, run: Run) -> tuple[list[Part], Criterion]:
    done = cut_and_merge(tree, criterion, run, merge=options.merge)
    return done.parts, done.criterion
