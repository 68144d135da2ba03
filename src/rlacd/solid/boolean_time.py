"""Time for what cannot be stopped: manifold3d holds Python's lock until it has finished."""

from __future__ import annotations

import math
import time

from manifold3d import Manifold

from rlacd._native import Stopped, poll_stop, seconds_left

LONG = 50_000
"""Triangles that manifold3d takes some tenths of a second for."""

LATE = 0.3
"""Seconds that it may take longer than there is time."""

_SEGMENTS = 64


def require_time_for(triangles: int) -> None:
    """Raise `Stopped` where the work has to stop, or will have to before so many triangles could be dealt with.

    How long that takes depends on the machine and on what else it does: a small task of the same kind tells.
    """
    poll_stop()
    left = seconds_left()
    if triangles < LONG or math.isinf(left):
        return
    ball = Manifold.sphere(1.0, _SEGMENTS).to_mesh64()
    start = time.perf_counter()
    some = Manifold(ball).num_tri()
    if (time.perf_counter() - start) * triangles / some > left + LATE:
        raise Stopped
