"""Growing: hulls grow through the solid, and few of them are chosen that cover it.

Where bodies cross, cuts chop them, and merging, which unites two parts at a time, seldom finds a body again. A piece
that kept some sides of its body finds it at once (`native/distance/grow.hpp`). That bodies cross shows where a piece
lies in what has grown from a piece of another part; other solids pay for the growth only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rlacd.criteria.criterion import Criterion
from rlacd.merge.merge import merge_parts
from rlacd.merge.slivers import drop_slivers
from rlacd.run import Run, work
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import ClippedPart, Component, Part, Plane
from rlacd.solid.hull import TOLERANCE, Hull

DEPTH = 0.4
"""How deep the solid's surface may come into what has grown, as a share of the criterion's overhang: at 0.1, the
planted solids of research/search.md take 3 % more parts."""

POINTS = 12
"""Points drawn in each piece, by which the choice is made."""

LEAST = 0.5
"""What has grown is taken only if it holds as much more as this share of the volume of the piece it grew from: merging
does the rest better. With 0, the planted solids take 4 % more parts."""

NEARLY = 5e-3
"""How far the corners of a piece in what has grown may stick out of it, in the frame."""

MOST_PIECES = 400
"""With more pieces, all of them against each other would take longer than a pass."""


def grow_cover(merged: list[Part], criterion: Criterion, run: Run, solid: Component) -> list[Part]:
    """Cover a solid in which bodies cross by parts grown from its pieces, if that takes fewer.

    Parameters
    ----------
    merged : list of Part
        Parts that meet the criterion; their members are the pieces.
    criterion : Criterion
    run : Run
        The merged parts are returned when its work runs out.
    solid : Component
        The solid that was decomposed.
    """
    pieces = [member for part in merged for member in part.members]
    units = sum(work.testing(len(piece.hull.vertices)) for piece in pieces)
    judges = criterion.screen.looks_inside and math.isfinite(criterion.overhang)
    if not judges or len(merged) < 3 or len(pieces) > MOST_PIECES or not run.work.pay(units):
        return merged
    depth = DEPTH * criterion.overhang
    grown = run.map(lambda piece: solid.filling.grown(piece.hull.vertices, piece.hull.faces, depth), pieces)
    if not _cross(merged, grown):
        return merged
    parts = drop_slivers(_chosen(pieces, grown, criterion, run, solid), run)
    parts = drop_slivers(merge_parts(parts, criterion, run, solid=solid), run)
    return parts if len(parts) < len(merged) and not run.is_over else merged


def _cross(merged: Sequence[Part], grown: Sequence[FloatArray]) -> bool:
    """Whether some piece lies in what has grown from a piece of another part."""
    owner = np.repeat(np.arange(len(merged)), [len(part.members) for part in merged])
    hulls = [member.hull for part in merged for member in part.members]
    firsts = np.cumsum([0, *(len(hull.vertices) for hull in hulls[:-1])])
    beyond = _beyond(np.concatenate([hull.vertices for hull in hulls]), grown)
    within = np.maximum.reduceat(beyond, firsts, axis=1) <= NEARLY
    return bool((within & (owner != owner[:, None])).any())


def _beyond(points: FloatArray, grown: Sequence[FloatArray]) -> FloatArray:
    """How far points are beyond each intersection of half-spaces."""
    return np.array([(points @ spaces[:, :3].T - spaces[:, 3]).max(axis=1) for spaces in grown])


def _chosen(
    pieces: Sequence[Component], grown: Sequence[FloatArray], criterion: Criterion, run: Run, solid: Component
) -> list[Part]:
    """Parts of what has grown, that which holds the most of the rest first; and what no such part could take."""
    random = np.random.default_rng(0)
    shares = [random.dirichlet(np.full(len(piece.hull.vertices), 0.5), POINTS) for piece in pieces]
    points = [share @ piece.hull.vertices for share, piece in zip(shares, pieces, strict=True)]
    volumes = np.repeat([piece.volume for piece in pieces], POINTS)
    holds = _beyond(np.concatenate(points), grown) <= TOLERANCE
    gains = holds @ volumes
    rest, parts = list(pieces), list[Part]()
    while run.may_continue():
        best = int(gains.argmax())
        if gains[best] <= 0:
            break
        gain, gains[best] = gains[best], 0
        if gain < LEAST * POINTS * pieces[best].volume:
            continue
        inside, outside, units = _divided(rest, grown[best])
        hull = Hull.of(*(member.hull.vertices for member in inside)) if inside else None
        if not run.work.pay(units) or hull is None:
            continue
        part = ClippedPart(solid, inside, hull)
        if not run.work.pay(work.filling(part.size, len(hull.faces)) + work.judging(part.size, len(hull.faces))):
            break
        if part.is_whole and criterion.is_met(part):
            parts.append(part)
            rest = outside
            taken = holds[best] & (volumes > 0)
            gains -= holds[:, taken] @ volumes[taken]
            volumes[taken] = 0
    return [*parts, *rest]


def _divided(components: Sequence[Component], spaces: FloatArray) -> tuple[list[Component], list[Component], float]:
    """What of components is inside and outside of an intersection of half-spaces, and the work of cutting them."""
    inside: list[Component] = []
    outside: list[Component] = []
    units = 0.0
    for component in components:
        above = component.hull.vertices @ spaces[:, :3].T - spaces[:, 3]
        most = above.max(axis=0)
        if above.min(axis=0).max() >= -TOLERANCE:
            outside.append(component)
            continue
        left: Component | None = component
        cut_off: list[Component] = []
        for *normal, offset in spaces[np.argsort(-most)][: np.count_nonzero(most > TOLERANCE)].tolist():
            units += work.cutting(left.size)
            left, off = left.cut(Plane((normal[0], normal[1], normal[2]), offset))
            if left is None:
                break
            cut_off += [off] if off is not None else []
        if left is None:
            outside.append(component)
        else:
            inside.append(left)
            outside += cut_off
    return inside, outside, units
