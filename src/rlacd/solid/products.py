"""Products of vectors in space that are the same bits on every machine.

``@`` and ``einsum`` add in an order, and round or do not round between, as the processor and the library built for it
allow. A plane whose offset comes from them differs in the last bit from machine to machine, and with it every hull.
"""

from __future__ import annotations

import numpy as np

from rlacd.solid.arrays import FloatArray


def heights(points: FloatArray, directions: FloatArray) -> FloatArray:
    """Heights of points [N, 3] along directions: [N] for one [3], [N, K] for several [K, 3]."""
    x, y, z = (points[:, axis] if directions.ndim == 1 else points[:, axis, None] for axis in range(3))
    along: FloatArray = x * directions[..., 0] + y * directions[..., 1] + z * directions[..., 2]
    return along


def dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot products of the vectors in two arrays [..., 3] of equal shapes, or shapes that numpy broadcasts."""
    products: FloatArray = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return products


def length(vector: FloatArray) -> float:
    """Length of one vector [3]."""
    return float(np.sqrt(dots(vector, vector)))
