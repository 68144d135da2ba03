"""The options of a decomposition, checked before any work is done."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from rlacd.errors import OptionError
from rlacd.policies import POLICIES

DEFAULT_RESOLUTION = 100
"""Cells along the longest side of the grid on which repair looks for rooms that nothing can enter."""

MIN_THRESHOLD = 0.001
"""Least concavity that can be asked for; the longest side of the input is 2."""


@dataclass(frozen=True)
class Options:
    """Everything that decides the outcome of a decomposition; see `rlacd.decompose` for the meaning of each.

    Raises
    ------
    OptionError
        A value is out of range.
    """

    threshold: float = 0.05
    threshold_m: float | None = None
    max_hulls: int | None = None
    max_vertices: int | None = None
    max_faces: int | None = None
    merge: bool = True
    policy: str = "greedy"
    resolution: int = DEFAULT_RESOLUTION
    seed: int = 0
    threads: int | None = None
    timeout: float | None = None

    def __post_init__(self) -> None:
        _require(MIN_THRESHOLD <= self.threshold <= 2, "threshold", self.threshold, f"between {MIN_THRESHOLD} and 2")
        _require(_positive(self.threshold_m), "threshold_m", self.threshold_m, "a positive length in the input's unit")
        _require(_at_least(1, self.max_hulls), "max_hulls", self.max_hulls, "at least 1")
        _require(_at_least(4, self.max_vertices), "max_vertices", self.max_vertices, "at least 4 (a tetrahedron)")
        _require(_at_least(4, self.max_faces), "max_faces", self.max_faces, "at least 4 (a tetrahedron)")
        _require(self.policy in POLICIES, "policy", self.policy, "one of " + ", ".join(POLICIES))
        _require(self.resolution >= 1, "resolution", self.resolution, "at least 1")
        _require(_at_least(1, self.threads), "threads", self.threads, "at least 1")
        _require(_positive(self.timeout), "timeout", self.timeout, "a positive number of seconds")

    def with_threshold(self, threshold: float) -> Options:
        """Get the same options with another threshold, which has to be in range too.

        Raises
        ------
        OptionError
            `threshold_m` is too small or too large for the object.
        """
        if not MIN_THRESHOLD <= threshold <= 2:
            unit = self.threshold_m / threshold if self.threshold_m is not None else 1.0
            raise OptionError(
                f"threshold_m is {self.threshold_m!r}; for this object it has to be between "
                f"{MIN_THRESHOLD * unit:.4g} and {2 * unit:.4g} (0.05 % and 100 % of its longest side)."
            )
        return dataclasses.replace(self, threshold=threshold)


def _require(holds: bool, name: str, value: object, rule: str) -> None:
    if not holds:
        raise OptionError(f"{name} is {value!r}; it has to be {rule}.")


def _positive(value: float | None) -> bool:
    return value is None or (math.isfinite(value) and value > 0)


def _at_least(least: int, value: int | None) -> bool:
    return value is None or value >= least
