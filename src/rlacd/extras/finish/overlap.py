"""Hulls that overlap where they touch, so that nothing thin slips between them.

Cuts leave hulls flush: at a seam, the way out of either is sideways, so a simulator pushes a wire that reaches the seam
into it, not out. Here one of two hulls takes in a layer of the other, as thick as the overlap: the part of the other
within the first hull once its facets there are moved outwards. The layer lies in the solid, up to the threshold, so
only the joint hull has to be tested.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.report import Overlap, ShortSeam
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Part
from rlacd.solid.frame import Frame
from rlacd.solid.hull import TOLERANCE, Hull

HELD = 0.7
"""Each point of a seam has to lie in some hull at least this share as deep as in the solid, or as half the overlap if
that is less. On either side of a seam in a bent solid, neither hull is quite as deep as the solid."""


class _Seam(NamedTuple):
    parts: tuple[int, int]
    places: FloatArray  # [N, 3]
    asked: FloatArray  # [N]: how deep each place should lie in some hull

    def deepest(self, bodies: Sequence[_Body]) -> FloatArray:
        """How deep each place lies in the body that it lies deepest in [N]; 0 outside all."""
        depths: FloatArray = np.max([body.part.hull.body.depths(self.places) for body in bodies], axis=0, initial=0.0)
        return depths


def overlap_parts(
    parts: Sequence[Part], solid: Component, criterion: Criterion, overlap: float, frame: Frame
) -> tuple[list[Part], Overlap]:
    """Grow hulls into their neighbours until those that touch overlap, as far as the criterion allows.

    The depth is measured across each seam. At an end of it, where the solid itself is shallower, so is the overlap.

    Parameters
    ----------
    parts : sequence of Part
        They cover the solid.
    solid : Component
        The whole solid.
    criterion : Criterion
    overlap : float
        Depth of the overlap, in the frame.
    frame : Frame

    Returns
    -------
    parts : list of Part
        In the same order.
    seams : Overlap
        What the report says of them.
    """
    bodies = [_Body(part) for part in parts]
    tolerated = max((criterion.error(part) for part in parts if not criterion.is_met(part)), default=None)
    boxes = _native.Boxes([part.hull.body for part in parts])
    pairs = boxes.pairs(range(len(parts)), TOLERANCE).tolist()
    near: list[set[int]] = [set() for _ in parts]
    for first, second in pairs:
        near[first].add(second)
        near[second].add(first)
    surface = solid.against.surface
    seams: list[_Seam] = []
    for first, second in pairs:
        _native.poll_stop()
        sides, places = bodies[first].contact(bodies[second], overlap)
        if len(sides) == 0:
            continue
        inside = surface.distance(places, threads=1)
        seam = _Seam((first, second), places, HELD * np.minimum(inside, overlap / 2))
        seams.append(seam)
        best, most = dict[int, _Body](), -1
        for change in _changes(bodies, near, first, second, overlap):
            grown = {place: _judged(bodies[place].part, hull, criterion, tolerated) for place, hull in change}
            if any(part is None for part in grown.values()):
                continue
            changed = {place: _Body(part) for place, part in grown.items() if part is not None}
            deepest = seam.deepest([changed.get(place, bodies[place]) for place in seam.parts])
            held = int(np.count_nonzero(deepest >= seam.asked))
            if held > most:
                best, most = changed, held
            if held == len(places):
                break
        for place, body in best.items():
            bodies[place] = body
    short = tuple(_short(bodies, seams, frame))
    return [body.part for body in bodies], Overlap(len(seams), len(short), short)


def _short(bodies: Sequence[_Body], seams: Sequence[_Seam], frame: Frame) -> Iterator[ShortSeam]:
    """The seams with a place that lies in no body as deep as asked for."""
    if not seams:
        return
    low, high = np.stack([body.part.box for body in bodies], axis=1)
    for seam in seams:
        near = (seam.places.min(axis=0) <= high).all(axis=1) & (seam.places.max(axis=0) >= low).all(axis=1)
        deepest = seam.deepest([bodies[i] for i in np.flatnonzero(near).tolist()])
        worst = int((deepest - seam.asked).argmin())
        if deepest[worst] < seam.asked[worst]:
            x, y, z = frame.to_input(seam.places[worst]).tolist()
            yield ShortSeam(seam.parts, (x, y, z), float(deepest[worst]) / frame.scale)


def _changes(
    bodies: list[_Body], near: list[set[int]], first: int, second: int, overlap: float
) -> Iterator[list[tuple[int, Hull]]]:
    """Ways to make two bodies overlap, each as grown hulls: the cheaper one grows, the other, or both by half.

    First, all sides move at which a body touches any other, so that its layers join; if that is too much, only those at
    which it touches the other one.
    """
    both = ((first, second), (second, first))

    def grown(one: int, other: int, depth: float, touched: set[int]) -> tuple[float, tuple[int, Hull]] | None:
        body = bodies[one]
        sides = np.unique(np.concatenate([body.contact(bodies[place], overlap)[0] for place in sorted(touched)]))
        layer = Hull.of(body.part.hull.body.layer(bodies[other].part.hull.body, sides, depth, TOLERANCE))
        if layer is None:
            return None
        hull = Hull.around(body.part.hull, layer)
        return hull.volume - body.part.hull.volume - layer.volume, (one, hull)

    for everywhere in (True, False):
        ways = [(one, other, near[one] if everywhere else {other}) for one, other in both]
        whole = [found for one, other, some in ways if (found := grown(one, other, overlap, some)) is not None]
        for _, change in sorted(whole, key=lambda found: found[0]):
            yield [change]
        halves = [half for one, other, some in ways if (half := grown(one, other, overlap / 2, some)) is not None]
        if len(halves) == len(both):
            yield [change for _, change in halves]


def _judged(part: Part, hull: Hull, criterion: Criterion, tolerated: float | None) -> Part | None:
    """The part with a grown hull, if that meets the criterion or is no worse than the worst part."""
    candidate = part.with_hull(hull)
    if criterion.is_met(candidate) or (tolerated is not None and criterion.error(candidate) <= tolerated):
        return candidate
    return None


class _Body:
    """A part, and where its hull touches others."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self._contacts: dict[_Body, tuple[IntArray, FloatArray]] = {}

    def contact(self, other: _Body, overlap: float) -> tuple[IntArray, FloatArray]:
        """Sides [S] that cover sides of another body by less than the overlap, and places [N, 3] on the latter."""
        if other not in self._contacts:
            self._contacts[other] = self.part.hull.body.contact(other.part.hull.body, overlap, TOLERANCE)
        return self._contacts[other]
