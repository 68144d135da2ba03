"""Growing: hulls grow through the solid, and few of them are chosen that cover it.

Where bodies cross, cuts chop them, and merging, which unites two parts at a time, seldom finds a body again. A piece
that kept some sides of its body grows back to it at once (`native/solid/grow.cpp`). Bodies are taken to cross if many
merged parts share material with others; other solids pay nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rlacd import _native
from rlacd.criteria.criterion import Criterion
from rlacd.merge.unite import joint_part, merge_parts
from rlacd.run import Run, work
from rlacd.solid.arrays import BoolArray, FloatArray, heights
from rlacd.solid.component import DENSE, Component, Part, Plane, is_thin
from rlacd.solid.distance import hull_union
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.hull import TOLERANCE, is_sliver

CROSSING, SHARED = 0.4, 1.05
"""Bodies cross where in at least this share of the hulls the solid fills so many times the volume of their pieces: on
six planted solids in 0.40 to 0.67 of them, on 30 of `test/` in at most 0.43 but for one."""

DEPTH = 0.4
"""How deep the solid's surface may come into a grown hull, as a share of the criterion's outward deviation: at 0.1, the
planted solids of research/search.md take 3% more parts."""

LEAST = 0.5
"""A hull is taken only if it grew by at least this share of the volume of its piece: merging does the rest better. With
0, the planted solids take 4% more parts."""

WORTH = 0.85
"""Keep grown parts only if they number at most this share of the merged ones: later stages save more of parts that were
cut less. Of the 56 merged parts of a pot's proxy, 41 are left on the solid; of 55 grown ones, 47."""


SLIVER_LOSS = 2 * HALF_THICKNESS
"""A sliver is dropped if none of its points is farther than this from the other hulls (0.1% of the longest side)."""


def grow_cover(merged: list[Part], criterion: Criterion, run: Run) -> list[Part]:
    """Cover a solid in which bodies cross by parts grown from its pieces, if that takes fewer.

    Parameters
    ----------
    merged : list of Part
        Parts that meet the criterion; their members are the pieces.
    criterion : Criterion
        If it does not bound how far hulls may reach beyond the solid, none can grow.
    run : Run
        The merged parts are returned when its work runs out.
    """
    if not math.isfinite(criterion.outward_deviation) or merged[0].whole.size > DENSE:
        return merged
    if sum(map(_shares, merged)) < CROSSING * len(merged):
        return merged
    pieces = [member for part in merged for member in part.members]
    return grown_parts(pieces, WORTH * len(merged), criterion, run) or merged


def _shares(part: Part) -> bool:
    """Whether a union's hull holds much of other parts."""
    return len(part.members) > 1 and part.filled > SHARED * part.volume


def grown_parts(pieces: Sequence[Component], most: float, criterion: Criterion, run: Run) -> list[Part]:
    """Cover a solid by parts grown from its pieces, which meet the criterion, and merged.

    Empty if that takes more than so many parts, or more work or time than there is.
    """
    parts, whole = list[Part](), pieces[0].whole
    depth = DEPTH * criterion.outward_deviation
    with run.until_stopped():
        if not run.work.pay(sum(work.uniting(len(piece.hull.vertices)) for piece in pieces)):
            return []
        grown = run.map(lambda piece: whole.against.grown(piece.hull.body, depth), pieces)
        chosen = _chosen(pieces, grown)
        if len(chosen) > most:  # samples show it
            return []
        parts = drop_slivers(_taken(pieces, [grown[i] for i in chosen], criterion, run), run)
        parts = drop_slivers(merge_parts(parts, criterion, run), run) if parts else []
    return [] if run.is_over or len(parts) > most else parts


def _chosen(pieces: Sequence[Component], grown: Sequence[FloatArray]) -> list[int]:
    """Numbers of intersections of half-spaces that cover most of the pieces, the one that holds the most first."""
    points = [(piece.hull.vertices + piece.hull.vertices.mean(axis=0)) / 2 for piece in pieces]
    volumes = np.repeat(
        [piece.volume / len(some) for some, piece in zip(points, pieces, strict=True)], [*map(len, points)]
    )
    held = [_held(np.concatenate(points), spaces) for spaces in grown]
    gains = np.array([volumes[own].sum() for own in held])
    chosen = list[int]()
    while gains.max() > 0:
        best = int(gains.argmax())
        if gains[best] >= LEAST * pieces[best].volume:
            chosen.append(best)
            volumes[held[best]] = 0
            gains = np.array([volumes[own].sum() if old > 0 else 0.0 for own, old in zip(held, gains, strict=True)])
        gains[best] = 0
    return chosen


def _held(points: FloatArray, spaces: FloatArray) -> NDArray[np.intp]:
    """Numbers of the points [N, 3] in all half-spaces [P, 4]; few of them are left after the first planes."""
    held = np.arange(len(points))
    for space in spaces:
        held = held[_heights(points[held], space[None])[:, 0] <= TOLERANCE]
    return held


def _taken(pieces: Sequence[Component], grown: Sequence[FloatArray], criterion: Criterion, run: Run) -> list[Part]:
    """Parts of what each intersection of half-spaces holds, if they meet the criterion, and parts of the rest.

    Empty if most do not, or if the rest comes apart.
    """
    rest, parts = list(pieces), list[Part]()
    for tried, spaces in enumerate(grown):
        if tried > 2 * (len(parts) + 1):  # grown hulls are mostly empty space
            return []
        inside, outside, units = _divided(rest, spaces)
        if not run.may_continue() or not run.work.pay(units):
            break
        part = joint_part(criterion, run.work, *inside) if inside else None
        if part is not None:
            parts.append(part)
            rest = outside
        if len(rest) > 2 * len(pieces):  # what is beside grown hulls comes apart
            return []
    return [*parts, *rest]


def _heights(points: FloatArray, spaces: FloatArray) -> FloatArray:
    """Heights of points [N, 3] over the planes of half-spaces [P, 4]."""
    return heights(points, spaces[:, :3]) - spaces[:, 3]


def _divided(components: Sequence[Component], spaces: FloatArray) -> tuple[list[Component], list[Component], float]:
    """Components cut by half-spaces: what lies in all of them, the rest, and the work of cutting."""
    inside: list[Component] = []
    outside: list[Component] = []
    units = 0.0
    for component in components:
        beyond = _heights(component.hull.vertices, spaces)
        most = beyond.max(axis=0)
        if beyond.min(axis=0).max() >= -TOLERANCE:
            outside.append(component)
            continue
        left, cut_off = component, list[Component]()
        for *normal, offset in spaces[np.argsort(-most, kind="stable")][: np.count_nonzero(most > TOLERANCE)].tolist():
            units += work.cutting(left.size)
            below, above = left.cut(Plane((normal[0], normal[1], normal[2]), offset))
            if below is None:
                outside.append(component)
                break
            left = below
            cut_off += [above] if above is not None else []
        else:
            inside.append(left)
            outside += cut_off
    return inside, outside, units


def drop_slivers(parts: list[Part], run: Run) -> list[Part]:
    """Drop slivers, which growing leaves beside grown hulls, where the other hulls cover them."""
    thin = run.map(lambda part: all(map(is_thin, part.members)) or is_sliver(part.hull), parts)
    boxes = np.array([part.box for part in parts])
    kept = np.ones(len(parts), dtype=bool)
    stood_in: dict[int, BoolArray] = {}  # the hulls near each sliver when it was dropped

    def is_missed(own: int) -> bool:
        others = stood_in[own] = kept & _near(boxes, boxes[own])
        near = [parts[i].hull for i in np.flatnonzero(others)]
        return not near or _misses(hull_union(near, run.threads), parts[own], run.threads)

    smallest_first = sorted(np.flatnonzero(thin).tolist(), key=lambda i: parts[i].hull.volume)
    for own in smallest_first:
        kept[own] = False
        kept[own] = is_missed(own)
    for own in reversed(smallest_first):  # in a stack of slivers, each would cover the next
        if not kept[own] and (stood_in[own] & ~kept).any():
            kept[own] = is_missed(own)
    return [parts[i] for i in np.flatnonzero(kept)]


def _misses(union: _native.HullUnion, sliver: Part, threads: int) -> bool:
    """Whether a point of a sliver is too far from the other hulls; corners, tested first, decide most."""
    return any(
        (union.distance(piece.vertices, threads) > SLIVER_LOSS).any()
        or union.under(piece.vertices, piece.faces, SLIVER_LOSS / 4, threads)[1] > SLIVER_LOSS
        for piece in sliver.members
    )


def _near(boxes: FloatArray, sliver: FloatArray) -> BoolArray:
    """Which of the boxes [N, 2, 3] are within `SLIVER_LOSS` of a sliver's."""
    gap = np.maximum(boxes[:, 0] - sliver[1], sliver[0] - boxes[:, 1])
    return np.asarray((gap <= SLIVER_LOSS).all(axis=1))
