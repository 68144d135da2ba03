"""The plane whose two sides have the least excess hull volume, found without a full sweep."""

from __future__ import annotations

import math

from rlacd import _native
from rlacd.planes.candidates import Candidates
from rlacd.planes.sweep import ROUNDING_FACTOR, SLIVER
from rlacd.solid.component import NEGLIGIBLE_VOLUME, Component, Plane

SLIVERS = (SLIVER, SLIVER / 100)
"""Thresholds for slivers, strictest first: planes that leave slivers are used only if there is no other."""

TIE = 1e-9
"""Costs that differ by less than this share of the largest count as equal."""


def least_excess(component: Component, candidates: Candidates, exponent: float, threads: int = 1) -> Plane | None:
    """Get the valid plane of least cost; None if every plane misses the solid or shaves off a film.

    The cost is the `exponent`-norm of the two sides' |CH(m_i)| - |m_i|. It is computed only for planes that bounds do
    not rule out (see native/cut/least_excess.hpp). Of planes whose costs are equal up to rounding, as in symmetric
    shapes, the first is taken, so that the cuts do not depend on the unit and position of the input.

    Parameters
    ----------
    exponent : float
        1 for the sum, which orders planes as the sum of hull volumes does (and is given that sum's tolerance for ties);
        infinity for the maximum.
    """
    # No plane costs more than the whole component: the hulls of the two sides are disjoint and lie in its hull.
    most = component.hull.volume if exponent == 1 else max(component.hull.volume - component.volume, 0.0)
    number = _native.find_least_excess(
        component.vertices,
        component.faces,
        candidates.directions,
        candidates.offsets,
        exponent,
        TIE * (most if math.isinf(exponent) else most**exponent),
        ROUNDING_FACTOR * NEGLIGIBLE_VOLUME,
        SLIVERS,
        threads,
    )
    return candidates.plane(number) if number >= 0 else None
