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

FOLDED = 1e-2
"""A share that may be upside down where a solid overlaps itself by a hair: vertices at crossings would pile up there,
cut after cut. It is also the most that a solid clipped to a hull may have; beyond it a boolean clips."""

Surface = tuple[FloatArray, IntArray]
"""Vertices float64 [V, 3] and triangles int32 [F, 3]."""


def capped(
    vertices: FloatArray, faces: IntArray, rims: list[IntArray], outlines: list[FloatArray]
) -> tuple[Surface, float]:
    """Close one side of a cut.

    Rims cross where a solid overlaps itself; triangles between them may lead out of the solid. If more than `FOLDED` of
    the cap does, rims are taken apart into loops that do not cross, which close the solid exactly as often as it
    overlaps itself, unless there are too many crossings.

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
    surface : (float64 [W, 3], int32 [G, 3])
        The same vertices, followed by one for each crossing of rims that were taken apart, and the closed surface.
    folded : float
        Share of the cap's area that is upside down because rims cross.
    """
    if not rims:
        return (vertices, faces), 0.0
    triangles, folded = _least_folded(outlines)
    caps = [np.concatenate(rims)[triangles]]
    if folded > FOLDED:
        uncrossed = _native.uncross(vertices, faces, rims, outlines)
        if uncrossed is not None:
            vertices, faces, regions = uncrossed
            folded = 0.0
            caps = [
                np.concatenate(loops)[triangulate(points)[:, :: 1 if winding > 0 else -1]]
                for winding, loops, points in regions
                for _ in range(abs(winding))
            ]
    return (vertices, np.ascontiguousarray(np.concatenate([faces, *caps]), dtype=np.int32)), folded


def section_caps(
    corners: IntArray, outline: FloatArray, rim_ends: IntArray, section_ends: IntArray
) -> tuple[IntArray, float]:
    """Close sections in several planes by triangles.

    They are triangulated together, which is quicker. Rims that cross stay as they are, since sections share edges.

    Parameters
    ----------
    corners : int32 [R]
        Vertices of all rims, one rim after the other.
    outline : float64 [R, 2]
        The same as points, the sections side by side in one plane.
    rim_ends : int32 [L]
        Where each rim ends in `corners`.
    section_ends : int32 [S]
        The number of rims up to the end of each section.

    Returns
    -------
    caps : int32 [T, 3]
    folded : float
        Share of the caps' area that is upside down because rims cross.
    """
    if not len(corners):
        return np.empty((0, 3), np.int32), 0.0
    ends = rim_ends.tolist()  # `np.split` takes ten times as long for many short rims
    outlines = [outline[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]
    triangles = triangulate(outlines)
    folded = _native.upside_down_share(outline, triangles)
    if folded > NEGLIGIBLE_FOLD:
        begins = np.concatenate([[0], section_ends[:-1]])
        first = np.concatenate([[0], rim_ends])[begins]
        each = [_least_folded(outlines[begin:end])[0] for begin, end in zip(begins, section_ends, strict=True)]
        triangles = np.concatenate([own + at for own, at in zip(each, first, strict=True)])
        folded = _native.upside_down_share(outline, triangles)
    return corners[triangles], folded


def _least_folded(outlines: list[FloatArray]) -> tuple[IntArray, float]:
    """Triangles of loops, and the share of their area that is upside down.

    Where loops cross, how far triangles fold depends on chance and on the direction of the loops.
    """
    points = np.concatenate(outlines)
    triangles = triangulate(outlines)
    folded = _native.upside_down_share(points, triangles)
    if folded > NEGLIGIBLE_FOLD:
        mirrored = triangulate([outline[::-1, ::-1] for outline in outlines])
        ends = np.cumsum([len(outline) for outline in outlines])
        back = np.concatenate([np.arange(end - 1, end - 1 - len(o), -1) for end, o in zip(ends, outlines, strict=True)])
        other = back[mirrored][:, ::-1]
        if (share := _native.upside_down_share(points, other)) < folded:
            return other, share
    return triangles, folded
