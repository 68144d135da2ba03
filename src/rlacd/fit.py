"""How well hulls fit, as a report says it: the criterion's measurement of each part, beside its limit, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rlacd.options.names import UNITS

_LENGTHS = ("concavity", "distance")

RESOLVED = 1e-3
"""Distances in the frame above this (0.05 % of the longest side) are measured to 1 %; others are upper bounds."""

COVERED = 5e-5
"""Hulls that miss no more than this of an input cover it."""


class Fit(NamedTuple):
    """The measurement of a criterion.

    Attributes
    ----------
    name : str
        The measurement; also its key in summaries.
    per_part : list of float or None
        None, like `worst`, where there was no time.
    worst : float or None
    limit : float or None
        None for navigable space, of which hulls may touch nothing.
    balls : int
        Number of balls of navigable space.
    """

    name: str
    per_part: list[float] | None
    worst: float | None
    limit: float | None
    balls: int = 0

    @classmethod
    def of(cls, report: Mapping[str, Any]) -> Fit | None:
        """Read a report; None if it holds no measurement."""
        for name in _LENGTHS:
            if name in report:
                found = report[name]
                return cls(name, found.get("per_part"), found["max"], found.get("threshold"))
        if "volume" in report:
            found = report["volume"]
            return cls("added_volume", found["per_part"], found["max"], found["tolerance"])
        if "navigable" in report:
            space = report["navigable"]
            return cls("intrusion", space["intrusion"]["per_part"], space["intrusion"]["max"], None, space["balls"])
        return None

    @property
    def key(self) -> str:
        """The key of its entry in the report."""
        return {"added_volume": "volume", "intrusion": "navigable"}.get(self.name, self.name)

    @property
    def is_length(self) -> bool:
        """Whether it is a length, which the threshold limits."""
        return self.name in _LENGTHS

    def unit(self, scale: float) -> float:
        """Unit of the measurement, where the unit of lengths is `scale`: 1 for a share of volume."""
        return 1.0 if self.name == "added_volume" else scale

    def words(self, scale: float = 1.0) -> str | None:
        """Say how well the hulls fit, with lengths in a unit that is `scale` units of the frame; None if unknown."""
        if self.name == "intrusion":
            if self.worst is None:
                return f"there are {self.balls} balls"
            if self.worst <= 0:
                return f"no hull touches any of the {self.balls} balls"
            return f"hulls reach {self.worst / scale:.4g} into the {self.balls} balls"
        if self.worst is None:
            return None
        if self.limit is None:
            return f"{self.name} at most {self.worst / scale:.4g}"
        if self.name == "added_volume":
            most, tolerance = told_apart(100 * self.worst, 100 * self.limit)
            return f"hulls add up to {most} % of volume (tolerance {tolerance} %)"
        most, threshold = told_apart(self.worst / scale, self.limit / scale)
        return f"{self.name} at most {most} (threshold {threshold}{', exceeded' * (self.worst > self.limit)})"


def length_unit(report: Mapping[str, Any], unit: str | None = None) -> tuple[float, str]:
    """The unit in which a report's lengths are written: the threshold's, so that they can be compared.

    Parameters
    ----------
    report : mapping
        Its `scale` and its option `threshold_abs` are read.
    unit : str, optional
        In which the threshold was typed: ``%`` of the longest side, or of `UNITS` for an input in metres.

    Returns
    -------
    float, str
        Units of the frame per such unit, and what that is.
    """
    if unit == "%":
        return 0.02, "in % of the longest side"
    if unit is not None:
        return report["scale"] * UNITS[unit], f"in {unit}"
    if report.get("options", {}).get("threshold_abs") is not None:
        return report["scale"], "in the input's unit"
    return 1.0, "longest side = 2"


def fit_words(report: Mapping[str, Any], unit: str | None = None) -> str:
    """Say how well hulls fit: by the criterion, and how far they reach beyond the input; empty if nothing is known."""
    scale, in_words = length_unit(report, unit)
    fit, (over, under) = Fit.of(report), (report.get("hausdorff", {}).get(side) for side in ("over", "under"))
    words = [said] if fit is not None and (said := fit.words(scale)) else []
    if over is not None and under is not None:
        missed = "and cover it" if under <= COVERED else f"and miss it by {_length(under, scale)}"
        words.append(f"hulls reach {_length(over, scale)} beyond the input {missed}")
    return "; ".join(words) + (f" ({in_words})" if words else "")


def _length(length: float, scale: float) -> str:
    return f"{'at most ' * (length <= RESOLVED)}{length / scale:.4g}"


def told_apart(value: float, limit: float) -> tuple[str, str]:
    """Write both with four digits, or as many as show on which side of the limit the value is."""
    for digits in range(4, 18):
        words = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if (float(words[0]) > float(words[1])) == (value > limit):
            break
    return words
