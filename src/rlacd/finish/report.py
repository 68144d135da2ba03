"""The report of a decomposition: distances to the input's surface, and warnings about everything that falls short."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh

from rlacd import _native
from rlacd.find_parts import Reached
from rlacd.finish.narrowed import Narrowed, narrowed, too_narrow
from rlacd.options import Options
from rlacd.options.names import PRIMITIVE_KINDS
from rlacd.options.presets import find_preset
from rlacd.report import (
    COVERAGE_TOLERANCE,
    Hausdorff,
    Overlap,
    Point,
    Report,
    sizes_of,
)
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part, concatenated
from rlacd.solid.distance import hull_distances, hull_union
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull
from rlacd.solid.mass import mass_of
from rlacd.solid.solid import Solid

MOST_HOLES = 1000
"""Most holes that a report lists."""


class Missed(NamedTuple):
    """Points outside the hulls: the farthest distance, and a sentence if it is worth one."""

    distance: float
    said: list[str]


class _Distances(NamedTuple):
    """How far hulls reach beyond the input and fall short of it, and where most; narrowed passages; input left out."""

    over: float
    under: float
    over_at: str
    under_at: str
    narrowed: Narrowed
    left_out: Missed

    @property
    def hausdorff(self) -> Hausdorff:
        """What the report says of it."""
        return Hausdorff(self.over, max(self.under, self.left_out.distance))


def make_report(
    reached: Reached, parts: Sequence[Part], hulls: Sequence[trimesh.Trimesh], seams: Overlap | None, run: Run
) -> Report:
    """Measure a finished decomposition; of the input as a whole, such as its name, it says nothing.

    Values that there was no time to measure are None.

    Parameters
    ----------
    reached : Reached
    parts : sequence of Part
        The cleaned parts.
    hulls : sequence of trimesh.Trimesh
        The hulls of the parts, in the input's unit.
    seams : Overlap or None
        The seams, if hulls were to overlap.
    """
    solid, options, criterion = reached.solid, reached.options, reached.goal
    is_cover = len(solid.faces) == 0  # hulls of an input that was not repaired: what they stand for is unknown
    errors = None if is_cover else run.if_in_time(lambda: run.map(criterion.error, parts), lambda: None)
    summary = criterion.summary(errors)
    has_surface = len(solid.surface[1]) > 0  # a cloud of points has none
    distances = run.if_in_time(lambda: _distances(reached, parts, run), lambda: None) if has_surface else None
    with run.shielded():  # nothing below takes long
        weighed = [(part.hull.vertices, part.hull.faces) for part in parts] if is_cover else solid.weighed
        avoided = criterion.avoided
        entered = None if avoided is None else avoided.found(parts, solid.frame.scale)
        warnings = _warned(reached, parts, seams, distances, summary.warnings, run)
        if avoided and entered:
            warnings += avoided.warnings_of(entered, solid.frame.told_in, is_stopped=run.stopped_by is not None)
        return Report(
            options=options.as_plain(),
            complete=run.stopped_by is None,
            stopped_by=run.stopped_by,
            **sizes_of(hulls),
            primitives=_primitives(parts) if options.primitives else None,
            overlap=None if options.overlap == 0 else seams or Overlap(),
            **summary.entries,
            avoid=entered,
            hausdorff=distances.hausdorff if distances else Hausdorff(),
            passages=distances and distances.narrowed.passages,
            scale=solid.frame.scale,
            mass=mass_of(*concatenated(weighed), solid.frame),
            repair=solid.bodies,
            holes=solid.holes[:MOST_HOLES],
            search=reached.found,
            lower_bound=None if reached.found is None else min(reached.found.lower_bound, len(hulls)),
            warnings=tuple(warnings),
            unit=solid.frame.told_in,
        )


def _warned(
    reached: Reached,
    parts: Sequence[Part],
    seams: Overlap | None,
    distances: _Distances | None,
    by_criterion: Sequence[str],
    run: Run,
) -> list[str]:
    """One sentence for each thing that the user should know."""
    solid, options, hulls = reached.solid, reached.options, [part.hull for part in parts]
    warnings = [*solid.warnings, *_coarse(solid), *_early_end(run)]
    warnings += _unmeasured(solid) if len(solid.surface[1]) > 0 and distances is None else []
    warnings += _shallow(seams, solid.frame.unit.words(options.overlap)) if options.overlap > 0 else []
    if any(options.hull_limits):
        from rlacd.extras.finish.limits import stuck_out

        warnings += stuck_out(parts, reached)
    warnings += [*by_criterion, *_shortcomings(hulls, distances, reached, len(by_criterion) > 0)]
    warnings += too_narrow(distances.narrowed, reached, run.stopped_by is not None) if distances else []
    if reached.goal.obstacles is not None and len(solid.faces) > 0:
        from rlacd.extras.finish.limits import out_of_the_box

        warnings += out_of_the_box(hulls, solid)
    return warnings


def _primitives(parts: Sequence[Part]) -> dict[str, int]:
    """How many parts are of each kind; those that stayed hulls last."""
    kinds = [None if part.hull.primitive is None else part.hull.primitive.kind for part in parts]
    return {kind: kinds.count(kind) for kind in PRIMITIVE_KINDS} | {"hull": kinds.count(None)}


def _shallow(seams: Overlap | None, overlap: str) -> list[str]:
    """What to warn of seams; `overlap` is the one asked for, in words."""
    if seams is None:
        return ["There was no time to make hulls overlap."]
    if not seams.short:
        return []
    return [
        f"{seams.short} of {seams.seams} seams between hulls overlap by less than {overlap}: more would break "
        "the criterion. A smaller overlap or a larger threshold helps."
    ]


def _distances(reached: Reached, parts: Sequence[Part], run: Run) -> _Distances:
    solid, root = reached.solid, reached.root
    surface = root.against.surface if root is not None and solid.is_as_given else solid.index
    surface = surface or _native.Surface(*solid.surface, run.threads)
    hulls = [part.hull for part in parts]
    found = hull_distances(hulls, *solid.surface, threads=run.threads, surface=surface)

    def place(point: Point) -> str:
        if solid.body_of is None or len(solid.bodies) == 1:
            return solid.frame.place(point)
        _, (face,) = surface.closest(np.array([point]))
        return solid.frame.place(point, int(solid.body_of[face]))

    less_open = narrowed(reached, hulls, found.over[1], run)
    left_out = missed(solid.left_out, hulls, solid.frame, run)
    return _Distances(found.over[1], found.under[1], place(found.over_at), place(found.under_at), less_open, left_out)


def missed(points: FloatArray, hulls: Sequence[Hull], frame: Frame, run: Run) -> Missed:
    """How far outside the hulls points ``[N, 3]`` lie that belong only to faces without an area."""
    if len(points) == 0:
        return Missed(0.0, [])
    distance = hull_union(hulls, run.threads).distance(np.ascontiguousarray(points), run.threads)
    out, farthest = int((distance > COVERAGE_TOLERANCE).sum()), float(distance.max())
    if out == 0:
        return Missed(farthest, [])
    corners = "1 corner lies" if out == 1 else f"{out} corners lie"
    return Missed(
        farthest,
        [
            f"Faces that are only a point or an edge were left out: {corners} up to {frame.unit.words(farthest)} "
            f"outside the hulls, farthest near {frame.place(points[distance.argmax()])}."
        ],
    )


def _unmeasured(solid: Solid) -> list[str]:
    sentences = ["There was no time to measure how far hulls and input are apart."]
    moved = max((body.deviation for body in solid.bodies), default=0.0)
    if moved > COVERAGE_TOLERANCE:
        far = solid.frame.unit.words(moved)
        sentences.append(f"Some of the input's surface may lie {far} from the hulls: repair moved it that far.")
    return sentences


def _coarse(solid: Solid) -> list[str]:
    if solid.frame.resolution <= COVERAGE_TOLERANCE / 2:
        return []
    finest = solid.frame.unit.words(solid.frame.resolution)
    return [
        f"So far from the origin, coordinates cannot resolve lengths below {finest}, so hulls thinner "
        "than that are made thicker: move the mesh to the origin."
    ]


def _early_end(run: Run) -> list[str]:
    """Why the work ended early, and what stopped at its bound of work."""
    said = {
        "cut": "There were so many components that cutting stopped at its bound of work: the hulls cover the solid "
        "but are coarser than asked for.",
        "merge": "There were so many parts that merging stopped at its bound of work: all hulls are valid, but fewer "
        "may suffice. A larger threshold leaves less to merge.",
    }
    sentences = [sentence for stage, sentence in said.items() if stage in run.cut_short]
    if run.stopped_by is None:
        return sentences
    reason = {"timeout": "the timeout ended", "cancel": "the caller ended"}[run.stopped_by]
    if run.stopped_in == "search":
        return [f"{reason.capitalize()} the search for fewer hulls early; those found so far are valid.", *sentences]
    return [
        f"Incomplete: {reason} the work early; the hulls cover the solid but are coarser than asked for.",
        *sentences,
    ]


def _shortcomings(hulls: Sequence[Hull], distances: _Distances | None, reached: Reached, exceeds: bool) -> list[str]:
    """Say what hulls miss, and how far they reach out unless the criterion has reported that (`exceeds`)."""
    options, unit = reached.options, reached.solid.frame.unit
    sentences: list[str] = []
    if options.preset is not None:
        from rlacd.extras.finish.limits import engine_shortcomings

        sentences += engine_shortcomings(find_preset(options.preset), hulls)
    if options.max_hulls is not None and len(hulls) > options.max_hulls:
        sentences.append(f"{len(hulls)} hulls are left, more than the {options.max_hulls} asked for.")
    if options.quality == "best" and reached.found is None and options.max_hulls is not None and exceeds:
        sentences.append(f"Nothing was searched: only uniting parts leads to as few hulls as {options.max_hulls}.")
    if distances is not None and distances.under > COVERAGE_TOLERANCE:
        sentences.append(
            f"Some of the input's surface lies up to {unit.words(distances.under)} outside the hulls, "
            f"farthest near {distances.under_at}: repair dropped what it could not make solid (see `deviation` in "
            "`repair`)."
        )
    sentences += distances.left_out.said if distances is not None else []
    if distances is not None and not exceeds and distances.over > reached.goal.outward_deviation + COVERAGE_TOLERANCE:
        sentences.append(
            f"The hulls reach {unit.words(distances.over)} beyond the input's surface, more than the "
            f"threshold, farthest near {distances.over_at}: {_why_beyond(reached.solid, options)}."
        )
    return sentences


def _why_beyond(solid: Solid, options: Options) -> str:
    """Name the repairs that move hulls away from the surface, and the options that avoid them."""
    filled = any(body.step in ("capped", "wrapped") for body in solid.bodies)
    if filled and options.openings != "thin":
        return "repair closed openings (see `repair`), which --openings thin leaves open"
    return "repair moved the surface there (see `repair`)"
