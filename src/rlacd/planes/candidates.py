"""The paper's candidate planes: equidistant along the coordinate axes and the component's principal axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd import _native
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

OFFSETS_PER_AXIS = 25
"""25 planes along each of 6 axes make the paper's 150."""


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
    Principal axes within 0.001 radians of a coordinate axis are replaced by it.
    """
    hull = component.hull
    directions, offsets = _native.candidate_planes(
        component.vertices, component.faces, hull.vertices, hull.faces, per_axis, 0
    )
    return Candidates(np.ascontiguousarray(directions[::per_axis]), offsets.reshape(-1, per_axis))
