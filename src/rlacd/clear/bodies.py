"""A rigid body as it was read and as hulls, and which bodies come near each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rlacd.errors import RlacdError
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, IntArray

MOST_NEAR = 4_000_000
"""Pairs of boxes that come near each other along the x axis, over all samples; robots of a hundred links have fewer."""


class CrowdedError(RlacdError, ValueError):
    """More bodies stand in each other than can be checked."""


Surface = tuple[FloatArray, IntArray]
"""Vertices [V, 3] and triangles [F, 3]."""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body; everything is in its own frame, and in one unit for all bodies.

    Attributes
    ----------
    name : str
    mesh : tuple
        The surface as it was read.
    hulls : list of tuple
        The surfaces of convex polytopes.
    """

    name: str
    mesh: Surface
    hulls: list[Surface] = field(default_factory=list)

    def with_hulls(self, hulls: Sequence[Surface]) -> Body:
        """The same body as other hulls."""
        return replace(self, hulls=[*hulls])

    @property
    def box(self) -> FloatArray:
        """Lower and upper corner of a box around mesh and hulls [2, 3]."""
        points = [self.mesh[0], *(vertices for vertices, _ in self.hulls)]
        filled = [some for some in points if len(some)]
        return np.stack(
            [np.min([p.min(axis=0) for p in filled], axis=0), np.max([p.max(axis=0) for p in filled], axis=0)]
        )


def may_touch(bodies: Sequence[Body]) -> bool:
    """Whether boxes of hulls of two bodies that share a frame overlap."""
    owner = np.array([i for i, body in enumerate(bodies) for _ in body.hulls])
    boxes = [np.stack([v.min(axis=0), v.max(axis=0)]) for body in bodies for v, _ in body.hulls]
    pairs = overlapping(np.stack(boxes)[None])[:, 1:]
    return bool((owner[pairs[:, 0]] != owner[pairs[:, 1]]).any())


def placed_boxes(boxes: FloatArray, poses: FloatArray) -> FloatArray:
    """Boxes [N, 2, 3] around boxes placed by poses [S, N, 4, 4], or all by each of [S, 1, 4, 4]: [S, N, 2, 3]."""
    middle, half = boxes.mean(axis=1), np.ptp(boxes, axis=1) / 2
    turn = poses[..., :3, :3]
    centre = (turn * middle[:, None, :]).sum(axis=-1) + poses[..., :3, 3]
    reach = (np.abs(turn) * half[:, None, :]).sum(axis=-1)
    return np.stack([centre - reach, centre + reach], axis=2)


def overlapping(boxes: FloatArray) -> Int64Array:
    """Find the pairs of boxes [S, N, 2, 3] that overlap in the same sample: rows of sample, first, second [P, 3].

    Boxes are swept along the x axis, all samples one behind the other, so the work grows with the pairs that come near
    along it.

    Raises
    ------
    CrowdedError
        More than `MOST_NEAR` do.
    """
    samples, count = boxes.shape[:2]
    span = np.ptp(boxes[..., 0]) + 1.0
    shift = span * np.arange(samples)[:, None] - boxes[..., 0].min()
    lower, upper = (boxes[..., 0, 0] + shift).ravel(), (boxes[..., 1, 0] + shift).ravel()
    order = np.argsort(lower, kind="stable")
    begin = np.arange(1, len(order) + 1)
    behind = np.maximum(np.searchsorted(lower[order], upper[order], side="right") - begin, 0)
    if behind.sum() > MOST_NEAR:
        raise CrowdedError(f"more than {MOST_NEAR:,} pairs of them stand in each other")
    ahead = np.repeat(begin - 1, behind)
    within = np.arange(behind.sum()) - np.repeat(np.cumsum(behind) - behind, behind)
    first, second = order[ahead], order[ahead + 1 + within]
    flat = boxes.reshape(-1, 2, 3)
    meets: BoolArray = (flat[first, 0] <= flat[second, 1]).all(axis=1) & (flat[second, 0] <= flat[first, 1]).all(axis=1)
    first, second = first[meets], second[meets]
    rows = np.stack([first // count, np.minimum(first, second) % count, np.maximum(first, second) % count], axis=1)
    return rows[np.lexsort(rows.T[::-1])]
