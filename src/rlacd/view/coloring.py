"""Colours of hulls: hulls that touch never share a hue, as long as there are enough hues."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import trimesh

from rlacd.io.write.palette import DISTINCT, hull_colors
from rlacd.solid.arrays import FloatArray, IntArray

HUES = len(DISTINCT) // 3
"""Colours that are easy to tell apart, also for the colour-blind; see `rlacd.io.write.palette`."""

TOO_CLOSE_TO_SEE = 2e-3
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
    """Find which convex hulls touch or overlap: no facet normal of either separates them by `TOO_CLOSE_TO_SEE`.

    Hulls separated only along the cross product of two edges count as touching.
    """
    beside: list[set[int]] = [set() for _ in hulls]
    if not hulls:
        return beside
    solids = [_HalfSpaces.of(np.asarray(hull.vertices, dtype=np.float64), np.asarray(hull.faces)) for hull in hulls]
    lower, upper = np.array([solid.lower for solid in solids]), np.array([solid.upper for solid in solids])
    near = TOO_CLOSE_TO_SEE * float((upper.max(axis=0) - lower.min(axis=0)).max())
    for one, solid in enumerate(solids):
        boxes = np.all((lower[one + 1 :] <= upper[one] + near) & (upper[one + 1 :] >= lower[one] - near), axis=1)
        for other in (one + 1 + np.flatnonzero(boxes)).tolist():
            if not (solid.lies_apart(solids[other], near) or solids[other].lies_apart(solid, near)):
                beside[one].add(other)
                beside[other].add(one)
    return beside


@dataclass(frozen=True, eq=False)
class _HalfSpaces:
    """A convex hull as its corners and its facets' planes n·x <= d, and its bounding box."""

    corners: FloatArray
    normals: FloatArray
    offsets: FloatArray
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def of(cls, corners: FloatArray, faces: IntArray) -> _HalfSpaces:
        """Make them from a closed mesh; facets too thin to have a normal are skipped."""
        triangles = corners[faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        sound = lengths > 0
        normals = normals[sound] / lengths[sound, None]
        offsets = np.einsum("ij,ij->i", normals, triangles[sound, 0])
        return cls(corners, normals, offsets, corners.min(axis=0), corners.max(axis=0))

    def lies_apart(self, other: _HalfSpaces, near: float) -> bool:
        """Whether another hull is further than `near` above one of the planes."""
        above = (self.normals @ other.corners.T).min(axis=1, initial=np.inf) > self.offsets + near
        return bool(above.any())


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
