"""What the caller wants of a repair."""

from __future__ import annotations

import math
from typing import NamedTuple

DEFAULT_GAP = 0.03
"""Default radius of the ball, and greatest distance of a cap from the input's surface, in the frame."""

CELLS_ACROSS = 1.5
"""Least radius of a ball, in cells of its grid."""


class Wanted(NamedTuple):
    """What the caller wants of a repair; see `rlacd.repair.repair.repair`.

    Attributes
    ----------
    open_bodies : str
    gap : float
    cells : int
        Cells along the longest side of the grid on which a ball of radius `gap` rolls.
    keep_cavities : bool
    """

    open_bodies: str
    gap: float
    cells: int
    keep_cavities: bool

    @classmethod
    def of(cls, resolution: int, open_bodies: str, gap: float, keep_cavities: bool) -> Wanted:
        """With cells as small as the ball needs."""
        cells = max(resolution, math.ceil(2 * CELLS_ACROSS / gap)) if gap < DEFAULT_GAP else resolution
        return cls(open_bodies, gap, cells, keep_cavities)
