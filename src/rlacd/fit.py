"""How well hulls fit: the criterion's measurement of each part, beside its limit, in a report and in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from rlacd.options.names import UNITS

RESOLVED = 1e-3
"""Distances in the frame above this (0.05 % of the longest side) are measured to 1 %; others are upper bounds."""

COVERED = 5e-5
"""Hulls that miss no more than this of an input cover it."""


@dataclass(frozen=True)
class Measured:
    """What the criterion measured of each part."""

    per_part: tuple[float, ...] | None
    """An upper bound for the part of each hull, in the order of the hulls; null without time to measure."""
    max: float | None
    """The greatest of them."""


@dataclass(frozen=True)
class LengthFit(Measured):
    """How far parts and their hulls are apart."""

    threshold: float
    """The limit, a length."""


@dataclass(frozen=True)
class VolumeFit(Measured):
    """The share of volume that each hull adds."""

    tolerance: float
    """The limit, a share."""
    relative_to: Literal["part", "whole"]
    """What it is a share of: each part's own volume, or the whole solid's."""


@dataclass(frozen=True)
class SpaceFit:
    """What is left of navigable space."""

    radius: float
    """Of the ball that has to pass."""
    tolerance: float
    """Space nearer to the surface than this may be filled."""
    balls: int
    """Number of balls that no hull may touch."""
    shrunk: int
    """How many balls gave way in part to parts that no cut could keep off them."""
    dropped: int
    """How many gave way altogether."""
    most: float
    """The largest loss of radius."""
    intrusion: Measured
    """How deep the hulls reach into the final balls."""


class Fit(NamedTuple):
    """The measurement of a criterion."""

    name: str
    """The measurement; also its key in summaries."""
    per_part: tuple[float, ...] | None
    """None, like `worst`, where there was no time."""
    worst: float | None
    limit: float | None
    """None for navigable space, of which hulls may touch nothing."""
    balls: int = 0
    """Number of balls of navigable space."""

    @classmethod
    def of(cls, report: object) -> Fit | None:
        """That of the criterion that a report has measurements of; None if it has none."""
        for name, found in vars(report).items():
            if isinstance(found, LengthFit):
                return cls(name, found.per_part, found.max, found.threshold)
            if isinstance(found, VolumeFit):
                return cls("added_volume", found.per_part, found.max, found.tolerance)
            if isinstance(found, SpaceFit):
                return cls("intrusion", found.intrusion.per_part, found.intrusion.max, None, found.balls)
        return None

    @property
    def key(self) -> str:
        """The key of its entry in the report."""
        return {"added_volume": "volume", "intrusion": "navigable"}.get(self.name, self.name)

    @property
    def is_length(self) -> bool:
        """Whether it is a length, which the threshold limits."""
        return self.name not in ("added_volume", "intrusion")

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
        if self.worst is None or self.limit is None:
            return None
        if self.name == "added_volume":
            most, tolerance = told_apart(100 * self.worst, 100 * self.limit)
            return f"hulls add up to {most} % of volume (tolerance {tolerance} %)"
        most, threshold = told_apart(self.worst / scale, self.limit / scale)
        return f"{self.name} at most {most} (threshold {threshold}{', exceeded' * (self.worst > self.limit)})"


def length_unit(options: Mapping[str, Any], scale: float, unit: str | None = None) -> tuple[float, str]:
    """The unit in which a report's lengths are written: the threshold's, so that they can be compared.

    Parameters
    ----------
    options : mapping
        Those of the decomposition; its `threshold_abs` is read.
    scale : float
        Units of the frame per unit of the input.
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
        return scale * UNITS[unit], f"in {unit}"
    if options.get("threshold_abs") is not None:
        return scale, "in the input's unit"
    return 1.0, "longest side = 2"


def told_apart(value: float, limit: float) -> tuple[str, str]:
    """Write both with four digits, or as many as show on which side of the limit the value is."""
    for digits in range(4, 18):
        words = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if (float(words[0]) > float(words[1])) == (value > limit):
            break
    return words
