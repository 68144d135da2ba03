"""Work, counted instead of timed: the same on every machine, for every number of threads.

The unit is what takes about a microsecond of one core; the weights below were fitted to measured CPU times once
(docs/search.md). A bound on work is known beforehand, and results that depend on it depend on the input alone.
"""

from __future__ import annotations

import math


class Work:
    """An account of work with a bound: what is spent never exceeds it.

    Parameters
    ----------
    most : float
        Units there are; what is less than a unit does not count.

    Attributes
    ----------
    done : int
        Units spent.
    is_spent : bool
        Whether something was wanted that there was not enough left for.
    """

    def __init__(self, most: float = math.inf) -> None:
        self.most = most if math.isinf(most) else math.floor(most)
        self.done = 0
        self.is_spent = False

    @property
    def left(self) -> float:
        """Units left."""
        return self.most - self.done

    def share(self, among: int) -> float:
        """Get an equal share of what is left."""
        return self.left if math.isinf(self.left) else self.left // among

    def close(self) -> None:
        """Spend nothing more."""
        self.is_spent = True

    def pay(self, units: float) -> bool:
        """Spend units, rounded up, if there are as many left; otherwise False, and the account is closed."""
        units = math.ceil(units)
        if self.is_spent or units > self.left:
            self.is_spent = True
            return False
        self.done += units
        return True


def choosing(faces: int) -> float:
    """Choose a plane for a component."""
    return 1000 + 5.0 * faces


def judging(faces: int, hull_faces: int) -> float:
    """Decide whether a part meets the criterion."""
    return 35 + 0.14 * faces + 1.6 * hull_faces


def cutting(faces: int) -> float:
    """Cut a component by a plane, and take the hulls of its sides."""
    return 280 + 0.8 * faces


def joining(vertices: int) -> float:
    """Take the joint hull of parts whose hulls have so many vertices in all."""
    return 25 + 0.6 * vertices


def screening(vertices: int) -> float:
    """Hold the joint hull of two parts against the solid; most are refused at once."""
    return 80 + 0.3 * vertices


def holding(vertices: int) -> float:
    """Hold a hull of so many vertices against the solid."""
    return 150 + 1.4 * vertices


def gluing(faces: int) -> float:
    """Glue two parts that have so many faces together."""
    return 20 + 0.35 * faces


def filling(solid_faces: int, faces: int, hull_faces: int) -> float:
    """Take what a solid fills of a hull around parts that have so many faces."""
    return 1200 + 0.65 * solid_faces + 7.0 * faces + 9.0 * hull_faces


def reuniting(faces: int, count: int) -> float:
    """Make one solid of a number of components that have so many faces together."""
    return 1300 + 6.5 * faces + 390.0 * count
