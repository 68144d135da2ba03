"""Triangles of polygons: fans, as parsers make them, except where a fan would fold over as the polygon is concave."""

from __future__ import annotations

import numpy as np
from manifold3d import triangulate

from rlacd.solid.arrays import FloatArray, Int64Array

TURNED_SHARE = 1e-9
"""A triangle of a fan is folded over if it is turned against its polygon by more than this share of its area."""

MOST_CORNERS = 10_000
"""Of a polygon that is taken apart without a fan, which may take time quadratic in its corners."""


def triangles_of(points: FloatArray, counts: Int64Array, corners: Int64Array) -> Int64Array:
    """Take polygons apart into triangles, in their order.

    Parameters
    ----------
    points
        ``[V, 3]``.
    counts
        ``[P]``, the number of corners of each polygon; none has triangles if it is below 3.
    corners
        ``[sum of counts]``, their points, polygon by polygon.

    Returns
    -------
    Int64Array
        ``[F, 3]``: of each polygon a fan around its first corner, or, where that folds over, as many triangles that do
        not overlap.
    """
    return np.asarray(corners[places_of(points, counts, corners)])


def places_of(points: FloatArray, counts: Int64Array, corners: Int64Array) -> Int64Array:
    """The triangles of `triangles_of` as places in ``corners``. Raises ValueError if a corner refers to no point."""
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise ValueError(f"a face uses vertex {corners.max()} of {len(points)}, or one below 0")
    if (counts == 3).all():
        return np.arange(len(corners)).reshape(-1, 3)
    pieces, first = np.maximum(counts - 2, 0), np.cumsum(counts) - counts
    owner, begins = np.repeat(np.arange(len(counts)), pieces), np.cumsum(pieces) - pieces
    step = np.arange(len(owner)) - begins[owner]
    places = np.stack([first[owner], first[owner] + step + 1, first[owner] + step + 2], axis=1)
    for polygon in _folded(points, corners[places], owner, len(counts)).tolist():
        ring = slice(first[polygon], first[polygon] + counts[polygon])
        if (apart := triangles_within(points[corners[ring]])) is not None:
            places[begins[polygon] : begins[polygon] + pieces[polygon]] = first[polygon] + apart
    return places


def _folded(points: FloatArray, fans: Int64Array, owner: Int64Array, polygons: int) -> Int64Array:
    """The polygons of four and more corners some of whose triangles are turned against the whole."""
    with np.errstate(all="ignore"):
        a, b, c = points[fans[:, 0]], points[fans[:, 1]], points[fans[:, 2]]
        areas = np.cross(b - a, c - a)
        whole = np.stack([np.bincount(owner, areas[:, axis], polygons) for axis in range(3)], axis=1)
        along = (areas * whole[owner]).sum(axis=1)
        turned = along < -TURNED_SHARE * (whole * whole).sum(axis=1)[owner]
    return np.unique(owner[turned])


def triangles_within(ring: FloatArray) -> Int64Array | None:
    """Triangles ``[N - 2, 3]`` of one polygon ``[N, 3]``, finite, that do not fold over; None if there are none."""
    if len(ring) > MOST_CORNERS:
        return None
    ring = ring - ring.mean(axis=0)
    normal = np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if not length > 0:
        return None
    normal /= length
    right = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    right /= np.linalg.norm(right)
    flat = np.ascontiguousarray(np.stack([ring @ right, ring @ np.cross(normal, right)], axis=1))
    found = np.asarray(triangulate([flat]), dtype=np.int64)
    if found.shape != (len(ring) - 2, 3):
        return None
    a, b, c = flat[found[:, 0]], flat[found[:, 1]], flat[found[:, 2]]
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return found if areas.min() >= -TURNED_SHARE * length else None


def strip_triangles(corners: Int64Array) -> Int64Array:
    """The triangles of a strip of corners: every other one is turned."""
    first = np.arange(max(len(corners) - 2, 0))
    odd = first % 2
    return np.asarray(corners[np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)])


def fan_triangles(corners: Int64Array) -> Int64Array:
    """The triangles of a fan of corners."""
    middle = np.full(max(len(corners) - 2, 0), corners[0] if len(corners) else 0)
    return np.stack([middle, corners[1:-1], corners[2:]], axis=1)
