"""From parts to hulls in the input's unit: clean the parts, carry them over, measure them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import trimesh

from rlacd import _native
from rlacd.find_parts import Reached
from rlacd.finish.limit import (
    LARGEST,
    SHARE_OF_OVERHANG,
    kept_within,
    limit_part,
    limit_roughly,
    plain_hull,
    resting_sides,
    simple_part,
    step_of,
    take_in,
    within_reach,
)
from rlacd.finish.overlap import Seams, overlap_parts
from rlacd.finish.primitives import primitive_part
from rlacd.finish.report import COVERAGE_TOLERANCE, NEARLY, make_report
from rlacd.merge import drop_slivers
from rlacd.options import SIMPLE
from rlacd.options.navigable import LARGEST_COORDINATE
from rlacd.options.presets import HullLimits
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part
from rlacd.solid.distance import PLACES, hull_union
from rlacd.solid.frame import GROWTH_TO_SPARE, ROUNDING, Frame
from rlacd.solid.hull import NO_LIMITS, NO_SIDES, TOLERANCE, Hull, keeps
from rlacd.solid.primitive import PRIMITIVE, Balls
from rlacd.solid.provenance import owners
from rlacd.solid.solid import Solid


class Finished(NamedTuple):
    """Hulls in the input's unit, with what was measured."""

    hulls: list[trimesh.Trimesh]
    report: dict[str, Any]
    balls: Balls | None = None


def misses_some(reached: Reached, run: Run) -> bool:
    """Whether a stop left parts that miss some of a small solid, as happens to one that crosses itself."""
    solid = reached.solid
    if run.stopped_by is None or not 0 < len(solid.faces) <= PLACES:
        return False
    with run.shielded():
        inner, _ = _native.sample_surface(solid.vertices, solid.faces, PLACES, 0)
        hulls = hull_union([part.hull for part in reached.parts], run.threads)
        away = hulls.distance(np.concatenate([solid.vertices, inner]), run.threads)
        return bool(away.max() > COVERAGE_TOLERANCE)


def finish(reached: Reached, run: Run) -> Finished:
    """Clean the parts, carry them to the input's unit, and measure them; again if hulls have to grow to the input."""
    done, parts = _finished(reached, run)
    under = done.report["hausdorff"]["under"]
    if under is None or not NEARLY < under <= COVERAGE_TOLERANCE or run.stopped_by is not None:
        return done
    with run.stage("finish"):
        grown = run.if_in_time(lambda: _taking_in(reached, parts, run), lambda: None)
    if grown is None:
        return done
    again, _ = _finished(reached._replace(parts=grown), run)
    return again if run.stopped_by is None else done


def _finished(reached: Reached, run: Run) -> tuple[Finished, list[Part]]:
    """The result, and the cleaned parts."""
    solid, goal = reached.solid, reached.goal
    with run.stage("finish"):
        limits = reached.options.hull_limits
        parts, seams = run.if_in_time(
            lambda: _cleaned(reached, run), lambda: ([limit_roughly(part, limits) for part in reached.parts], None)
        )
        with run.shielded():
            hulls = run.map(lambda part: in_input(part.hull, solid.frame, limits), parts)
            parts = [as_carried(part, hull, solid.frame) for part, hull in zip(parts, hulls, strict=True)]
    with run.stage("measure"):
        report = make_report(reached, parts, hulls, seams, run)
        unknown: list[int] | list[None] = [None] * len(hulls)
        bodies = run.if_in_time(lambda: _bodies(solid, hulls), lambda: unknown)
    for hull, body in zip(hulls, bodies, strict=True):
        hull.metadata["body"] = body
    balls = goal.obstacles.in_input(solid.frame) if goal.obstacles is not None else None
    return Finished(hulls, report, balls), parts


def _taking_in(reached: Reached, finished: Sequence[Part], run: Run) -> list[Part] | None:
    """The parts, with hulls grown to what of the input lies outside the finished ones; None if none can grow."""
    hulls = [part.hull for part in finished]
    points = np.concatenate(
        _native.Filling(*reached.solid.surface, run.threads).uncovered(
            [hull.vertices for hull in hulls],
            [hull.faces for hull in hulls],
            COVERAGE_TOLERANCE,
            GROWTH_TO_SPARE,
            run.threads,
        )
    )
    distance = hull_union(hulls, run.threads).distance(points, run.threads)
    missed = points[(distance > NEARLY / 2) & (distance <= COVERAGE_TOLERANCE)]
    grown = take_in(reached.parts, missed, reached.goal) if len(missed) else reached.parts
    return None if all(new is old for new, old in zip(grown, reached.parts, strict=True)) else grown


def _cleaned(reached: Reached, run: Run) -> tuple[list[Part], Seams | None]:
    """The parts without slivers, overlapping if asked for, as primitives or with simple hulls inside the limits."""
    options, goal, limits = reached.options, reached.goal, reached.options.hull_limits
    sides = NO_SIDES if reached.root is None else resting_sides(reached.root)
    slack = ROUNDING + 8 * reached.solid.frame.resolution

    def cleaned(part: Part) -> Part:
        part.tree = part.tree or _native.TreeCache()
        shaped = primitive_part(part, goal, options.primitive_kinds, limits, slack, reached.root)
        if shaped is not part:
            return shaped
        near = within_reach(sides, part.hull, SHARE_OF_OVERHANG * goal.overhang)
        part = kept_within(part, near, goal)
        return limit_part(
            simple_part(part, goal, limits, near) if options.detail == SIMPLE else part, limits, goal, near
        )

    parts, seams = drop_slivers(reached.parts, run), None
    if options.overlap > 0 and reached.root is not None:
        parts, seams = overlap_parts(parts, reached.root, goal, 2 * options.overlap)
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
    there = Hull.of(points)
    if there is None:
        there = _thickened(points, limits)
    metadata = {} if hull.primitive is None else {PRIMITIVE: hull.primitive.in_input(frame).as_plain()}
    return trimesh.Trimesh(there.vertices, there.faces, process=False, metadata=metadata)


def as_carried(part: Part, there: trimesh.Trimesh, frame: Frame) -> Part:
    """Get the part with the hull that `in_input` made of its own, in the frame: what has to be measured.

    The same part if no vertex moved by more than `TOLERANCE`, as always unless the coordinates resolve little.
    """
    points = frame.to_frame(there.vertices)
    if part.hull.primitive is not None or np.abs(points).max() > LARGEST_COORDINATE:
        return part
    if points.shape == part.hull.vertices.shape and np.abs(points - part.hull.vertices).max() <= TOLERANCE:
        return part
    if all(np.abs(part.hull.vertices - point).max(axis=1).min() <= TOLERANCE for point in points):
        return part
    hull = Hull.of(points)
    return part if hull is None else part.with_hull(hull)


def _thickened(points: FloatArray, limits: HullLimits) -> Hull:
    """A hull of flat points [N, 3] that has a volume and is within the limits."""
    step = step_of(points)
    lower, upper = np.maximum(points, step - LARGEST) - step, np.minimum(points, LARGEST - step) + step
    corners = itertools.product(*zip(lower.T, upper.T, strict=True))
    hull = Hull.of(np.concatenate([np.stack(corner, axis=1) for corner in corners]))
    return hull if hull is not None and keeps(hull, limits) else plain_hull(points, limits)
