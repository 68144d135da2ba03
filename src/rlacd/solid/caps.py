"""Caps: what closes a solid where planes cut it.

A cut leaves a surface with rims, loops of vertices in the plane, counter-clockwise around the cap as seen from outside.
"""

from __future__ import annotations

import numpy as np
from manifold3d import triangulate

from rlacd import _native
from rlacd.solid.arrays import FloatArray, IntArray

NEGLIGIBLE_FOLD = 1e-9
"""A share of a cap's area that may be upside down: rounding."""

Surface = tuple[FloatArray, IntArray]
"""Vertices float64 [V, 3] and triangles int32 [F, 3]."""


def capped(vertices: FloatArray, faces: IntArray, rims: list[IntArray], outlines: list[FloatArray]) -> Surface:
    """Close one side of a cut.

    Rims cross where a solid overlaps itself; triangles between them would lead out of the solid. They are taken apart
    into loops that do not cross, which close the solid exactly as often as it overlaps itself.

    Parameters
    ----------
    vertices : float64 [V, 3]
    faces : int32 [F, 3]
    rims : list of int32 [R]
        Loops of vertices.
    outlines : list of float64 [R, 2]
        The same as points of the plane.

    Returns
    -------
    vertices : float64 [W, 3]
        The same, followed by one for each crossing of rims.
    faces : int32 [G, 3]
    """
    if not rims:
        return vertices, faces
    triangles = triangulate(outlines)
    caps = [np.concatenate(rims)[triangles]]
    if _share_upside_down(np.concatenate(outlines), triangles) > NEGLIGIBLE_FOLD:
        vertices, faces, regions = _native.uncross(vertices, faces, rims, outlines)
        caps = [
            np.concatenate(loops)[triangulate(points)[:, :: 1 if winding > 0 else -1]]
            for winding, loops, points in regions
            for _ in range(abs(winding))
        ]
    return vertices, np.ascontiguousarray(np.concatenate([faces, *caps]), dtype=np.int32)


def section_caps(sections: list[tuple[list[IntArray], list[FloatArray]]]) -> IntArray | None:
    """Triangles [T, 3] that close sections in several planes, each of rims and their outlines [R, 2].

    Returns None where rims cross. Side by side in one plane sections are triangulated together, which is quicker.
    """
    rims = [rim for own, _ in sections for rim in own]
    if not rims:
        return np.empty((0, 3), np.int32)
    x, beside = 0.0, []
    for _, outlines in sections:
        left, right = min(o[:, 0].min() for o in outlines), max(o[:, 0].max() for o in outlines)
        beside += [outline + np.array([x - left, 0.0]) for outline in outlines]
        x += 1.1 * (right - left)
    triangles = triangulate(beside)
    if _share_upside_down(np.concatenate(beside), triangles) > NEGLIGIBLE_FOLD:
        return None
    return np.concatenate(rims)[triangles]


def _share_upside_down(points: FloatArray, triangles: IntArray) -> float:
    a, b, c = (points[corner] for corner in triangles.T)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    total = np.abs(area).sum()
    return float(-area[area < 0].sum() / total) if total > 0 else 0.0
