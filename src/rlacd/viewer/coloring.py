"""Colours of hulls: hulls that touch never share a hue, as long as there are enough hues."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np
import numpy.typing as npt
import trimesh

from rlacd.io.write.palette import DISTINCT, hull_colors

HUES = len(DISTINCT) // 3
"""Colours that are easy to tell apart, also for the colour-blind; see `rlacd.io.write.palette`."""

TOO_CLOSE_TO_SEE = 2e-3
"""Hulls count as touching if closer than this share of their common extent, too close for the eye to separate."""


def color_hulls(hulls: Sequence[trimesh.Trimesh]) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Choose colours by which hulls touch: neighbours differ in hue, and hulls that share a hue differ in shade.

    Hulls are coloured greedily in smallest-last order (Matula & Beck 1983): each gets its neighbours' least used free
    hue.

    Returns
    -------
    rgb : uint8 [N, 3]
    rank : int64 [N]
        Index of the hue; differs between hulls that touch, unless more than `HUES` of them all touch each other.
    """
    beside = neighbours(hulls)
    rank = np.full(len(hulls), -1, dtype=np.int64)
    used = np.zeros(HUES, dtype=np.int64)
    shade = np.zeros(len(hulls), dtype=np.int64)
    for hull in nx.coloring.strategy_smallest_last(nx.Graph(dict(enumerate(beside))), None):
        taken = np.bincount([rank[other] for other in beside[hull] if rank[other] >= 0], minlength=HUES)
        rank[hull] = np.lexsort((np.arange(HUES), used, taken))[0]
        shade[hull] = used[rank[hull]]
        used[rank[hull]] += 1
    index = rank + HUES * shade
    return hull_colors(int(index.max(initial=-1)) + 1)[index], rank


def neighbours(hulls: Sequence[trimesh.Trimesh]) -> list[set[int]]:
    """Find which convex hulls touch or overlap: no facet normal of either separates them by `TOO_CLOSE_TO_SEE`.

    Hulls separated only along the cross product of two edges count as touching.
    """
    beside: list[set[int]] = [set() for _ in hulls]
    if not hulls:
        return beside
    lower, upper = np.array([hull.bounds for hull in hulls]).swapaxes(0, 1)
    near = TOO_CLOSE_TO_SEE * float((upper.max(axis=0) - lower.min(axis=0)).max())
    for one, hull in enumerate(hulls):
        boxes = np.all((lower[one + 1 :] <= upper[one] + near) & (upper[one + 1 :] >= lower[one] - near), axis=1)
        for other in (one + 1 + np.flatnonzero(boxes)).tolist():
            if not (_lies_above(hulls[other], hull, near) or _lies_above(hull, hulls[other], near)):
                beside[one].add(other)
                beside[other].add(one)
    return beside


def _lies_above(one: trimesh.Trimesh, other: trimesh.Trimesh, near: float) -> bool:
    """Whether a hull is further than `near` above the plane of a facet of another."""
    normals = other.face_normals  # zero where a facet is too thin to have one
    heights = (normals @ one.vertices.T).min(axis=1) - (normals * other.triangles[:, 0]).sum(axis=1)
    return bool((heights > near).any())
