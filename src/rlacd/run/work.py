"""Work, counted rather than timed, so that it is the same on every machine and for every number of threads.

A unit takes about a microsecond on one core; the weights below were fitted to measured CPU times. A limit on work does
not depend on the clock, so results under such a limit depend only on the input.
"""

from __future__ import annotations

import math


class Work:
    """An account of work with a limit that is never exceeded.

    Parameters
    ----------
    most : float
        Limit in units, rounded down.

    Attributes
    ----------
    done : int
        Units spent.
    is_spent : bool
        Whether the account is closed: a payment exceeded what was left, or `close` was called.
    """

    def __init__(self, most: float = math.inf) -> None:
        self.most = most if math.isinf(most) else math.floor(most)
        self.done = 0
        self.is_spent = False

    @property
    def left(self) -> float:
        """Units left."""
        return self.most - self.done

    def close(self) -> None:
        """Close the account: all further payments fail."""
        self.is_spent = True

    def pay(self, units: float) -> bool:
        """Spend units, rounded up; if fewer are left, close the account and return False."""
        units = math.ceil(units)
        if self.is_spent or units > self.left:
            self.is_spent = True
            return False
        self.done += units
        return True


def choosing(faces: int) -> float:
    """Choose a plane for a component."""
    return 1100 + 4.3 * faces


def judging(faces: int, hull_faces: int) -> float:
    """Decide whether a part meets the criterion."""
    return 32 + 0.64 * faces + 1.5 * hull_faces


def cutting(faces: int) -> float:
    """Cut a component by a plane and compute the hulls of its sides."""
    return 145 + 0.73 * faces


def screening(vertices: float, pairs: int = 1) -> float:
    """Compute the joint hulls of pairs of hulls of `vertices` vertices in total, unless a test rejects them."""
    return 45 * pairs + 1.3 * vertices


def uniting(vertices: int) -> float:
    """Unite parts, and hold the joint hull against the solid."""
    return 360 + 8.5 * vertices


def limiting(vertices: int) -> float:
    """Find hulls of few corners around a part whose hull has `vertices`, and around its pieces, which are smaller."""
    return 180 * vertices
