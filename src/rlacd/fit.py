"""How well hulls fit: the criterion's measurement of each part, beside its limit, in a report and in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from rlacd.options.names import UNITS

RESOLVED = 1e-3
"""Distances in the frame above this (0.05% of the longest side) are measured to 1%; others are upper bounds."""

COVERED = 5e-5
"""Hulls that miss no more than this of an input cover it; those that reach no farther beyond it reach nowhere."""


@dataclass(frozen=True)
class Unit:
    """The unit in which lengths are told: the one in which a length was given, else the input's own."""

    name: str = "units"
    """``mm``, ``m`` and the like; ``units`` where the input does not say its own."""
    length_abs: float = 1.0
    """Its length in the input's unit."""

    @classmethod
    def of(cls, metres: float | None) -> Unit:
        """That of an input whose unit is so many metres; None if it does not say."""
        return cls() if metres is None else cls(_NAMES.get(metres, cls.name))

    @classmethod
    def typed(cls, name: str | None, metres: float | None) -> Unit | None:
        """That in which a length was given for an input whose unit is so many metres; None if none was."""
        return None if name is None or metres is None else cls(name, UNITS[name] / metres)

    def scaled(self, scale: float) -> Unit:
        """The same for lengths in a frame, of which an input's unit is so many units."""
        return Unit(self.name, self.length_abs * scale)

    def words(self, length: float) -> str:
        """A length with its unit."""
        return f"{length / self.length_abs:.4g} {self.name}"

    def cubic_words(self, volume_abs: float) -> str:
        """A volume, in cubic units of the input, with its unit."""
        return f"{volume_abs / self.length_abs**3:.4g} {self.name}³"

    def apart(self, length: float, limit: float) -> tuple[str, str]:
        """A length and its limit, with as many digits as `told_apart` takes."""
        longest, most = told_apart(length / self.length_abs, limit / self.length_abs)
        return f"{longest} {self.name}", f"{most} {self.name}"


ANY = Unit()
"""That of an input that does not say its unit."""

_NAMES = {1e-6: "µm", 0.3048: "ft", **{metres: name for name, metres in UNITS.items()}}


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
    """None, like `max`, where there was no time."""
    max: float | None
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

    def words(self, unit: Unit) -> str | None:
        """Say how well the hulls fit, with lengths of the frame in a unit; None if unknown."""
        if self.name == "intrusion":
            if self.max is None:
                return f"there are {self.balls} balls"
            if self.max <= 0:
                return f"no hull touches any of the {self.balls} balls"
            return f"hulls reach {unit.words(self.max)} into the {self.balls} balls"
        if self.max is None or self.limit is None:
            return None
        if self.name == "added_volume":
            most, tolerance = told_apart(100 * self.max, 100 * self.limit)
            return f"hulls add up to {most}% of volume (tolerance {tolerance}%)"
        most, threshold = unit.apart(self.max, self.limit)
        return f"{self.name} at most {most} (threshold {threshold}{', exceeded' * (self.max > self.limit)})"


def told_apart(value: float, limit: float) -> tuple[str, str]:
    """Write both with four digits, or as many as show on which side of the limit the value is."""
    for digits in range(4, 18):
        words = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if (float(words[0]) > float(words[1])) == (value > limit):
            break
    return words
