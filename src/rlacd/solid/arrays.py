"""Array types, and products of vectors that are the same bits on every machine.

``@``, ``einsum`` and ``np.linalg`` add in an order, and round or do not round between, as the processor and the library
built for it allow; so do the series behind ``arctan2``, ``log`` and fractional powers. A plane whose offset comes from
them differs in the last bit from machine to machine, and with it every hull. Sums, products, quotients and square roots
alone are rounded alike everywhere; other functions made of them are kernels (`native/core/elementary.hpp`).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""Points [N, 3] or values [N], C-contiguous."""
IntArray: TypeAlias = NDArray[np.int32]
"""Triangles [F, 3], counter-clockwise seen from outside, or indices [N]."""
Int64Array: TypeAlias = NDArray[np.int64]
"""The same while a mesh is read and repaired: keys made of two indices need 64 bits."""
BoolArray: TypeAlias = NDArray[np.bool_]
Float32Array: TypeAlias = NDArray[np.float32]


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
