"""The loop: load, repair, cut until every component meets the criterion, merge, finish."""

from __future__ import annotations

import itertools
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from rlacd._version import __version__
from rlacd.clock import Clock
from rlacd.criteria import Concavity, Criterion
from rlacd.decomposition import Decomposition
from rlacd.finish import drop_slivers, limit_part, limited, merge_parts, merge_to_count
from rlacd.options import DEFAULT_RESOLUTION, Options
from rlacd.policies import Policy, make_policy
from rlacd.progress import ProgressCallback
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Part, Plane
from rlacd.solid.distance import hull_distances
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.load import InputMesh, load_mesh
from rlacd.solid.repair import repair
from rlacd.solid.solid import Solid
from rlacd.workers import Workers

MeshLike: TypeAlias = "str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene | tuple[ArrayLike, ArrayLike]"

COARSER = 1.3
"""With `max_hulls`, decompositions at thresholds growing by this factor compete."""

HONEST_WITHIN = 5e-3
"""What the hulls' union may reach beyond the threshold before the report says so: repair and measurement."""


def decompose(
    mesh: MeshLike,
    *,
    threshold: float = 0.05,
    threshold_m: float | None = None,
    max_hulls: int | None = None,
    max_vertices: int | None = None,
    max_faces: int | None = None,
    merge: bool = True,
    policy: str = "greedy",
    resolution: int = DEFAULT_RESOLUTION,
    seed: int = 0,
    threads: int | None = None,
    timeout: float | None = None,
    progress: ProgressCallback | None = None,
) -> Decomposition:
    """Decompose a mesh into few convex hulls that fit it tightly.

    Parameters
    ----------
    mesh : path, trimesh.Trimesh, trimesh.Scene or (vertices, faces)
        Any triangle mesh or file of one; it need not be closed, oriented or clean.
    threshold : float
        Largest concavity of a part, in the frame where the input's longest side is 2 (CoACD's measure and frame):
        the farthest that a part's surface and its hull's surface may lie apart. Between 0.001 and 1.
    threshold_m : float, optional
        The same in the input's unit; replaces `threshold`.
    max_hulls : int, optional
        No more hulls than this: the decomposition with the least concavity among those found. It may exceed the
        threshold; ``report["warnings"]`` then says by how much.
    max_vertices, max_faces : int, optional
        Limits on the vertices and triangles of each hull. A limited hull still contains its part, and the threshold
        holds for it too.
    merge : bool
        Unite parts whose joint hull still meets the threshold.
    policy : str
        Who chooses the cuts: ``greedy``, or ``greedy-SCORE`` (see `rlacd.policies.POLICIES`).
    resolution : int
        Cells along the longest side of the grid on which repair looks for enclosed rooms.
    seed : int
        For whatever is random; the same input, options and seed give the same bytes.
    threads : int, optional
        Threads to use; all processors by default. The result does not depend on it.
    timeout : float, optional
        Seconds after which the decomposition reached so far is returned.
    progress : callable, optional
        Called with a `Progress` between steps; when it returns False, the decomposition reached so far is returned.

    Returns
    -------
    Decomposition
        The hulls, in the input's frame and unit, and a report.

    Raises
    ------
    MeshError
        The input cannot be read or holds nothing to decompose.
    OptionError
        An option is out of range.
    """
    options = Options(
        threshold=threshold,
        threshold_m=threshold_m,
        max_hulls=max_hulls,
        max_vertices=max_vertices,
        max_faces=max_faces,
        merge=merge,
        policy=policy,
        resolution=resolution,
        seed=seed,
        threads=threads,
        timeout=timeout,
    )
    clock = Clock(timeout, progress)
    with Workers(threads) as workers:
        with clock.stage("load"):
            source = load_mesh(mesh)
        with clock.stage("repair"):
            solid = repair(source, resolution=resolution, threads=threads)
        if threshold_m is not None:
            options = options.with_threshold(threshold_m * solid.frame.scale)
        criterion = limited(Concavity(options.threshold), max_vertices, max_faces)
        parts = _parts(Component(solid.manifold), criterion, options, workers, clock)
        with clock.stage("finish"):
            parts = drop_slivers(parts, workers)
            parts = workers.map(lambda part: limit_part(part, max_vertices, max_faces), parts)
            hulls = workers.map(lambda part: _in_input(part.hull, solid.frame), parts)
        with clock.stage("measure"):
            report = _report(solid, parts, hulls, options, criterion, workers, clock)
    report = {
        "name": Path(source.name).stem if isinstance(mesh, (str, os.PathLike)) else "mesh",
        **report,
        "seconds": {**clock.seconds, "total": clock.elapsed},
    }
    return Decomposition(hulls, report, trimesh.Trimesh(source.vertices, source.faces, process=False))


def _parts(root: Component, criterion: Criterion, options: Options, workers: Workers, clock: Clock) -> list[Part]:
    parts = _cut_and_merge(root, criterion, options, workers, clock)
    if options.max_hulls is None or len(parts) <= options.max_hulls:
        return parts
    best: list[Part] = []
    least = np.inf
    coarser = criterion
    while True:
        with clock.stage("merge"):
            few = merge_to_count(parts, options.max_hulls, criterion, workers, clock)
            error = max(workers.map(criterion.error, few))
        if not best or (len(few) <= options.max_hulls and error < least):
            best, least = few, error
        if len(parts) <= options.max_hulls or clock.stopped_by is not None:
            return best
        coarser = coarser.scaled(COARSER)
        parts = _cut_and_merge(root, coarser, options, workers, clock)


def _cut_and_merge(
    root: Component, criterion: Criterion, options: Options, workers: Workers, clock: Clock
) -> list[Part]:
    with clock.stage("cut"):
        done, left = cut_until_done(root, criterion, make_policy(options.policy), workers, clock)
    if not options.merge:
        return [*done, *left]
    with clock.stage("merge"):
        return merge_parts([*done, *left], criterion, workers, clock)


def _in_input(hull: Hull, frame: Frame) -> trimesh.Trimesh:
    """Carry a hull from the frame to the input's unit: rounded there first, so that it is exactly convex there."""
    points = frame.to_input(hull.vertices)
    there = Hull.of(points)
    if there is None:  # thinner than the input's coordinates can tell apart
        there = Hull.of(box_around(points))
        assert there is not None
    return trimesh.Trimesh(there.vertices, there.faces, process=False)


def box_around(points: FloatArray) -> FloatArray:
    """Corners [8, 3] of the smallest box around the points that floating point can tell from a flat one."""
    lower, upper = np.nextafter(points.min(axis=0), -np.inf), np.nextafter(points.max(axis=0), np.inf)
    return np.array(list(itertools.product(*zip(lower, upper, strict=True))))


def _report(
    solid: Solid,
    parts: list[Part],
    hulls: list[trimesh.Trimesh],
    options: Options,
    criterion: Criterion,
    workers: Workers,
    clock: Clock,
) -> dict[str, Any]:
    errors = workers.map(criterion.error, parts)
    over = under = None
    if len(solid.surface[1]):  # a cloud of points has no surface
        distances = hull_distances([part.hull for part in parts], *solid.surface, threads=workers.threads)
        over, under = distances.over[1], distances.under[1]
    return {
        "version": __version__,
        "options": asdict(options),
        "complete": clock.stopped_by is None,
        "stopped_by": clock.stopped_by,
        "parts": len(parts),
        "faces": sum(len(hull.faces) for hull in hulls),
        "vertices": sum(len(hull.vertices) for hull in hulls),
        "concavity": {"per_part": errors, "max": max(errors)},
        "hausdorff": {"over": over, "under": under},
        "scale": solid.frame.scale,
        "repair": [asdict(body) for body in solid.bodies],
        "warnings": [*solid.warnings, *_shortcomings(errors, over, options, clock)],
    }


def _shortcomings(errors: list[float], over: float | None, options: Options, clock: Clock) -> list[str]:
    """Say where the result falls short of what was asked for."""
    sentences = []
    if clock.stopped_by is not None:
        reason = {"timeout": "the timeout ended", "cancel": "the caller ended"}[clock.stopped_by]
        sentences.append(
            f"Incomplete: {reason} the work early; the hulls cover the solid but are coarser than asked for."
        )
    exceeding = [error for error in errors if error > options.threshold]
    if exceeding:
        sentences.append(
            f"{len(exceeding)} of {len(errors)} parts exceed the concavity {options.threshold:.4g}; "
            f"the worst has {max(exceeding):.4g}."
        )
    if options.max_hulls is not None and len(errors) > options.max_hulls:
        sentences.append(f"{len(errors)} hulls are left, more than the {options.max_hulls} asked for.")
    if over is not None and not exceeding and over > options.threshold + HONEST_WITHIN:
        sentences.append(
            f"The hulls reach up to {over:.4g} beyond the input's surface, more than the threshold: "
            "the repair closed what may be open in the input (see `repair`)."
        )
    return sentences


def cut_until_done(
    solid: Component, criterion: Criterion, policy: Policy, workers: Workers, clock: Clock
) -> tuple[list[Component], list[Component]]:
    """Cut a solid until each component meets the criterion.

    All unfinished components of a round are judged, split into connected pieces, and cut together.

    Returns
    -------
    done : list of Component
        Components that meet the criterion.
    left : list of Component
        Components that do not: no plane cuts them, or the clock ran out first.
    """
    done: list[Component] = []
    left: list[Component] = []
    frontier = [solid]
    while frontier:
        verdicts = workers.map(criterion.is_met, frontier)
        done += [c for c, met in zip(frontier, verdicts, strict=True) if met]
        unmet = [c for c, met in zip(frontier, verdicts, strict=True) if not met]
        if not clock.step(len(done), None, len(done) + len(unmet)):
            return done, left + unmet

        frontier, whole = [], []
        for component in unmet:
            pieces = component.pieces()
            if len(pieces) > 1:
                frontier += pieces
            else:
                whole += pieces
        threads = workers.share(len(whole))
        planes = workers.map(lambda c: policy.choose(c, threads), whole)  # noqa: B023
        for component, plane in zip(whole, planes, strict=True):
            children = _cut(component, plane)
            if len(children) < 2:
                left.append(component)
            frontier += children if len(children) == 2 else []
    return done, left


def _cut(component: Component, plane: Plane | None) -> list[Component]:
    if plane is None:
        return []
    return [child for child in component.cut(plane) if child is not None]
