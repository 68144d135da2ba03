"""Slits between flat walls, filled exactly: cuts would have to follow them though next to nothing gets in."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from rlacd._native import components, long_normals, poll_stop
from rlacd.repair.union import CrossingsError, unite
from rlacd.solid.arrays import FloatArray, Int64Array, dots, heights
from rlacd.solid.component import FLAT, LOST_VOLUME, concatenated
from rlacd.solid.mass import mass_of
from rlacd.solid.solid import Solid, surface_of
from rlacd.solid.topology import Edges

BARED = 0.04
"""Least share of the surface that has to go: 21 meshes of `train/` that meet this have 0.93 of the hulls without
filling, 35 others 1.00."""

_ASIDE = 0.014
PARALLEL = 1 - _ASIDE**2 / 2
"""The walls of a slit are parallel to within this cosine: what narrows more is mostly a cleft between round things."""

# Pairs of walls looked at in one go.
_PAIRS = 1_000_000
# Fillings reach so far into the solid around them.
_HAIR = 1e-8


def without_slits(solid: Solid, width: float, extent: float) -> Solid:
    """Fill slits between flat walls no farther apart than `width`, if a disc of diameter `extent` fits in along them.

    All that is filled lies within half the width of the solid. What is narrow in two directions, like a hole for a peg,
    stays open.

    Parameters
    ----------
    solid : Solid
    width, extent : float
        In the frame.

    Returns
    -------
    Solid
        With a warning that tells how many and how wide; the same if too little of the surface would go, or if a room
        would be closed.
    """
    found = _slits(solid.vertices, solid.faces.astype(np.int64), width, extent)
    if not found:
        return solid
    fillings, widths = zip(*found, strict=True)
    try:
        filled = unite([solid.manifold, *fillings])
    except CrossingsError:
        return solid
    most = solid.manifold.volume() + sum(filling.volume() for filling in fillings)
    closes_rooms = filled.volume() > most + LOST_VOLUME * most
    if closes_rooms or filled.surface_area() > (1 - BARED) * solid.manifold.surface_area():
        return solid
    vertices, faces = surface_of(filled - solid.manifold)
    walls = vertices, np.ascontiguousarray(faces[:, ::-1])
    told_in, unit = solid.frame.told_in, solid.frame.unit
    volume = told_in.cubic_words(-mass_of(*walls, solid.frame).volume_abs)
    were = "1 slit was" if len(fillings) == 1 else f"{len(fillings)} slits were"
    said = (
        f"{were} filled, at most {unit.words(max(widths))} wide (volume {volume}, which the mass leaves out); a "
        "smaller --gap (gap) keeps them open."
    )
    return replace(
        solid,
        shape=filled,
        warnings=(*solid.warnings, said),
        is_as_given=False,
        pieces=[*(solid.pieces or [solid.shape]), *fillings],
        cavity_walls=concatenated([walls, *solid.weighed[1:]]),
    )


def _slits(vertices: FloatArray, faces: Int64Array, width: float, extent: float) -> list[tuple[Manifold, float]]:
    """What fills each slit, and how wide that is."""
    walls = _Walls.of(vertices, faces, np.pi / 4 * extent**2)
    found = []
    for i, j in walls.facing(width).tolist():
        apart = heights(walls.corners[i].reshape(-1, 3), walls.normals[j]) - walls.offsets[j]
        if apart.max() > -_HAIR and apart.min() < width:
            found += _between(walls.corners[i], walls.corners[j], walls.normals[i], walls.normals[j], width, extent)
    return found


class _Walls(NamedTuple):
    """Flat regions of a surface, their planes' unit normals [W, 3] and offsets [W], and their boxes [W, 2, 3].

    `corners` are those of the triangles of each, [N, 3, 3].
    """

    corners: list[FloatArray]
    normals: FloatArray
    offsets: FloatArray
    boxes: FloatArray

    @classmethod
    def of(cls, vertices: FloatArray, faces: Int64Array, area: float) -> _Walls:
        """Those of at least so much area."""
        long, (first, last) = long_normals(vertices, faces), Edges.of(faces, len(vertices)).halfedges
        (one, other), apex = (first // 3, last // 3), faces[last // 3, (last + 2) % 3]
        share: FloatArray = np.sqrt(dots(long, long))
        height = dots(vertices[apex] - vertices[faces[one, 0]], long[one])
        flat = (np.abs(height) < FLAT * share[one]) & (dots(long[one], long[other]) > 0)
        count, label = components(len(faces), one[flat], other[flat])
        total: FloatArray = np.stack([np.bincount(label, long[:, k], count) for k in range(3)], axis=1)
        size = np.sqrt(dots(total, total))
        order = np.argsort(label, kind="stable")
        begin = np.searchsorted(label[order], np.arange(count + 1))
        flat = size >= PARALLEL * np.bincount(label, share, count)
        large = np.flatnonzero(flat & (size >= 2 * area))
        normals: FloatArray = total[large] / size[large, None]
        corners: list[FloatArray] = [vertices[faces[order[begin[wall] : begin[wall + 1]]]] for wall in large]
        offsets = dots(np.array([own[0, 0] for own in corners]).reshape(-1, 3), normals)
        boxes = np.array([(own.min(axis=(0, 1)), own.max(axis=(0, 1))) for own in corners]).reshape(-1, 2, 3)
        return cls(corners, normals, offsets, boxes)

    def facing(self, width: float) -> Int64Array:
        """Pairs [P, 2] that face each other, as far as their planes and boxes tell."""
        count, normals = len(self.normals), self.normals
        rows = max(1, _PAIRS // max(count, 1))
        slack = _ASIDE * np.sqrt(3)  # no point of the frame is farther from its middle than the root
        pairs = [np.empty((0, 2), dtype=np.int64)]
        for first in range(0, count, rows):
            poll_stop()
            some = slice(first, first + rows)
            apart = np.abs(self.offsets[some, None] + self.offsets + width / 2)
            is_facing = (apart < width / 2 + slack) & (heights(normals[some], normals) < -PARALLEL)
            pairs.append(np.argwhere(is_facing) + np.array([first, 0]))
        i, j = np.concatenate(pairs).T
        lower, upper = self.boxes[i, 0] - width, self.boxes[i, 1] + width
        is_near = (lower <= self.boxes[j, 1]) & (upper >= self.boxes[j, 0])
        return np.asarray(np.stack([i, j], axis=1)[is_near.all(axis=1) & (i < j)])


def _between(
    wall: FloatArray, other: FloatArray, normal: FloatArray, facing: FloatArray, width: float, extent: float
) -> list[tuple[Manifold, float]]:
    """Solids between two walls ``[N, 3, 3]`` of these normals, where they overlap along the first, and their widths."""
    origin = wall[0, 0]
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    along /= np.sqrt(dots(along, along))
    axes = np.stack([along, np.cross(normal, along), normal])
    own, across = (heights((some - origin).reshape(-1, 3), axes).reshape(-1, 3, 3) for some in (wall, other))
    up = heights(axes, facing)
    offset = dots(other[0, 0] - origin, facing)

    def across_at(points: FloatArray) -> FloatArray:
        return np.asarray((offset - points[:, 0] * up[0] - points[:, 1] * up[1]) / up[2])

    shadow = CrossSection([*own[..., :2]]) ^ CrossSection([*across[:, ::-1, :2]])
    found = []
    for region in shadow.decompose():
        if region.area() < np.pi / 4 * extent**2:
            continue
        apart = across_at(np.concatenate(region.to_polygons()))
        if apart.min() < -_HAIR or not _HAIR < apart.max() <= width or region.offset(-extent / 2).is_empty():
            continue  # walls on each other are no slit

        def raised(points: FloatArray) -> FloatArray:
            z = np.where(points[:, 2] > 0.5, across_at(points) + _HAIR, -_HAIR)
            return np.asarray(origin + heights(np.column_stack([points[:, :2], z]), axes.T))

        filling = Manifold.extrude(region.offset(_HAIR, JoinType.Miter), 1.0).warp_batch(raised)
        found.append((filling, float(apart.max())))
    return found
