"""The plane whose two sides fill their hulls best, found without sweeping all of them."""

from __future__ import annotations

import math

from rlacd import _native
from rlacd.planes.candidates import Candidates
from rlacd.planes.sweep import ROUNDING, SLIVER
from rlacd.solid.component import NEGLIGIBLE_VOLUME, Component, Plane

SLIVERS = (SLIVER, SLIVER / 100)
"""Planes that leave slivers are taken only where no other is left."""

TIE = 1e-9
"""Costs that differ by less than this share of the largest are equal."""


def least_excess(component: Component, candidates: Candidates, exponent: float, threads: int = 1) -> Plane | None:
    """Get the valid plane of least cost; None when every plane misses the solid or shaves off a film.

    The cost is the `exponent`-norm of the two sides' |CH(m_i)| - |m_i|. It is measured for those planes only that
    bounds do not rule out (see native/cut/least_excess.hpp). Of planes that cost the same but for rounding, as they do
    in symmetric shapes, the first is taken, so that the cuts do not depend on the input's unit and place.

    Parameters
    ----------
    exponent : float
        1 for the sum, which orders planes as the sum of hull volumes does (and whose ties are that sum's); infinity for
        the maximum.
    """
    # No plane costs more than the whole component: the hulls of the two sides lie side by side in its own.
    most = component.hull.volume if exponent == 1 else max(component.hull.volume - component.volume, 0.0)
    number = _native.find_least_excess(
        component.vertices,
        component.faces,
        candidates.directions,
        candidates.offsets,
        exponent,
        TIE * (most if math.isinf(exponent) else most**exponent),
        ROUNDING * NEGLIGIBLE_VOLUME,
        SLIVERS,
        threads,
    )
    return candidates.plane(number) if number >= 0 else None
