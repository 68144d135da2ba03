"""Slivers: thin hulls shaved off by cuts, dropped if the other hulls stand in for them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rlacd import _native
from rlacd.solid.component import Part
from rlacd.solid.distance import hull_union
from rlacd.solid.hull import Hull
from rlacd.workers import Workers

THIN = 0.01
"""A hull is a sliver if the radius of its inscribed ball is below this share of its largest extent."""

FILM = 2e-4
"""Mean thickness below which a part is a film left by rounding: repair makes real sheets ten times thicker."""

MISSED = 2e-3
"""A sliver is dropped if none of its points is farther than this from the other hulls (0.1 % of the longest side)."""


def drop_slivers(parts: Sequence[Part], workers: Workers, suspects: Sequence[Part] | None = None) -> list[Part]:
    """Drop slivers and films that the other hulls stand in for; all others stay, such as those of thin solids.

    Parameters
    ----------
    parts : sequence of Part
        Parts with disjoint interiors.
    suspects : sequence of Part, optional
        The parts that may be dropped; all by default.

    Returns
    -------
    list of Part
        The remaining parts in the same order.
    """
    kept = list(parts)
    suspects = kept if suspects is None else suspects
    thin = workers.map(lambda part: is_film(part) or is_sliver(part.hull), suspects)
    for sliver in sorted(
        (p for p, is_thin in zip(suspects, thin, strict=True) if is_thin), key=lambda p: p.hull.volume
    ):
        others = [part for part in kept if part is not sliver and _near(part, sliver)]
        if others:
            union = hull_union([part.hull for part in others], workers.threads)
            _, missed = union.under(sliver.vertices, sliver.faces, MISSED / 4, workers.threads)
            if missed <= MISSED:
                kept.remove(sliver)
    return kept


def is_film(part: Part) -> bool:
    """Whether the part's mean thickness, twice its volume over its area, is below `FILM`."""
    return 2 * part.volume < FILM * _native.mesh_area(part.vertices, part.faces)


def is_sliver(hull: Hull) -> bool:
    """Whether the radius of the hull's inscribed ball is less than `THIN` times its largest extent."""
    extent = float(np.ptp(hull.vertices, axis=0).max())
    # A convex body's inradius lies between volume / area and three times that.
    ratio = hull.volume / _native.mesh_area(hull.vertices, hull.faces)
    if ratio > THIN * extent:
        return False
    return 3 * ratio < THIN * extent or not _native.holds_ball(hull.vertices, hull.faces, THIN * extent)


def _near(part: Part, sliver: Part) -> bool:
    gap = np.maximum(part.box[0] - sliver.box[1], sliver.box[0] - part.box[1])
    return bool((gap <= MISSED).all())
