"""The paper's candidate planes: equidistant along the coordinate axes and the component's principal axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane
from rlacd.solid.products import heights

OFFSETS_PER_AXIS = 25
"""25 planes along each of 6 axes make the paper's 150."""


SAME_AXIS = 1e-3
"""Principal axes within this angle (radians) of a coordinate axis are replaced by it."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """K directions with M parallel planes each.

    Attributes
    ----------
    directions : float64 [K, 3]
        Unit normals.
    offsets : float64 [K, M]
        Ascending offsets d of the planes n.x = d.
    """

    directions: FloatArray
    offsets: FloatArray

    def __len__(self) -> int:
        return self.offsets.size

    @classmethod
    def joined(cls, *blocks: Candidates) -> Candidates:
        """Concatenate the planes of several blocks, one per row; the sweep groups rows of equal direction."""
        directions = [np.repeat(block.directions, block.offsets.shape[1], axis=0) for block in blocks]
        offsets = [block.offsets.reshape(-1, 1) for block in blocks]
        return cls(np.concatenate(directions), np.concatenate(offsets))

    def plane(self, index: int) -> Plane:
        """Get plane number `index` of the K * M, numbered direction by direction."""
        k, j = divmod(index, self.offsets.shape[1])
        x, y, z = (float(c) for c in self.directions[k])
        return Plane((x, y, z), float(self.offsets[k, j]))


def axis_and_principal(component: Component, per_axis: int = OFFSETS_PER_AXIS) -> Candidates:
    """Candidates of one component: `per_axis` planes along x, y, z and its three principal axes.

    The planes divide the component's extent along each direction into `per_axis` + 1 equal slabs (the paper, 3.2).
    """
    directions = np.concatenate([np.eye(3), _snapped(component.principal_axes)])
    along = heights(component.hull.vertices, directions)
    lower, upper = along.min(axis=0), along.max(axis=0)
    steps = np.arange(1, per_axis + 1) / (per_axis + 1)
    offsets = lower[:, None] + (upper - lower)[:, None] * steps
    return Candidates(np.ascontiguousarray(directions), np.ascontiguousarray(offsets))


def _snapped(axes: FloatArray) -> FloatArray:
    nearest = np.eye(3)[np.abs(axes).argmax(axis=1)]
    aligned = np.linalg.norm(np.where(nearest == 1, 0.0, axes), axis=1) < SAME_AXIS
    return np.where(aligned[:, None], nearest, axes)
