"""The options of a decomposition, checked before any work is done."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rlacd.criteria import NavigableSpace
from rlacd.errors import OptionError
from rlacd.policies import POLICIES, is_policy
from rlacd.presets import find_preset

DEFAULT_RESOLUTION = 100
"""Cells along the longest side of the grid on which repair looks for rooms that nothing can enter."""

CONCAVITY = "concavity"
"""The default criterion's name."""

DEFAULT_THRESHOLD = 0.05
"""CoACD's default."""

MIN_THRESHOLD = 0.001
"""Least concavity that can be asked for; the longest side of the input is 2."""


RESOLUTIONS = (20, 400)
"""The grid that repair looks for rooms on has this number cubed of cells: with fewer than 20 along a side, a wrap drawn
onto the surface folds over itself; more than 400 would take over 4 GB."""

QUALITIES = ("fast", "balanced", "best")
"""Levels of search; see `rlacd.search`."""

MAX_THREADS = 1024
MAX_SEED = 2**63 - 1


@dataclass(frozen=True)
class Options:
    """Everything that decides the outcome of a decomposition; see `rlacd.decompose` for the meaning of each.

    Raises
    ------
    OptionError
        A value is out of range.
    """

    criterion: str | NavigableSpace = CONCAVITY
    threshold: float = DEFAULT_THRESHOLD
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
    quality: str | None = None
    budget: float | None = None
    search_steps: int | None = None
    preset: str | None = None

    def __post_init__(self) -> None:
        if self.preset is not None:
            engine = find_preset(self.preset)
            for name in ("max_vertices", "max_faces"):
                if getattr(self, name) is None:
                    object.__setattr__(self, name, getattr(engine, name))
        _require(
            self.criterion == CONCAVITY or isinstance(self.criterion, NavigableSpace),
            "criterion",
            self.criterion,
            f'"{CONCAVITY}" or an `rlacd.NavigableSpace`',
        )
        if isinstance(self.criterion, NavigableSpace):
            unused = self.threshold_m is not None or self.threshold != DEFAULT_THRESHOLD
            _require(not unused, "threshold", self.threshold_m or self.threshold, "left out: a NavigableSpace has none")
        self._as_number("threshold", lambda x: MIN_THRESHOLD <= x <= 2, f"between {MIN_THRESHOLD} and 2")
        self._as_number("threshold_m", lambda x: 0 < x < math.inf, "a positive length in the input's unit", None)
        self._as_integer("max_hulls", 1, None, "at least 1", None)
        self._as_integer("max_vertices", 4, None, "at least 4 (a tetrahedron)", None)
        self._as_integer("max_faces", 4, None, "at least 4 (a tetrahedron)", None)
        _require(isinstance(self.merge, (bool, np.bool_)), "merge", self.merge, "True or False")
        object.__setattr__(self, "merge", bool(self.merge))
        _require(is_policy(self.policy), "policy", self.policy, f"one of {', '.join(POLICIES)}, or an .onnx file")
        self._as_integer("resolution", *RESOLUTIONS, "between {} and {}".format(*RESOLUTIONS))
        self._as_integer("seed", 0, MAX_SEED, "between 0 and 2**63 - 1")
        self._as_integer("threads", 1, MAX_THREADS, f"between 1 and {MAX_THREADS}", None)
        self._as_number("timeout", lambda x: 0 < x < math.inf, "a positive number of seconds", None)
        if self.quality is None:  # searching means merging
            object.__setattr__(self, "quality", "balanced" if self.merge else "fast")
        _require(self.quality in QUALITIES, "quality", self.quality, "one of " + ", ".join(QUALITIES))
        self._as_number("budget", lambda x: 0 < x < math.inf, "a positive number of seconds", None)
        self._as_integer("search_steps", 0, None, "at least 0", None)
        for name in ("budget", "search_steps"):
            unused = getattr(self, name) is not None and self.quality == "fast"
            _require(not unused, name, getattr(self, name), "left out with quality='fast', which does not search")
        if not self.merge:
            rule = "'fast', or left out, without merge: searching means merging"
            _require(self.quality == "fast", "quality", self.quality, rule)

    def _as_number(self, name: str, allowed: Callable[[float], bool], rule: str, *absent: None) -> None:
        """Make the option a plain float, so that the report is plain too, whichever library its number came from."""
        given = getattr(self, name)
        if given is None and absent:
            return
        is_number = isinstance(given, (numbers.Real, np.number)) and not isinstance(given, bool)
        value = float(given) if is_number else math.nan
        _require(allowed(value), name, given, rule)
        object.__setattr__(self, name, value)

    def _as_integer(self, name: str, least: int, most: int | None, rule: str, *absent: None) -> None:
        """Make the option a plain int."""
        given = getattr(self, name)
        if given is None and absent:
            return
        is_integer = isinstance(given, (numbers.Integral, np.integer)) and not isinstance(given, bool)
        value = int(given) if is_integer else -1
        _require(value >= least and (most is None or value <= most), name, given, f"an integer, {rule}")
        object.__setattr__(self, name, value)

    def as_plain(self) -> dict[str, Any]:
        """Everything as plain values, the criterion by its name or its own options."""
        return asdict(self)

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
