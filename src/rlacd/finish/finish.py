"""From parts to hulls in the input's unit: clean the parts, carry them over, measure them.

Final hulls have few corners, are inside the limits, and flat where the solid can rest. They grow to points just outside
them, where repair moved the surface or a sliver was dropped.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import trimesh

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.criteria.limited import limited_part
from rlacd.find_parts import Reached, covered
from rlacd.finish.report import make_report
from rlacd.fit import RESOLVED
from rlacd.options import Options
from rlacd.options.navigable import LARGEST_COORDINATE
from rlacd.options.presets import HullLimits
from rlacd.options.ranges import SIMPLE
from rlacd.report import COVERAGE_TOLERANCE, Overlap, Report
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.balls import Balls
from rlacd.solid.component import DENSE, Part
from rlacd.solid.distance import PLACES, hull_union
from rlacd.solid.frame import GROWTH_TO_SPARE, ROUNDING, Frame
from rlacd.solid.hull import NO_LIMITS, NO_SIDES, PRIMITIVE, TOLERANCE, Hull, keeps
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.provenance import owners
from rlacd.solid.resting import resting_sides, within_reach
from rlacd.solid.solid import Solid

LARGEST = float(np.finfo(np.float64).max)
"""The largest coordinate."""


class Finished(NamedTuple):
    """Hulls in the input's unit, with what was measured."""

    hulls: list[trimesh.Trimesh]
    report: Report
    balls: Balls | None = None


def covers(parts: Sequence[Part], vertices: FloatArray, faces: IntArray, run: Run) -> bool:
    """Whether no point of a surface [V, 3], [F, 3] lies farther outside the hulls of parts than tolerated."""
    union = hull_union([part.hull for part in parts], run.threads)
    return union.under(vertices, faces, RESOLVED, run.threads, COVERAGE_TOLERANCE)[0] <= COVERAGE_TOLERANCE


def whole(reached: Reached, source: InputMesh, options: Options, run: Run) -> Reached:
    """What was reached; a cover of the input if a stop left parts that miss some of it.

    That can happen where a small solid crosses itself.
    """
    if run.stopped_by is None or not 0 < len(reached.solid.faces) <= PLACES:
        return reached
    with run.shielded():
        is_whole = covers(reached.parts, *reached.solid.mesh, run)
    return reached if is_whole else covered(source, options, run)


def finish(reached: Reached, run: Run, *, is_clean: bool = False) -> Finished:
    """Clean the parts unless they are clean, carry them to the input's unit, and measure them; repeat if hulls grow.

    What a state covers, every later state covers: a state that misses some of the solid is not the result, the latest
    one that misses nothing is.
    """
    done, parts = _finished(reached, run, is_clean)
    under = done.report.hausdorff.missed
    if under is not None and under > COVERAGE_TOLERANCE:
        earlier = run.if_in_time(lambda: _covering(reached, parts, run), lambda: None)
        return done if earlier is None else finish(earlier, run)
    if under is None or under <= RESOLVED or run.stopped_by is not None:
        return done
    with run.stage("finish"):
        grown = run.if_in_time(lambda: _taking_in(reached, parts, run), lambda: None)
    if grown is None:
        return done
    again, _ = _finished(reached._replace(parts=grown), run, is_clean)
    return again if run.stopped_by is None else done


def _covering(reached: Reached, finished: Sequence[Part], run: Run) -> Reached | None:
    """The latest state that covers the solid; None if the finished parts do, or no state does."""
    if covers(finished, *reached.solid.mesh, run):
        return None  # repair dropped what is missed
    for number, parts in reversed([*enumerate(reached.before)]):
        if covers(parts, *reached.solid.mesh, run):
            return reached._replace(parts=parts, before=reached.before[:number])
    return None


def _finished(reached: Reached, run: Run, is_clean: bool) -> tuple[Finished, list[Part]]:
    """The result, and the cleaned parts."""
    solid, goal = reached.solid, reached.goal
    with run.stage("finish"):
        limits = reached.options.hull_limits
        parts, seams = run.if_in_time(
            lambda: (reached.parts, None) if is_clean else cleaned_parts(reached, run),
            lambda: ([limit_roughly(part, limits) for part in reached.parts], None),
        )
        with run.shielded():
            hulls = run.map(lambda part: in_input(part.hull, solid.frame, limits), parts)
            parts = [as_carried(part, hull, solid.frame) for part, hull in zip(parts, hulls, strict=True)]
    with run.stage("measure"):
        found = run.start(partial(_bodies, solid, hulls))
        report = make_report(reached, parts, hulls, seams, run)
        unknown: list[int] | list[None] = [None] * len(hulls)
        bodies = run.if_in_time(lambda: run.result(found), lambda: unknown)
    for hull, body in zip(hulls, bodies, strict=True):
        hull.metadata["body"] = body
    balls = goal.obstacles.in_input(solid.frame) if goal.obstacles is not None else None
    return Finished(hulls, report, balls), parts


def _taking_in(reached: Reached, finished: Sequence[Part], run: Run) -> list[Part] | None:
    """The parts with hulls grown to take in input outside the finished ones; None if none can grow."""
    hulls = [part.hull for part in finished]
    points = np.concatenate(
        _native.Against(*reached.solid.surface, run.threads).uncovered(
            [hull.body for hull in hulls], COVERAGE_TOLERANCE, GROWTH_TO_SPARE, run.threads
        )
    )
    distance = hull_union(hulls, run.threads).distance(points, run.threads)
    missed = points[(distance > RESOLVED / 2) & (distance <= COVERAGE_TOLERANCE)]
    grown = take_in(reached.parts, missed, reached.goal) if len(missed) else reached.parts
    return None if all(new is old for new, old in zip(grown, reached.parts, strict=True)) else grown


def cleaned_parts(reached: Reached, run: Run) -> tuple[list[Part], Overlap | None]:
    """The parts, overlapping if asked for, as primitives or with simple hulls inside the limits."""
    options, goal, limits = reached.options, reached.goal, reached.options.hull_limits
    root = reached.root
    sides = NO_SIDES if root is None else resting_sides(root)
    slack = ROUNDING + 8 * reached.solid.frame.resolution

    def cleaned(part: Part) -> Part:
        if kinds := options.primitive_kinds:
            from rlacd.extras.finish.primitives import primitive_part

            shaped = primitive_part(part, goal, kinds, limits, slack)
            if shaped is not part:
                return shaped
        share = SHARE_OF_DEVIATION if keeps(part.hull, limits) else 1.0  # limits make hulls reach farther
        near = within_reach(sides, part.hull, share * goal.outward_deviation)
        part = kept_within(part, near, goal)
        return limit_part(
            simple_part(part, goal, limits, near) if options.detail == SIMPLE else part, limits, goal, near
        )

    parts, seams = reached.parts, None
    if options.overlap > 0 and root is not None:
        from rlacd.extras.finish.overlap import overlap_parts

        parts, seams = overlap_parts(parts, root, goal, options.overlap, reached.solid.frame)
    return run.map(cleaned, parts), seams


def _bodies(solid: Solid, hulls: list[trimesh.Trimesh]) -> list[int] | list[None]:
    """The body of each hull, by its number in the report; None if the input was not repaired, or there is no time."""
    if len(solid.bodies) == 0:
        return [None] * len(hulls)
    if solid.body_of is None:
        return [0] * len(hulls)
    vertices, faces = solid.surface
    return owners(hulls, solid.frame.to_input(vertices), faces, solid.body_of)


def in_input(hull: Hull, frame: Frame, limits: HullLimits = NO_LIMITS) -> trimesh.Trimesh:
    """Carry a hull from the frame to the input's unit: vertices are rounded first, so the result is exactly convex.

    Parameters
    ----------
    hull : Hull
        In the frame, inside the limits.
    frame : Frame
    limits : HullLimits, optional
        For the replacement of a hull that is thinner than the coordinates can resolve.

    Returns
    -------
    trimesh.Trimesh
        Convex and closed, with positive volume. If the hull stands for a primitive, ``metadata`` describes it.
    """
    with np.errstate(over="ignore"):  # a limited hull can reach beyond the input, and so beyond the largest number
        points = np.clip(frame.to_input(hull.vertices), -LARGEST, LARGEST)
    there = Hull.of(points) or _thickened(points, limits)
    metadata = {} if hull.primitive is None else {PRIMITIVE: hull.primitive.in_input(frame).as_plain()}
    return trimesh.Trimesh(there.vertices, there.faces, process=False, metadata=metadata)


def as_carried(part: Part, there: trimesh.Trimesh, frame: Frame) -> Part:
    """Get the part with its hull as `in_input` rounded it, back in the frame, to be measured.

    The same part if no vertex is farther than `TOLERANCE` from the original hull, as in all but coarse coordinates.
    """
    points = frame.to_frame(there.vertices)
    if part.hull.primitive is not None or np.abs(points).max() > LARGEST_COORDINATE:
        return part
    if _native.Surface(part.hull.vertices, part.hull.faces).distance(points).max() <= TOLERANCE:
        return part
    hull = Hull.of(points)
    return part if hull is None else part.with_hull(hull)


def _thickened(points: FloatArray, limits: HullLimits) -> Hull:
    """A hull of flat points [N, 3] that has a volume and is within the limits."""
    lower, upper = padded(points)
    corners = itertools.product(*zip(lower.T, upper.T, strict=True))
    hull = Hull.of(np.concatenate([np.stack(corner, axis=1) for corner in corners]))
    return hull if hull is not None and keeps(hull, limits) else plain_hull(points, limits)


SHARE_OF_DEVIATION = 0.2
"""A simple hull grows by at most this share of the outward deviation that the criterion allows."""

GROWTHS_TRIED = 3
"""Growths tried, each half of the one before, until the criterion is met."""


def simple_part(part: Part, criterion: Criterion, limits: HullLimits, sides: FloatArray = NO_SIDES) -> Part:
    """Get the part with a hull of few corners that still meets the criterion; the same part if there is none.

    What the solid fills to rounding stays as it is: a box keeps its corners, and bodies that touch go on to.
    A criterion that does not bound how far a hull may reach beyond its part leaves hulls as they are. A hull that
    exceeds the limits is left for `limit_part`. For `sides` see `limit_hull`.
    """
    if not math.isfinite(criterion.outward_deviation) or part.filled >= (1 - TOLERANCE) * part.hull.volume:
        return part
    growth = SHARE_OF_DEVIATION * criterion.outward_deviation
    for _ in range(GROWTHS_TRIED):
        simple = limited_part(part, limits, tolerance=growth, sides=sides)
        if simple is part:
            return part
        if criterion.is_met(simple):
            return simple
        if not limits.allow(len(simple.hull.vertices) + 1, len(simple.hull.faces) + 2):
            return part  # it grew because of the limits
        growth /= 2
    return part


def limit_part(part: Part, limits: HullLimits, criterion: Criterion, sides: FloatArray = NO_SIDES) -> Part:
    """Get the part with a hull inside the limits and without nearly redundant corners; the same part if unchanged.

    Without such corners a hull is up to 1e-6 larger. They stay if the part would then no longer meet the criterion.
    For `sides` see `limit_hull`; if no hull in them meets the criterion, the criterion comes first.
    """
    limited = limited_part(part, limits, criterion.of_facets.outward_deviation, sides=sides)
    if limited is part:
        return part
    if (criterion if limited.exact is None else criterion.of_facets).is_met(limited):
        return limited
    if len(sides):
        return limit_part(part, limits, criterion)
    return part if keeps(part.hull, limits) and criterion.is_met(part) else limited


def limit_roughly(part: Part, limits: HullLimits) -> Part:
    """Get the part with a hull inside the limits, cheaply: if its hull exceeds them, a box or tetrahedron around it."""
    return part if keeps(part.hull, limits) else part.with_hull(plain_hull(part.hull.vertices, limits))


def kept_within(part: Part, sides: FloatArray, criterion: Criterion) -> Part:
    """Get the part with its hull cut back to the half-spaces: hulls made on a proxy may reach beyond them.

    The part stays as it is if nothing is beyond, or if it would no longer meet the criterion.
    """
    cut_back = _native.cut_back(part.hull.vertices, part.hull.faces, sides)
    if cut_back is None:
        return part
    clipped = part.with_hull(Hull(*cut_back))
    return clipped if criterion.is_met(clipped) or not criterion.is_met(part) else part


def take_in(parts: Sequence[Part], points: FloatArray, criterion: Criterion) -> list[Part]:
    """Grow the hull nearest to each point to take it in, unless the hull's part then breaks the criterion.

    Parameters
    ----------
    parts : sequence of Part
    points : float64 [N, 3]
        Of more than `DENSE`, every second, third, ... is looked at. A hull that holds a point is skipped: it will go.
    criterion : Criterion

    Returns
    -------
    list of Part
        In the same order, some with larger hulls.
    """
    points = points[:: 1 + len(points) // DENSE]
    distance = np.array([hull_union([part.hull], 1).distance(points, 1) for part in parts])
    taker = np.where(distance > 0, distance, np.inf).argmin(axis=0)
    grown = list(parts)
    for i in np.unique(taker):
        part = parts[i]
        hull = Hull.of(np.concatenate([part.hull.vertices, points[taker == i]]))
        larger = part.with_hull(hull) if hull is not None else part
        if criterion.is_met(larger) or not criterion.is_met(part):
            grown[i] = larger
    return grown


def plain_hull(points: FloatArray, limits: HullLimits) -> Hull:
    """Get a box around points [N, 3], or a tetrahedron if a box has too many vertices or triangles."""
    hull = Hull.of(_box_around(points) if limits.allow(vertices=8, faces=12) else _tetrahedron_around(points))
    assert hull is not None
    return hull


def _box_around(points: FloatArray) -> FloatArray:
    """Corners [8, 3] of a box around the points, padded on every side."""
    lower, upper = padded(points)
    return np.array(list(itertools.product(*zip(lower.min(axis=0), upper.max(axis=0), strict=True))))


def padded(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The points [N, 3] less, and plus, the resolution of their largest coordinate on every axis.

    One floating-point step along an axis may vanish next to a large coordinate on another axis.
    """
    limits = np.finfo(np.float64)
    step = float(np.abs(points).max() * limits.eps + limits.smallest_subnormal)
    return np.maximum(points, step - LARGEST) - step, np.minimum(points, LARGEST - step) + step


def _tetrahedron_around(points: FloatArray) -> FloatArray:
    """Corners [4, 3] of a tetrahedron around the points' box: one of the box, three on its extended edges."""
    box = _box_around(points)
    lower, upper = box[0], box[-1]
    to_lower = lower / 2 + upper / 2 > 0  # edges lead towards the origin, where coordinates do not overflow
    corner, edge = np.where(to_lower, upper, lower), np.where(to_lower, lower - upper, upper - lower)
    # 1/4 + 1/4 + 1/4 < 1: the far corner of the box stays inside in spite of rounding.
    return np.concatenate([corner[None], corner + np.diag(4 * edge)])
