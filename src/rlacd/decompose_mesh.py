"""The public function: load, repair, cut until every component meets the criterion, merge, search, finish."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, cast

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd import _native
from rlacd._native import Stopped
from rlacd.clock import Clock
from rlacd.criteria import AddedVolume, Concavity, Criterion, NavigableSpace
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError
from rlacd.fields import check_callback
from rlacd.io.read.conventions import UNITS
from rlacd.io.read.load import load_mesh
from rlacd.merge import (
    as_carried,
    drop_slivers,
    in_input,
    limit_part,
    limit_roughly,
    merge_lifted,
    merge_to_count,
    overlap_parts,
    primitive_part,
    simple_part,
    with_limits,
)
from rlacd.merge.overlap import Seams
from rlacd.merge.primitives import SLACK
from rlacd.options import (
    CONCAVITY,
    DEFAULT_RESOLUTION,
    DEFAULT_THRESHOLD,
    OPTION_NAMES,
    SIMPLE,
    VOLUME,
    DetailName,
    OpenName,
    Options,
    QualityName,
    RelativeTo,
    UnitName,
    VolumeOf,
)
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import AS_PUBLISHED, Greedy, Policy, make_policy
from rlacd.presets import PresetName
from rlacd.primitive_kinds import PrimitiveKind
from rlacd.progress import ProgressCallback
from rlacd.proxy import FEW, Lift, Proxy, simplify
from rlacd.renamed import with_former
from rlacd.repair.repair import repair
from rlacd.repair.tangles import TangledError, refuse_tangles
from rlacd.report import HONEST_WITHIN, joint_report, make_report
from rlacd.search import SearchContext, eliminate_parts, level, search
from rlacd.search.levels import SearchSummary
from rlacd.solid.balls import Balls
from rlacd.solid.component import Component, Part
from rlacd.solid.cover import cover
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.provenance import owners
from rlacd.solid.solid import Solid
from rlacd.solid.topology import IntArray
from rlacd.workers import Workers

MeshLike: TypeAlias = "str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | tuple[ArrayLike, ArrayLike]"

COARSER = 1.5
"""With `max_hulls`, thresholds that grow by this factor are tried, and the best decomposition is kept."""

MOST_COARSER = 8e6
"""Units of work after which no coarser pass is tried any more, if the hulls are few enough: those of a tangle only."""

FEW_TO_DOUBT = 2000
"""Solids of at most this many triangles are sampled at as many points after a stop: do the hulls cover them?"""

MARGIN = 1.5
"""Parts of a proxy have to be tighter by this share of its deviation: their hulls still have to grow to the solid."""


def decompose(
    mesh: MeshLike,
    *,
    criterion: Literal["concavity", "volume"] | NavigableSpace = CONCAVITY,
    threshold: float = DEFAULT_THRESHOLD,
    threshold_abs: float | None = None,
    volume_tolerance: float = 0.01,
    volume_of: VolumeOf = "part",
    max_hulls: int | None = None,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    detail: DetailName = SIMPLE,
    primitives: bool | Sequence[PrimitiveKind] = (),
    overlap: float = 0.0,
    overlap_abs: float | None = None,
    merge: bool = True,
    policy: str | Policy = "greedy",
    resolution: int = DEFAULT_RESOLUTION,
    open: OpenName = "auto",
    gap: float = 0.03,
    seed: int = 0,
    threads: int | None = None,
    timeout: float | None = None,
    quality: QualityName | None = None,
    budget: float | None = None,
    search_steps: int | None = None,
    preset: PresetName | None = None,
    per_node: bool = False,
    relative_to: RelativeTo = "scene",
    unit: UnitName | None = None,
    scale: float | None = None,
    progress: ProgressCallback | None = None,
    threshold_m: float | None = None,
) -> Decomposition:
    """Decompose a mesh into few convex hulls that fit it tightly.

    Parameters
    ----------
    mesh : path, trimesh.Trimesh, trimesh.Scene or (vertices, faces)
        Any triangle mesh or file of one; it need not be closed, oriented or clean.
    criterion : "concavity", "volume" or NavigableSpace
        Decides when a part is tight enough: its concavity is at most `threshold`; its hull adds at most
        `volume_tolerance` of volume; or its hull stays out of the space that a ball of a given size can reach.
    threshold : float
        Largest concavity of a part, in the frame where the input's longest side is 2 (CoACD's measure and frame):
        how far the surfaces of a part and its hull may lie apart. Between 0.001 and 2.
    threshold_abs : float, optional
        The same in the input's unit; replaces `threshold`.
    volume_tolerance : float
        With the criterion ``volume``, the share of volume that a hull may add: 0.01 is 1 %, as in V-HACD. Parts smaller
        than a thousandth of the whole's convex hull count as this large.
    volume_of : "part" or "whole"
        Whether it is a share of each part's own volume, or of the whole solid's.
    max_hulls : int, optional
        Maximum number of hulls: returns the decomposition with the least concavity among those found. It may exceed
        the threshold; ``report["warnings"]`` then says by how much.
    max_vertices, max_faces : int, optional
        Limits on the vertices and triangles of each hull. A limited hull still contains its part, and the threshold
        holds for it too, unless the limit is below 24 vertices or 44 triangles, or `max_hulls` is given: if the
        threshold is then exceeded, a warning says by how much.
    detail : "simple" or "full"
        ``simple``: hulls leave out corners that add little, so that they have few, as far as the part still meets the
        criterion. ``full``: the exact hulls of the parts.
    primitives : bool or sequence of str
        A part becomes a ``"sphere"``, ``"capsule"``, ``"box"`` or ``"cylinder"`` if one contains its hull and meets the
        criterion: the simplest whose volume is within a quarter of the least. Only those named;
        True allows all. Its hull is then a convex polyhedron around the primitive, and ``Decomposition.primitives``
        describes it. Models (MJCF, URDF, SDF, USD) hold primitives in place of such hulls.
    overlap : float
        Hulls that touch overlap by this much, in the same frame as `threshold`, so that nothing thin slips between
        them: one takes in a layer of the other. The threshold still holds; where it leaves no room, hulls overlap by
        less, and ``report["warnings"]`` says at how many seams. At most 0.5. With `per_node`, hulls of different nodes
        do not overlap.
    overlap_abs : float, optional
        The same in the input's unit; replaces `overlap`.
    merge : bool
        Unite parts whose joint hull still meets the threshold.
    policy : str or Policy
        What chooses the cuts of the first pass: ``greedy``, ``greedy-SCORE``, ``navacd``, ``random-N``, the path of
        an ONNX file (see `rlacd.policies.make_policy`), or any object with a method ``choose``: see `rlacd.Policy`.
    resolution : int
        Cells along the longest side of the grid on which repair looks for enclosed spaces.
    open : "auto", "solid" or "thin"
        How to treat bodies with openings, such as cups and damaged scans. ``auto``: solid if nothing can get inside or
        if the openings look like missing faces; otherwise a shell as thin as its faces. ``solid``: hollows are filled.
        ``thin``: nothing is filled.
    gap : float
        Radius of a ball, where the longest side is 2: what it cannot get into through the openings counts as closed.
    seed : int
        Seed of all random choices; the same input, options and seed give the same bytes.
    threads : int, optional
        Number of threads; all processors by default. The result does not depend on it.
    timeout : float, optional
        Seconds after which the decomposition reached so far is returned, at most 1 s and 10 % late for inputs of up to
        a million triangles. It always covers the input, at worst with one hull for each body.
    quality : str, optional
        ``fast``: one pass of cuts; on navigable space, parts that can be divided among others are then eliminated,
        unless the policy stands for a published method (``navacd``, ``greedy-SCORE``). ``balanced``, the default if
        parts are merged: also a search for fewer parts, whose work is limited to a multiple of that of the pass.
        ``best``: the same, followed by a long search.
        No level is worse than the one before it: it finds fewer hulls, or equally many with no more volume before
        `detail` simplifies them.
    budget : float, optional
        Seconds the search may take, instead of the limits of the level; the result then depends on the speed of the
        machine. ``best`` has 5, and more if the search of ``balanced`` takes longer.
    search_steps : int, optional
        Steps the search may take, instead of the limits of the level (about 10 to 20 a second on one core). The result
        does not depend on the speed of the machine.
    preset : str, optional
        The engine the hulls are for: ``mujoco``, ``physx``, ``physx-gpu``, ``unity``, ``unreal``, ``newton``,
        ``bullet`` or ``godot``. Each of its limits applies unless `max_vertices` or `max_faces`, respectively, is
        given, and ``report["warnings"]`` says what the engine will not accept; see `rlacd.PRESETS`.
    per_node : bool
        Decompose each node of a scene separately, such as the doors and drawers of a cupboard, which move. The limits
        on hulls hold for each. Every hull's ``metadata`` names its node, with or without this.
    relative_to : "scene" or "node"
        With `per_node`, what `threshold` is relative to: the size of the whole scene, or of each node.
    unit : "mm", "cm", "m", "in" or "file", optional
        The unit of the input, which is converted to metres; ``file`` takes what the file says. By default coordinates
        stay as they are.
    scale : float, optional
        Factor to multiply the input's coordinates by, also after a conversion by `unit`.
    progress : callable, optional
        Called with a `Progress` between steps, and several times a second during long ones; when it returns False, the
        decomposition reached so far is returned as promptly as after a timeout.
    threshold_m : float, optional
        The former name of `threshold_abs`.

    Returns
    -------
    Decomposition
        The hulls, in the input's frame and unit, and a report.

    Raises
    ------
    MeshError
        The input cannot be read or contains nothing to decompose.
    OptionError
        An option has the wrong type or is out of range; raised before any work is done.
    MissingExtraError
        A network is requested without the extra ``learned``.
    """
    given = locals()
    chosen = with_former(Options, {name: given[name] for name in OPTION_NAMES}, {"threshold_m": threshold_m})
    options = Options(**chosen)
    check_callback("progress", progress, "a `rlacd.Progress`")
    make_policy(options.policy)  # reports a bad network before any work is done
    clock = Clock(options.timeout, progress)
    with clock.running(), Workers(options.threads, clock.stop) as workers:
        with clock.stage("load"):
            source = in_metres(load_mesh(mesh), options)
        apart = options.per_node and len(source.nodes) > 1
        done = _each_node(source, options, workers, clock) if apart else _as_one(source, options, workers, clock)
    report = {
        "name": Path(source.name).stem if isinstance(mesh, (str, os.PathLike)) else "mesh",
        **done.report,
        "provenance": [{"node": hull.metadata.get("node"), "body": hull.metadata.get("body")} for hull in done.hulls],
        "up": source.up,
        "metres": source.metres,
        "seconds": {**clock.seconds, "total": clock.elapsed},
    }
    surface = trimesh.Trimesh(source.vertices, source.faces, process=False)
    return Decomposition(done.hulls, report, surface, done.balls, source)


class _Done(NamedTuple):
    """Hulls in the input's unit, with what was measured."""

    hulls: list[trimesh.Trimesh]
    report: dict[str, Any]
    balls: Balls | None = None


def _as_one(source: InputMesh, options: Options, workers: Workers, clock: Clock) -> _Done:
    reached = _decomposed(source, options, workers, clock)
    clock.nothing_left_to_stop()
    done = _finished(reached, workers, clock)
    if (node_of := source.node_of) is not None:
        places = clock.if_in_time(lambda: owners(done.hulls, source.vertices, source.faces, node_of), lambda: [])
        for hull, place in zip(done.hulls, places, strict=False):
            hull.metadata |= {"node": source.nodes[place].name, "node_index": place}
    return done


def _each_node(source: InputMesh, options: Options, workers: Workers, clock: Clock) -> _Done:
    """Decompose every node separately; lengths of the joint report are in the frame of the whole scene."""
    scale = Frame.of(source.vertices[np.unique(source.faces)]).scale
    assert source.node_of is not None
    used = np.unique(source.node_of).tolist()
    meshes = [source.of_node(index) for index in used]
    reached = [_decomposed(mesh, options.for_node(scale, _scale_of(mesh)), workers, clock) for mesh in meshes]
    clock.nothing_left_to_stop()
    done = [_finished(one, workers, clock) for one in reached]
    bodies = 0
    for place, one in zip(used, done, strict=True):
        for hull in one.hulls:
            body = hull.metadata["body"]
            whose = {"node": source.nodes[place].name, "node_index": place}
            hull.metadata |= whose | {"body": None if body is None else body + bodies}
        bodies += len(one.report["repair"])
    names = [source.nodes[place].name for place in used]
    report = joint_report(list(zip(names, (one.report for one in done), strict=True)), scale)
    report["options"] |= {name: getattr(options, name) for name in ("threshold", "threshold_abs")}
    report["warnings"][:0] = source.warnings
    return _Done([hull for one in done for hull in one.hulls], report)


def _scale_of(mesh: InputMesh) -> float:
    return Frame.of(mesh.vertices).scale


def _finished(reached: _Reached, workers: Workers, clock: Clock) -> _Done:
    """Clean the parts, carry them to the input's unit, and measure them."""
    solid, goal = reached.solid, reached.goal
    with clock.stage("finish"):
        limits = reached.options.max_vertices, reached.options.max_faces
        parts, seams = clock.if_in_time(
            lambda: _cleaned(reached, *limits, workers),
            lambda: ([limit_roughly(part, *limits) for part in reached.parts], None),
        )
        with clock.shielded():
            hulls = workers.map(lambda part: in_input(part.hull, solid.frame, *limits), parts)
            parts = [as_carried(part, hull, solid.frame) for part, hull in zip(parts, hulls, strict=True)]
    with clock.stage("measure"):
        report = make_report(solid, parts, hulls, reached.options, goal, seams, workers, clock, reached.root)
        unknown: list[int] | list[None] = [None] * len(hulls)
        bodies = clock.if_in_time(lambda: _bodies(solid, hulls), lambda: unknown)
    for hull, body in zip(hulls, bodies, strict=True):
        hull.metadata["body"] = body
    report["search"] = None if reached.found is None else reached.found.as_plain()
    balls = goal.obstacles.in_input(solid.frame) if goal.obstacles is not None else None
    return _Done(hulls, report, balls)


def _bodies(solid: Solid, hulls: list[trimesh.Trimesh]) -> list[int] | list[None]:
    """The body of each hull, by its number in the report; None if the input was not repaired, or there is no time."""
    if len(solid.bodies) == 0:
        return [None] * len(hulls)
    if solid.body_of is None:
        return [0] * len(hulls)
    vertices, faces = solid.surface
    return owners(hulls, solid.frame.to_input(vertices), faces, solid.body_of)


class _Reached(NamedTuple):
    """The decomposition reached: complete, or the state when it was stopped."""

    solid: Solid
    options: Options
    goal: Criterion
    parts: list[Part]
    found: SearchSummary | None = None
    root: Component | None = None


def in_metres(source: InputMesh, options: Options) -> InputMesh:
    """Convert the input as the options say.

    Raises
    ------
    OptionError
        The unit is to be that of the file, which does not say it.
    """
    factor = 1.0 if options.scale is None else options.scale
    if options.unit == "file" and source.metres is None:
        raise OptionError(f"unit is 'file', but {source.name} does not say its unit; give mm, cm, m or in.")
    if options.unit is not None:
        factor *= UNITS.get(options.unit, source.metres or 1.0)
        source = replace(source, metres=1.0)
    return source if factor == 1.0 else source.scaled(factor)


def _cleaned(
    reached: _Reached, max_vertices: int | None, max_faces: int | None, workers: Workers
) -> tuple[list[Part], Seams | None]:
    """The parts without slivers, overlapping if asked for, as primitives or with simple hulls inside the limits."""
    kinds, goal = cast("tuple[PrimitiveKind, ...]", reached.options.primitives), reached.goal
    slack = SLACK + 8 * reached.solid.frame.resolution

    def cleaned(part: Part) -> Part:
        part.tree = part.tree or _native.TreeCache()
        if kinds:
            shaped = primitive_part(part, goal, kinds, max_vertices, max_faces, slack, reached.root)
            if shaped is not part:
                return shaped
        if reached.options.detail == SIMPLE:
            part = simple_part(part, goal, max_vertices, max_faces)
        return limit_part(part, max_vertices, max_faces, goal)

    parts, seams = drop_slivers(reached.parts, workers), None
    if reached.options.overlap > 0 and reached.root is not None:
        parts, seams = overlap_parts(parts, reached.root, goal, reached.options.overlap)
    return workers.map(cleaned, parts), seams


def _decomposed(source: InputMesh, options: Options, workers: Workers, clock: Clock) -> _Reached:
    """Repair, cut, merge and search, until done or stopped by the clock."""
    try:
        return _repaired_and_cut(source, options, workers, clock, None)
    except TangledError as tangle:
        return _repaired_and_cut(source, options, workers, clock, tangle.bodies)


def _repaired_and_cut(
    source: InputMesh, options: Options, workers: Workers, clock: Clock, tangled: IntArray | None
) -> _Reached:
    """The same in one attempt.

    Raises
    ------
    TangledError
        Some bodies cannot be cut as they are; never if `tangled` names any.
    """
    try:
        with clock.stage("repair"):
            solid = repair(
                source,
                resolution=options.resolution,
                open_bodies=options.open,
                gap=options.gap,
                threads=workers.threads,
                keep_cavities=isinstance(options.criterion, NavigableSpace) and options.criterion.sees_cavities,
                tangled=tangled,
            )
        options = options.at_scale(solid.frame.scale)
        goal = _prepared(options, solid, workers, clock)
        root = Component(solid.shape, workers.threads)
    except Stopped:
        clock.note_stop()
        solid, parts = cover(source, clock)
        options = options.at_scale(solid.frame.scale)
        return _Reached(solid, options, _unprepared(options, solid), parts)
    if options.max_hulls is None:  # otherwise the threshold may be exceeded anyway
        goal = with_limits(goal, options.max_vertices, options.max_faces)
    doubt = None if tangled is not None else partial(refuse_tangles, solid, workers.threads)
    proxy = _proxy(root, goal, options, workers, clock)
    if proxy is not None:
        return _through_proxy(solid, root, proxy, goal, options, workers, clock, doubt)
    parts, goal, found = _cut_and_searched(root, goal, options, workers, clock, doubt)
    if _lost_in_cuts(solid, parts, workers, clock):
        solid, parts = cover(source, clock)
        return _Reached(solid, options, _unprepared(options, solid), parts)
    return _Reached(solid, options, goal, parts, found, root)


def _lost_in_cuts(solid: Solid, parts: Sequence[Part], workers: Workers, clock: Clock) -> bool:
    """Whether a stop leaves parts that miss some of a small solid, as happens to one that crosses itself."""
    if clock.stopped_by is None or len(solid.faces) > FEW_TO_DOUBT:
        return False
    with clock.shielded():
        inner, _ = _native.sample_surface(solid.vertices, solid.faces, FEW_TO_DOUBT, 0)
        hulls = hull_union([part.hull for part in parts], workers.threads)
        away = hulls.distance(np.concatenate([solid.vertices, inner]), workers.threads)
        return bool(away.max() > HONEST_WITHIN)


def _proxy(root: Component, goal: Criterion, options: Options, workers: Workers, clock: Clock) -> Proxy | None:
    """A simpler solid to decompose in place of a dense one."""
    if not math.isfinite(goal.overhang) or len(root.faces) < FEW:
        return None
    try:
        with clock.stage("simplify"):
            return simplify(root, options.threshold, workers.threads)
    except Stopped:
        clock.note_stop()
        return None


def _through_proxy(
    solid: Solid,
    root: Component,
    proxy: Proxy,
    goal: Criterion,
    options: Options,
    workers: Workers,
    clock: Clock,
    doubt: Callable[[bool], None] | None,
) -> _Reached:
    """Decompose a proxy under a tighter criterion, and carry the parts to the solid."""
    share = proxy.deviation / options.threshold
    on_proxy = goal.scaled(1 - MARGIN * share)
    parts, _, found = _cut_and_searched(proxy.component, on_proxy, options, workers, clock, doubt)
    policy = make_policy(options.policy, SweepCache(), _scale(goal))
    with clock.stage("lift"):
        lift = Lift(root, proxy.deviation, goal, on_proxy, policy, workers, clock)
        parts = lift(parts, mend=options.max_hulls is None and clock.stopped_by is None)
        if options.merge and clock.stopped_by is None:  # the margin may have kept some apart
            rehearsal = goal.scaled(1 + MARGIN * share)
            parts = merge_lifted(parts, proxy.component, rehearsal, lift.confirmed, workers, clock)
    return _Reached(solid, options, goal, parts, found, root)


def _cut_and_searched(
    root: Component,
    goal: Criterion,
    options: Options,
    workers: Workers,
    clock: Clock,
    doubt: Callable[[bool], None] | None,
) -> tuple[list[Part], Criterion, SearchSummary | None]:
    """The parts of a solid, the criterion as settled on them, and a summary of the search."""
    sweeps = SweepCache()
    second = Greedy("hull-sum", sweeps=sweeps) if options.policy == "greedy" else None
    tree = CutTree(root, make_policy(options.policy, sweeps, _scale(goal)), workers, doubt=doubt, second=second)
    parts, goal = _parts(tree, goal, options, workers, clock)
    policy = options.policy if isinstance(options.policy, str) else ""
    may_be_divided = options.merge and goal.obstacles is not None and policy not in AS_PUBLISHED
    context = SearchContext(root, goal, workers, options.seed, sweeps)
    found = None
    try:
        if may_be_divided and clock.stopped_by is None:
            with clock.stage("search"):
                parts = eliminate_parts(context, parts, clock)
        assert options.quality is not None
        if options.quality != "fast" and clock.stopped_by is None:
            bounds = level(options.quality, options.budget, options.search_steps)
            with clock.stage("search"):
                parts, found = search(context, parts, bounds, clock, most_parts=options.max_hulls, first=policy)
    except Stopped:
        clock.note_stop()
    return parts, goal, found


def _scale(criterion: Criterion) -> float | None:
    """How far a hull may reach beyond its part, if the criterion bounds that: an input of networks."""
    return criterion.overhang if math.isfinite(criterion.overhang) else None


def _prepared(options: Options, solid: Solid, workers: Workers, clock: Clock) -> Criterion:
    if isinstance(options.criterion, NavigableSpace):
        with clock.stage("space"):
            return options.criterion.prepare(solid, workers.threads)
    if options.criterion == VOLUME:
        return AddedVolume.of(options.volume_tolerance, options.volume_of, solid)
    return Concavity(options.threshold)


def _unprepared(options: Options, solid: Solid) -> Criterion:
    if isinstance(options.criterion, NavigableSpace):
        return options.criterion.unprepared(solid.frame.scale)
    if options.criterion == VOLUME:
        return AddedVolume(options.volume_tolerance, None, 0.0)
    return Concavity(options.threshold)


def _parts(
    tree: CutTree, criterion: Criterion, options: Options, workers: Workers, clock: Clock
) -> tuple[list[Part], Criterion]:
    """The parts, and the criterion as settled on them."""
    if options.max_hulls == 1:
        return [tree.root], criterion.settled([tree.root])
    parts, criterion = _one_pass(tree, criterion, options, workers, clock)
    if options.max_hulls is None or len(parts) <= options.max_hulls:
        return parts, criterion
    best: list[Part] = []
    least = np.inf
    coarser, begin = criterion, clock.work.done
    while True:
        with clock.stage("merge"):
            few = merge_to_count(parts, options.max_hulls, criterion, workers, clock, worst=least)
            try:
                error = max(workers.map(criterion.error, few)) if few else np.inf
            except Stopped:
                clock.note_stop()
                error = np.inf
        if few and (not best or (len(few) <= options.max_hulls and error < least)):
            best, least = few, error
        enough = len(best) <= options.max_hulls and clock.work.done - begin > MOST_COARSER
        if len(parts) <= options.max_hulls or clock.stopped_by is not None or enough:
            return best, criterion
        coarser = coarser.scaled(COARSER)
        parts, _ = _one_pass(tree, coarser, options, workers, clock)


def _one_pass(
    tree: CutTree, criterion: Criterion, options: Options, workers: Workers, clock: Clock
) -> tuple[list[Part], Criterion]:
    done = cut_and_merge(tree, criterion, workers, clock, merge=options.merge)
    return done.parts, done.criterion
