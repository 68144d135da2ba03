"""What a running decomposition tells its caller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """One report from a running decomposition, sent between two steps.

    Attributes
    ----------
    stage : str
        What is being done: the name of a key of ``Decomposition.report["seconds"]``.
    done : int
        Steps of this stage finished so far.
    total : int or None
        Steps of this stage in all; None where that cannot be known beforehand.
    parts : int
        Components the solid is in now.
    seconds : float
        Wall time since the decomposition began.
    """

    stage: str
    done: int
    total: int | None
    parts: int
    seconds: float


ProgressCallback = Callable[[Progress], object]
"""Called between steps and several times a second in long ones. To stop and keep what was reached it returns False, or
anything else that counts as false; None, as from a function that returns nothing, goes on."""
