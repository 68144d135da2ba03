"""At most so many parts: the decomposition with the least error among those of ever coarser criteria.

Which ones are tried does not depend on the limit, so that a larger limit never has a larger error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from rlacd._native import Stopped
from rlacd.criteria import Criterion
from rlacd.merge.merge import united_in_turn
from rlacd.run import Run, Work
from rlacd.solid.component import Part

COARSER = 1.5
"""The threshold grows by this factor until one part is left. In between, parts are united two at a time."""

LONG_MERGING = 8e6
"""Units of work (see `rlacd.run.work`) after which it grows by the fourth power of that: only tangles take so long."""

MEASURING = 5e6
"""Units of work for measuring pairs of parts, under each threshold: a coarser one has fewer."""


def best_within(
    most: int,
    whole: Part,
    decompose: Callable[[float], Sequence[Part]],
    unite: Callable[[Part, Part], Part],
    criterion: Criterion,
    run: Run,
) -> list[Part]:
    """Find the decomposition into at most `most` parts whose largest error is least.

    Parameters
    ----------
    most : int
        Fewer than the decomposition without a limit has.
    whole : Part
        The solid as one part: what remains where there is no time.
    decompose : callable
        Decomposes the solid under a criterion whose threshold is larger by a factor; 1 gives what it has without a
        limit.
    unite : callable
        Returns the union of two parts.
    criterion : Criterion
        Measures the errors.
    """
    best, least = [whole], math.inf
    factor, begin = 1.0, run.work.done
    try:
        least = criterion.error(whole)
        while True:
            parts = decompose(factor)
            for state, error in united_in_turn(parts, unite, criterion, Work(MEASURING), run):
                if len(state) <= most and error < least:
                    best, least = state, error
            if len(parts) <= 1 or run.stopped_by is not None:
                return best
            factor *= COARSER if run.work.done - begin < LONG_MERGING else COARSER**4
    except Stopped:
        run.note_stop()
    return best
