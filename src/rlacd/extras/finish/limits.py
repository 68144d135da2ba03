"""What hulls lack because of limits on them, and what they have beyond those of an engine."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rlacd.find_parts import Reached
from rlacd.options.presets import Preset
from rlacd.report import COVERAGE_TOLERANCE
from rlacd.solid.component import Part
from rlacd.solid.hull import Hull, is_sliver
from rlacd.solid.solid import Solid


def stuck_out(parts: Sequence[Part], reached: Reached) -> list[str]:
    """How far hulls stick out because of limits on their vertices and triangles, where without them they would not."""
    facets, limits, unit = reached.goal.of_facets, reached.options.hull_limits, reached.solid.frame.unit
    if not math.isfinite(facets.outward_deviation):
        return []
    tight = [part for part in parts if part.exact and facets.is_met(part.with_hull(part.exact))]
    beyond = [error for part in tight if (error := facets.error(part)) > facets.outward_deviation]
    if not beyond:
        return []
    counts = zip(limits, ("vertices", "triangles"), strict=True)
    most = " and ".join(f"{limit} {what}" for limit, what in counts if limit is not None)
    farthest, allowed = unit.apart(max(beyond), facets.outward_deviation)
    return [
        f"{_hulls(len(beyond), 'sticks', 'stick')} out by up to {farthest}, more than {allowed}: "
        f"with at most {most} they cannot fit closer unless there are many more."
    ]


def out_of_the_box(hulls: Sequence[Hull], solid: Solid) -> list[str]:
    """Warn of limits that no tight hull can meet: the criterion cannot see it, as there are no balls so far out."""
    lower, upper = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    beyond = max(float(max((lower - hull.box[0]).max(), (hull.box[1] - upper).max())) for hull in hulls)
    if beyond <= COVERAGE_TOLERANCE:
        return []
    out = solid.frame.unit.words(beyond)
    return [
        f"The hulls extend up to {out} outside the solid's bounding box, where a ball may go: the limits on "
        "vertices or faces allow no tighter ones."
    ]


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
