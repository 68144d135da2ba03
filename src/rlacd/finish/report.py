"""The report of a decomposition: distances to the input's surface, and warnings about everything that falls short."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import trimesh

from rlacd import _native
from rlacd._version import __version__
from rlacd.criteria.avoided import FINEST_SHARE, warnings_of
from rlacd.find_parts import Reached
from rlacd.finish.narrowed import Narrowed, narrowed, too_narrow
from rlacd.finish.overlap import Seams
from rlacd.fit import RESOLVED, Fit, length_unit, told_apart
from rlacd.options import Options
from rlacd.options.names import PRIMITIVE_KINDS
from rlacd.options.presets import Preset, find_preset
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Part, concatenated
from rlacd.solid.distance import Place, hull_distances, hull_union
from rlacd.solid.frame import HALF_THICKNESS, Frame
from rlacd.solid.hull import Hull, is_sliver
from rlacd.solid.mass import Mass, joint_mass, mass_of
from rlacd.solid.solid import Solid

COVERAGE_TOLERANCE = 5 * HALF_THICKNESS
"""How far hulls may reach beyond the threshold before the report warns: slack for repair and measurement."""

NEARLY = RESOLVED
"""No point of the input should lie farther outside the hulls than this."""

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


def make_report(
    reached: Reached, parts: Sequence[Part], hulls: Sequence[trimesh.Trimesh], seams: Seams | None, run: Run
) -> dict[str, Any]:
    """Measure a finished decomposition; the keys are those of `rlacd.Decomposition` without name and seconds.

    Values that there was no time to measure are None.

    Parameters
    ----------
    reached : Reached
    parts : sequence of Part
        The cleaned parts.
    hulls : sequence of trimesh.Trimesh
        The hulls of the parts, in the input's unit.
    seams : Seams or None
        The seams, if hulls were to overlap.
    """
    solid, options, criterion = reached.solid, reached.options, reached.goal
    is_cover = len(solid.faces) == 0  # hulls of an input that was not repaired: the parts in them are unknown
    errors = None if is_cover else run.if_in_time(lambda: run.map(criterion.error, parts), lambda: None)
    summary = criterion.summary(errors)
    has_surface = len(solid.surface[1]) > 0  # a cloud of points has none
    distances = run.if_in_time(lambda: _distances(reached, parts, run), lambda: None) if has_surface else None
    with run.shielded():  # nothing below takes long
        weighed = [(part.hull.vertices, part.hull.faces) for part in parts] if is_cover else solid.weighed
        entered = criterion.avoided and criterion.avoided.found(parts, solid.frame.scale)
        missed = _shortcomings([part.hull for part in parts], distances, reached, len(summary.warnings) > 0)
        warnings = [*solid.warnings, *_coarse(solid), *_early_end(run)]
        warnings += _unmeasured(solid) if has_surface and distances is None else []
        warnings += _shallow(seams, 2 * options.overlap / solid.frame.scale) if options.overlap > 0 else []
        warnings += [*_stuck_out(parts, reached), *summary.warnings, *missed]
        warnings += too_narrow(distances.narrowed, reached, run.stopped_by is not None) if distances else []
        warnings += warnings_of(entered, _why_entered(run)) if entered else []
        if criterion.obstacles is not None and not is_cover:
            warnings += _out_of_the_box([part.hull for part in parts], solid)
        return {
            "version": __version__,
            "options": options.as_plain(),
            "complete": run.stopped_by is None,
            "stopped_by": run.stopped_by,
            "parts": len(hulls),
            **{name: sum(len(getattr(hull, name)) for hull in hulls) for name in ("faces", "vertices")},
            **({"primitives": _primitives(parts)} if options.primitives else {}),
            **({"overlap": _seams(seams, solid.frame)} if options.overlap > 0 else {}),
            **summary.entries,
            **({"avoid": entered} if entered else {}),
            "hausdorff": _hausdorff(distances),
            "passages": distances and distances.narrowed.passages,
            "scale": solid.frame.scale,
            "mass": mass_of(*concatenated(weighed), solid.frame).as_plain(),
            "repair": [{**vars(body)} for body in solid.bodies],
            "holes": _holes(solid),
            "search": reached.found and reached.found.as_plain(),
            "at_least": reached.found and min(reached.found.at_least, len(hulls)),
            "warnings": warnings,
        }


def _hausdorff(distances: _Distances | None) -> dict[str, float | None]:
    under = distances and max(distances.under, distances.left_out.distance)
    return {"over": distances and distances.over, "under": under}


def _why_entered(run: Run) -> str:
    """Why finer cuts did not help."""
    if run.stopped_by is not None:
        return "the work was stopped before"
    return f"parts within {FINEST_SHARE:.0%} of the threshold, and those that limits leave no way, are cut no further"


def _holes(solid: Solid) -> list[dict[str, Any]]:
    return [
        {
            "body": hole.body,
            "at_abs": solid.frame.to_input(hole.at).tolist(),
            "width_abs": hole.width / solid.frame.scale,
            "closed": hole.is_closed,
        }
        for hole in solid.holes[:MOST_HOLES]
    ]


def _primitives(parts: Sequence[Part]) -> dict[str, int]:
    """How many parts are of each kind; those that stayed hulls last."""
    kinds = [None if part.hull.primitive is None else part.hull.primitive.kind for part in parts]
    return {kind: kinds.count(kind) for kind in PRIMITIVE_KINDS} | {"hull": kinds.count(None)}


def _seams(seams: Seams | None, frame: Frame) -> dict[str, Any]:
    """How many seams were found, how many of them are short of the overlap, and where; None if there was no time."""
    if seams is None:
        return {"seams": None, "short": None, "short_seams": None}
    places = [
        {
            "parts": list(seam.parts),
            "at_abs": frame.to_input(seam.place[None])[0].tolist(),
            "depth_abs": seam.depth / frame.scale,
        }
        for seam in seams.short
    ]
    return {"seams": seams.count, "short": len(places), "short_seams": places}


def _shallow(seams: Seams | None, overlap_abs: float) -> list[str]:
    if seams is None:
        return ["There was no time to make hulls overlap."]
    if not seams.short:
        return []
    return [
        f"{len(seams.short)} of {seams.count} seams between hulls overlap by less than {overlap_abs:.4g}: more would "
        "break the criterion. A smaller overlap or a larger threshold helps."
    ]


def joint_report(reports: Sequence[tuple[str, dict[str, Any]]], scale: float) -> dict[str, Any]:
    """Join the reports of a scene's nodes, which were decomposed separately.

    Parameters
    ----------
    reports : sequence of (str, dict)
        Each node's name and report.
    scale : float
        Frame units of the scene per unit of the input; joint lengths are in that frame.
    """
    each = [(name, report, scale / report["scale"]) for name, report in reports]
    first, counted = reports[0][1], ("parts", "faces", "vertices")
    bodies = accumulate((len(report["repair"]) for _, report in reports), initial=0)
    begins = list(zip(each, bodies, strict=False))
    stopped = next((report for _, report in reports if not report["complete"]), first)
    return {
        "version": first["version"],
        "options": dict(first["options"]),
        **{what: stopped[what] for what in ("complete", "stopped_by")},
        **({"primitives": _added([r["primitives"] for _, r in reports])} if "primitives" in first else {}),
        **({"overlap": _joint_seams([r for _, r in reports])} if "overlap" in first else {}),
        **{what: sum(report[what] for _, report in reports) for what in counted},
        **_joint_fit(each),
        **({"avoid": _joint_avoid([r["avoid"] for _, r in reports])} if "avoid" in first else {}),
        "hausdorff": {side: _farthest([(r["hausdorff"][side], f) for _, r, f in each]) for side in ("over", "under")},
        "scale": scale,
        "mass": joint_mass([Mass.of_plain(report["mass"]) for _, report in reports]).as_plain(),
        "repair": [
            {**body, "body": begin + i, "deviation": body["deviation"] * factor, "node": name}
            for (name, report, factor), begin in begins
            for i, body in enumerate(report["repair"])
        ],
        "holes": [
            {**hole, "body": begin + hole["body"], "node": name}
            for (name, report, _), begin in begins
            for hole in report["holes"]
        ],
        "passages": [{**passage, "node": name} for name, report in reports for passage in report["passages"] or ()],
        "nodes": [{"node": name, "parts": report["parts"], "scale": report["scale"]} for name, report in reports],
        "search": None,
        "at_least": _sum_known([report["at_least"] for _, report in reports]),
        "warnings": [f"{name}: {warning}" for name, report in reports for warning in report["warnings"]],
    }


def _sum_known(counts: Sequence[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None


def _joint_fit(each: Sequence[tuple[str, dict[str, Any], float]]) -> dict[str, Any]:
    """The criterion's entry for the parts of all nodes; lengths grow by each node's factor."""
    fits = [(Fit.of(report), factor) for _, report, factor in each]
    errors: list[float] | None = []
    for fit, factor in fits:
        assert fit is not None
        known = None if errors is None or fit.per_part is None else fit.per_part
        errors = None if known is None or errors is None else [*errors, *(e * fit.unit(factor) for e in known)]
    first = fits[0][0]
    assert first is not None
    found = {"per_part": errors, "max": None if errors is None else max(errors)}
    if first.is_length:
        found["threshold"] = max(
            fit.limit * factor for fit, factor in fits if fit is not None and fit.limit is not None
        )
    return {first.key: each[0][1][first.key] | found}


def _farthest(lengths: Sequence[tuple[float | None, float]]) -> float | None:
    """The greatest of lengths, each times its factor; None if one is unknown."""
    known = [length * factor for length, factor in lengths if length is not None]
    return max(known) if len(known) == len(lengths) else None


def _joint_seams(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Join the seams of all nodes, with parts numbered through."""
    seams = [report["overlap"] for report in reports]
    if any(one["seams"] is None for one in seams):
        return dict.fromkeys(seams[0])
    firsts = accumulate((report["parts"] for report in reports), initial=0)
    places = [
        {**place, "parts": [first + part for part in place["parts"]]}
        for first, one in zip(firsts, seams, strict=False)
        for place in one["short_seams"]
    ]
    return {"seams": sum(one["seams"] for one in seams), "short": len(places), "short_seams": places}


def _joint_avoid(each: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Join what hulls of all nodes enter: a mesh entered by several nodes is listed for each."""
    crossed = dict.fromkeys(name for one in each for name in one["crossed"])
    return {"crossed": [*crossed], "entered": [entry for one in each for entry in one["entered"]]}


def _added(counts: Sequence[dict[str, int]]) -> dict[str, int]:
    return {kind: sum(count[kind] for count in counts) for kind in counts[0]}


def _distances(reached: Reached, parts: Sequence[Part], run: Run) -> _Distances:
    solid, root = reached.solid, reached.root
    surface = root.filling.surface if root is not None and solid.is_as_given else solid.index
    surface = surface or _native.Surface(*solid.surface, run.threads)
    hulls = [part.hull for part in parts]
    found = hull_distances(hulls, *solid.surface, threads=run.threads, surface=surface)

    def place(point: Place) -> str:
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
            f"Faces that are only a point or an edge were left out: {corners} up to {farthest:.4g} outside the hulls "
            f"(longest side = 2), farthest near {frame.place(points[distance.argmax()])}."
        ],
    )


def _stuck_out(parts: Sequence[Part], reached: Reached) -> list[str]:
    """How far hulls stick out because of limits on their vertices and triangles, where that is too far."""
    facets, limits, scale = reached.goal.of_facets, reached.options.hull_limits, reached.solid.frame.scale
    if not math.isfinite(facets.outward_deviation):
        return []
    beyond = [error for part in parts if part.exact and (error := facets.error(part)) > facets.outward_deviation]
    if not beyond:
        return []
    counts = zip(limits, ("vertices", "triangles"), strict=True)
    most = " and ".join(f"{limit} {what}" for limit, what in counts if limit is not None)
    farthest, allowed = told_apart(max(beyond) / scale, facets.outward_deviation / scale)
    return [
        f"{_hulls(len(beyond), 'sticks', 'stick')} out by up to {farthest}, more than {allowed} (in the input's unit): "
        f"with at most {most} they cannot fit closer unless there are many more."
    ]


def _unmeasured(solid: Solid) -> list[str]:
    sentences = ["There was no time to measure how far hulls and input are apart."]
    moved = max((body.deviation for body in solid.bodies), default=0.0)
    if moved > COVERAGE_TOLERANCE:
        sentences.append(f"Some of the input's surface may lie {moved:.4g} from the hulls: repair moved it that far.")
    return sentences


def _coarse(solid: Solid) -> list[str]:
    if solid.frame.resolution <= COVERAGE_TOLERANCE / 2:
        return []
    return [
        f"So far from the origin, coordinates cannot resolve lengths below {solid.frame.resolution:.2g} (the longest "
        "side is 2), so hulls thinner than that are made thicker: move the mesh to the origin."
    ]


def _out_of_the_box(hulls: Sequence[Hull], solid: Solid) -> list[str]:
    """Warn of limits that no tight hull can meet: the criterion cannot see it, as there are no balls so far out."""
    lower, upper = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    beyond = max(float(max((lower - hull.box[0]).max(), (hull.box[1] - upper).max())) for hull in hulls)
    if beyond <= COVERAGE_TOLERANCE:
        return []
    return [
        f"The hulls extend up to {beyond:.4g} outside the solid's bounding box, where a ball may go: the limits on "
        "vertices or faces allow no tighter ones."
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
    options, scale = reached.options, reached.solid.frame.scale
    unit, in_words = length_unit({"options": vars(options), "scale": scale})
    sentences = [] if options.preset is None else engine_shortcomings(find_preset(options.preset), hulls)
    if options.max_hulls is not None and len(hulls) > options.max_hulls:
        sentences.append(f"{len(hulls)} hulls are left, more than the {options.max_hulls} asked for.")
    if options.quality == "best" and reached.found is None and options.max_hulls is not None and exceeds:
        sentences.append(f"Nothing was searched: only uniting parts leads to as few hulls as {options.max_hulls}.")
    if distances is not None and distances.under > COVERAGE_TOLERANCE:
        sentences.append(
            f"Some of the input's surface lies up to {distances.under / unit:.4g} ({in_words}) outside the hulls, "
            f"farthest near {distances.under_at}: repair dropped what it could not make solid (see `deviation` in "
            "`repair`)."
        )
    sentences += distances.left_out.said if distances is not None else []
    if distances is not None and not exceeds and distances.over > reached.goal.outward_deviation + COVERAGE_TOLERANCE:
        sentences.append(
            f"The hulls reach {distances.over / unit:.4g} ({in_words}) beyond the input's surface, more than the "
            f"threshold, farthest near {distances.over_at}: {_why_beyond(reached.solid, options)}."
        )
    return sentences


def _why_beyond(solid: Solid, options: Options) -> str:
    """Name the repairs that move hulls away from the surface, and the options that avoid them."""
    filled = any(body.step in ("capped", "wrapped") for body in solid.bodies)
    if filled and options.open != "thin":
        return "repair closed openings (see `repair`), which --open thin leaves open"
    return "repair moved the surface there (see `repair`)"


def engine_shortcomings(engine: Preset, hulls: Sequence[Hull]) -> list[str]:
    """One sentence for each limit of an engine that hulls exceed."""
    sentences = []
    for what, limit, counts in (
        ("vertices", engine.max_vertices, [len(hull.vertices) for hull in hulls]),
        ("triangles", engine.max_faces, [len(hull.faces) for hull in hulls]),
    ):
        over = [count for count in counts if limit is not None and count > limit]
        if over:
            sentences.append(
                f"{_hulls(len(over), 'has', 'have')} up to {max(over)} {what}, more than {limit}, the limit for "
                f"{engine.engine}."
            )
    thin = 0 if engine.slivers else sum(is_sliver(hull, 1 / 200) for hull in hulls)  # a ball is two radii thick
    if thin:
        sentences.append(
            f"{_hulls(thin, 'is', 'are')} thinner than 1/100 of the largest extent, which {engine.engine} refuses or "
            "handles on the CPU: thicken the mesh there."
        )
    return sentences


def _hulls(count: int, one: str, many: str) -> str:
    return f"1 hull {one}" if count == 1 else f"{count} hulls {many}"
