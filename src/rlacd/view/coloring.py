"""Colours of hulls: hulls that touch never share a hue, as long as there are enough hues."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import trimesh

from rlacd.io.write.palette import DISTINCT, hull_colors
from rlacd.solid.arrays import FloatArray

HUES = len(DISTINCT) // 3
"""Colours that are easy to tell apart, also for the colour-blind; see `rlacd.io.write.palette`."""

NEAR = 2e-3
"""Hulls count as touching if closer than this share of their common extent, too close for the eye to separate."""


@dataclass(frozen=True, eq=False)
class Coloring:
    """A colour for each hull.

    Attributes
    ----------
    rgb : uint8 [N, 3]
    rank : int64 [N]
        Index of the hue; differs between hulls that touch, unless more than `HUES` of them all touch each other.
    """

    rgb: npt.NDArray[np.uint8]
    rank: npt.NDArray[np.int64]


def color_hulls(hulls: Sequence[trimesh.Trimesh]) -> Coloring:
    """Choose colours by which hulls touch: neighbours differ in hue, and hulls that share a hue differ in shade.

    Hulls are coloured greedily in smallest-last order (Matula & Beck 1983): each gets the least used hue that its
    neighbours leave free.
    """
    beside = neighbours(hulls)
    rank = np.full(len(hulls), -1, dtype=np.int64)
    used = np.zeros(HUES, dtype=np.int64)
    shade = np.zeros(len(hulls), dtype=np.int64)
    for hull in _smallest_last(beside):
        taken = np.bincount([rank[other] for other in beside[hull] if rank[other] >= 0], minlength=HUES)
        rank[hull] = np.lexsort((np.arange(HUES), used, taken))[0]
        shade[hull] = used[rank[hull]]
        used[rank[hull]] += 1
    index = rank + HUES * shade
    return Coloring(hull_colors(int(index.max(initial=-1)) + 1)[index], rank)


def neighbours(hulls: Sequence[trimesh.Trimesh]) -> list[set[int]]:
    """Find which convex hulls touch or overlap: no facet normal of either separates them by more than `NEAR`.

    Hulls separated only along the cross product of two edges count as touching.
    """
    beside: list[set[int]] = [set() for _ in hulls]
    if not hulls:
        return beside
    corners = [np.asarray(hull.vertices, dtype=np.float64) for hull in hulls]
    lower = np.array([points.min(axis=0) for points in corners])
    upper = np.array([points.max(axis=0) for points in corners])
    near = NEAR * float((upper.max(axis=0) - lower.min(axis=0)).max())
    planes = [_planes(hull) for hull in hulls]
    for one in range(len(hulls)):
        boxes = np.all((lower[one + 1 :] <= upper[one] + near) & (upper[one + 1 :] >= lower[one] - near), axis=1)
        for other in (one + 1 + np.flatnonzero(boxes)).tolist():
            if not (_apart(planes[one], corners[other], near) or _apart(planes[other], corners[one], near)):
                beside[one].add(other)
                beside[other].add(one)
    return beside


def _planes(hull: trimesh.Trimesh) -> tuple[FloatArray, FloatArray]:
    """The facets' outward unit normals and offsets; facets too thin to have a normal are skipped."""
    triangles = np.asarray(hull.triangles, dtype=np.float64)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    sound = lengths > 0.0
    normals = normals[sound] / lengths[sound, None]
    return normals, np.einsum("ij,ij->i", normals, triangles[sound, 0])


def _apart(planes: tuple[FloatArray, FloatArray], points: FloatArray, near: float) -> bool:
    normals, offsets = planes
    return bool(np.any((normals @ points.T).min(axis=1) > offsets + near)) if len(normals) else False


def _smallest_last(beside: list[set[int]]) -> list[int]:
    """Smallest-last order: repeatedly move the hull with the fewest remaining neighbours to the end."""
    left = [set(others) for others in beside]
    waiting = set(range(len(beside)))
    order = []
    while waiting:
        least = min(waiting, key=lambda hull: (len(left[hull]), -hull))
        waiting.remove(least)
        order.append(least)
        for other in left[least]:
            left[other].discard(least)
    return order[::-1]
