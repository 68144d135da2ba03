"""Time checks before operations that cannot be interrupted: manifold3d holds the GIL until it has finished."""

from __future__ import annotations

import math
import time

from manifold3d import Manifold

from rlacd._native import Stopped, poll_stop, seconds_left

LONG_BOOLEAN = 50_000
"""A number of triangles that manifold3d processes in some tenths of a second."""

LATE = 0.3
"""Seconds by which a boolean may overrun the time left."""

_SEGMENTS = 64


def require_time_for(triangles: int) -> None:
    """Raise `Stopped` if the work must stop, or would have to before a boolean of this many triangles could finish.

    How long a boolean takes depends on the machine and its load, so a small task of the same kind is timed.
    """
    poll_stop()
    left = seconds_left()
    if triangles < LONG_BOOLEAN or math.isinf(left):
        return
    ball = Manifold.sphere(1.0, _SEGMENTS).to_mesh64()
    start = time.perf_counter()
    some = Manifold(ball).num_tri()
    if (time.perf_counter() - start) * triangles / some > left + LATE:
        raise Stopped
