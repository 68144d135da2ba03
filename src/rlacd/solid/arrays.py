"""Array types shared by the whole package."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""Points [N, 3] or values [N], C-contiguous."""
IntArray: TypeAlias = NDArray[np.int32]
"""Triangles [F, 3], counter-clockwise seen from outside, or indices [N]."""
BoolArray: TypeAlias = NDArray[np.bool_]
