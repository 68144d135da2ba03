"""Hulls that overlap where they touch, so that nothing thin slips between them.

Cuts leave hulls flush: at a seam, the way out of either is sideways, so a simulator pushes a wire that reaches the seam
into it, not out. Here one of two hulls takes in a layer of the other, as thick as the overlap asked for: what the other
fills of the first with its facets there moved outwards. That layer lies in the solid, up to the threshold, so only the
joint hull has to be tested.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rlacd import _native
from rlacd.criteria import Criterion
from rlacd.merge.boxes import Boxes
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import LOST, Component, Part
from rlacd.solid.hull import Hull
from rlacd.solid.products import dots, heights, length

TOUCH = 1e-6
"""Hulls touch that are no farther apart than this (frame)."""

OPPOSED = -0.9
"""Cosine of the angle (154 degrees) between the outward normals of two facets from which on they may form a seam."""

BESIDE = 0.5
"""Cosine of the angle between a facet of a seam and others that move with it: those nearly parallel would leave its
layer no room."""

LEAST_AREA = 1e-8
"""Smaller contacts are no seam: two boxes that share an edge (frame)."""

WITHIN = 0.3
"""Points of a seam are the corners of contacts, moved by this share towards the middle."""

HELD = 0.7
"""A seam overlaps enough if each of its points lies deep in some hull: as deep as in the solid or by half the overlap,
whichever is less, times this. On either side of a seam in a bent solid, neither hull is quite as deep as the solid."""

REACHED = 1 - 1e-6
"""Share of the overlap that counts as all of it, for rounding."""


@dataclass(frozen=True)
class Seams:
    """What became of the seams, where two hulls touched with less overlap than asked for.

    Attributes
    ----------
    count : int
    short : int
        Those that still overlap by less, since the criterion left no room.
    """

    count: int
    short: int


def overlap_parts(
    parts: Sequence[Part], solid: Component, criterion: Criterion, overlap: float
) -> tuple[list[Part], Seams]:
    """Grow hulls into their neighbours until those that touch overlap, as far as the criterion allows.

    The depth is measured across each seam. At an end of it, where the solid itself is shallower, so is the overlap.

    Parameters
    ----------
    parts : sequence of Part
        They cover the solid.
    solid : Component
        The whole solid.
    criterion : Criterion
        It decides on everything the solid fills of a grown hull, as for hulls that reach across others.
    overlap : float
        How deep, in the frame.

    Returns
    -------
    parts : list of Part
        In the same order. A part whose hull grew holds all that the solid fills of it.
    seams : Seams
    """
    bodies = [_Body(part) for part in parts]
    tolerated = max((criterion.error(part) for part in parts if not criterion.is_met(part)), default=None)
    boxes = Boxes(dict(enumerate(parts)))
    pairs = boxes.pairs(range(len(parts)), TOUCH).tolist()
    near: list[set[int]] = [set() for _ in parts]
    for first, second in pairs:
        near[first].add(second)
        near[second].add(first)
    surface = _native.Surface(solid.vertices, solid.faces)
    seams: list[FloatArray] = []
    for first, second in pairs:
        _native.poll_stop()
        contact = bodies[first].contact(bodies[second], overlap)
        if not contact.facets.any():
            continue
        inside = surface.distance(contact.points)
        seam = np.column_stack([contact.points, HELD * np.minimum(inside, overlap / 2)])
        seams.append(seam)
        best, most = dict[int, _Body](), -1
        for change in _changes(bodies, near, first, second, overlap):
            grown = {place: _judged(bodies[place].part, hull, solid, criterion, tolerated) for place, hull in change}
            if any(part is None for part in grown.values()):
                continue
            changed = {place: _Body(part) for place, part in grown.items() if part is not None}
            held = _held([changed.get(place, bodies[place]) for place in (first, second)], seam)
            if held > most:
                best, most = changed, held
            if held == len(seam):
                break
        for place, body in best.items():
            bodies[place] = body
    return [body.part for body in bodies], Seams(len(seams), sum(_held(bodies, seam) < len(seam) for seam in seams))


def _held(bodies: Sequence[_Body], seam: FloatArray) -> int:
    """How many points of a seam [N, 4] lie as deep in some body as their fourth coordinate asks."""
    depths = [body.depths(seam[:, :3]) for body in bodies if body.is_near(seam[:, :3])]
    return int((np.max(depths, axis=0, initial=0.0) >= seam[:, 3]).sum())


def _changes(
    bodies: list[_Body], near: list[set[int]], first: int, second: int, overlap: float
) -> Iterator[list[tuple[int, Hull]]]:
    """Ways to make two bodies overlap, each as grown hulls: the one that adds least, the other, half of either."""

    def grown(one: int, other: int, depth: float) -> tuple[float, list[tuple[int, Hull]]] | None:
        body = bodies[one]
        facets = np.any([body.contact(bodies[place], overlap).facets for place in sorted(near[one])], axis=0)
        layer = body.layer(bodies[other], facets, depth)
        if layer is None:
            return None
        hull = Hull.around(body.part.hull, layer)
        return hull.volume - body.part.hull.volume - layer.volume, [(one, hull)]

    whole = [found for pair in ((first, second), (second, first)) if (found := grown(*pair, overlap)) is not None]
    for _, change in sorted(whole, key=lambda found: found[0]):
        yield change
    halves = [grown(*pair, overlap / 2) for pair in ((first, second), (second, first))]
    if all(half is not None for half in halves):
        yield [grow for half in halves if half is not None for grow in half[1]]


def _judged(part: Part, hull: Hull, solid: Component, criterion: Criterion, tolerated: float | None) -> Part | None:
    """All that the solid fills of a grown hull, if it meets the criterion or is no worse than the worst part."""
    vertices, faces = solid.clipped(hull)
    volume = _native.mesh_volume(vertices, faces) if len(faces) else 0.0
    if volume < (1 - LOST) * part.volume:  # the clipping failed
        return None
    candidate = Part(vertices, faces, volume, hull)
    if criterion.is_met(candidate) or (tolerated is not None and criterion.error(candidate) <= tolerated):
        return candidate
    return None


class _Contact(NamedTuple):
    """Where two bodies are flush.

    Attributes
    ----------
    facets : bool [P]
        Facets of the first.
    points : float64 [N, 3]
        Places on the second, spread over the contact.
    """

    facets: BoolArray
    points: FloatArray


class _Body:
    """A part with the facets of its hull: outward normals [P, 3], offsets [P] of their planes n.x = d, and corners."""

    def __init__(self, part: Part) -> None:
        self.part = part
        hull = part.hull
        triangles = hull.vertices[hull.faces]
        crosses = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(crosses, axis=1)
        units = crosses / np.maximum(lengths, np.finfo(float).tiny)[:, None]
        # Coplanar triangles have equal normals up to rounding.
        _, first, facet = np.unique(np.round(units, 7), axis=0, return_index=True, return_inverse=True)
        facet = facet.ravel()
        self._normals = units[first]
        # The farthest corner: the inexact normal of a sliver then cuts nothing off.
        self._offsets = (heights(hull.vertices, self._normals)).max(axis=0)
        order = np.argsort(facet, kind="stable")
        bounds = np.searchsorted(facet[order], np.arange(1, len(first)))
        self._corners = [np.unique(hull.faces[some]) for some in np.split(order, bounds)]
        self._contacts: dict[_Body, _Contact] = {}

    def depths(self, points: FloatArray) -> FloatArray:
        """How deep points [N, 3] lie inside; negative outside."""
        depths: FloatArray = (self._offsets - heights(points, self._normals)).min(axis=1)
        return depths

    def is_near(self, points: FloatArray) -> bool:
        """Whether the bounding box of points [N, 3] meets its own."""
        low, high = self.part.box
        return bool((points.min(axis=0) <= high).all() and (points.max(axis=0) >= low).all())

    def contact(self, other: _Body, overlap: float) -> _Contact:
        """Where a facet of another body, turned the other way, lies less deep than the overlap under a facet."""
        if other not in self._contacts:
            self._contacts[other] = self._find_contact(other, overlap)
        return self._contacts[other]

    def _find_contact(self, other: _Body, overlap: float) -> _Contact:
        points = []
        areas = np.zeros(len(self._normals))
        vertices = other.part.hull.vertices
        beyond = heights(vertices, self._normals) - self._offsets  # [V, P]
        opposed = heights(other._normals, self._normals) <= OPPOSED
        for facet in np.flatnonzero(opposed.any(axis=1)):
            corners = other._corners[facet]
            outside = beyond[corners]
            planes = np.flatnonzero(opposed[facet] & (outside.max(axis=0) > -REACHED * overlap))
            if len(planes) == 0 or (outside.min(axis=0) > TOUCH).any():
                continue
            polygon = _ordered(vertices[corners], other._normals[facet])
            reach = TOUCH * opposed[facet]  # not sideways, or parts that share an edge would touch
            for plane in np.flatnonzero(outside.max(axis=0) > reach):
                polygon = _cut(polygon, self._normals[plane], self._offsets[plane] + reach[plane])
                if len(polygon) == 0:
                    break
            else:
                depths = self._offsets[planes] - heights(polygon, self._normals[planes])
                for plane in planes[depths.min(axis=0) < REACHED * overlap]:
                    near = _cut(polygon, -self._normals[plane], REACHED * overlap - self._offsets[plane])
                    areas[plane] += (area := _area(near))
                    if area > LEAST_AREA:
                        points.append(near + WITHIN * (near.mean(axis=0) - near))
        return _Contact(areas > LEAST_AREA, np.concatenate(points) if points else np.zeros((0, 3)))

    def layer(self, other: _Body, facets: BoolArray, depth: float) -> Hull | None:
        """What another body fills of this one with some of its facets moved outwards; None if nothing."""
        moved = (heights(self._normals, self._normals[facets]) >= BESIDE).any(axis=1)
        layer: Hull | None = other.part.hull
        for normal, offset in zip(self._normals, self._offsets + depth * moved, strict=True):
            assert layer is not None
            beyond = heights(layer.vertices, normal) - offset
            if beyond.max() <= TOUCH * REACHED:
                continue
            edges = layer.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
            edges = edges[(beyond[edges[:, 0]] > 0) & (beyond[edges[:, 1]] < 0)]
            out, inside = beyond[edges[:, 0]], beyond[edges[:, 1]]
            share = (out / (out - inside))[:, None]
            crossings = (1 - share) * layer.vertices[edges[:, 0]] + share * layer.vertices[edges[:, 1]]
            layer = Hull.of(np.concatenate([layer.vertices[beyond <= 0], crossings]))
            if layer is None:
                return None
        return layer


def _ordered(points: FloatArray, normal: FloatArray) -> FloatArray:
    """The corners [N, 3] of a convex polygon in their order around a normal."""
    spokes = points - points.mean(axis=0)
    across = spokes[int(dots(spokes, spokes).argmax())]
    angles = np.arctan2(heights(spokes, np.cross(normal, across)), heights(spokes, across))
    return points[np.argsort(angles, kind="stable")]


def _cut(polygon: FloatArray, normal: FloatArray, offset: float) -> FloatArray:
    """What of a convex polygon [N, 3] lies in a half-space n.x <= d (Sutherland and Hodgman)."""
    beyond = heights(polygon, normal) - offset
    if beyond.max() <= 0:
        return polygon
    corners = []
    for place in range(len(polygon)):
        here, there = beyond[place - 1], beyond[place]
        if (here > 0) != (there > 0):
            share = here / (here - there)
            corners.append((1 - share) * polygon[place - 1] + share * polygon[place])
        if there <= 0:
            corners.append(polygon[place])
    return np.array(corners).reshape(-1, 3)


def _area(polygon: FloatArray) -> float:
    if len(polygon) < 3:
        return 0.0
    spokes = polygon[1:] - polygon[0]
    ahead, behind = spokes[:-1], spokes[1:]
    doubled = (ahead[:, [1, 2, 0]] * behind[:, [2, 0, 1]] - ahead[:, [2, 0, 1]] * behind[:, [1, 2, 0]]).sum(axis=0)
    return length(doubled) / 2
