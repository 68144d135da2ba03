"""Navigable space: a part is done when its hull stays out of the space that a ball can reach.

Hulls must leave free the space that a ball of radius r can use around a solid; what no ball can reach may be filled.
The definition follows Andrews, "Navigation-Driven Approximate Convex Decomposition" (SIGGRAPH 2024). In the frame where
the input's bounding box is centred and its longest side is 2, the space is the set of points

- outside the solid and at least r + t away from its surface, where t is the tolerance,
- no farther than r from its convex hull,
- at which a ball of radius r stays out of the closed half-spaces, and
- that the centre of such a ball can reach.

Balls with centres spread over its boundary represent it, each as large as fits at distance t from the surface.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from rlacd import _native
from rlacd.criteria.criterion import Criterion, CriterionSummary
from rlacd.errors import OptionError
from rlacd.fit import ANY, Measured, SpaceFit, Unit
from rlacd.options import Options
from rlacd.options.navigable import NavigableSpace, Point
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray, dots, heights, length
from rlacd.solid.balls import NO_BALLS, Balls
from rlacd.solid.component import Part
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.hull import Hull
from rlacd.solid.solid import Solid

MOST_CELLS = 256
"""Maximum number of grid cells along the longest side: for radii that need more, the balls are spaced more widely."""

LEAST_RADIUS = 0.1
"""A ball that has to shrink below this share of the radius is dropped."""

_OPEN = ("capped", "slab", "wrapped", "hull")


@dataclass(frozen=True)
class Conflicts:
    """How many balls had to give way to parts.

    Attributes
    ----------
    shrunk, dropped : int
        Number of balls that shrank, and that were dropped.
    most : float
        Largest reduction of a radius, in the normalised frame; the whole radius for a dropped ball.
    """

    shrunk: int = 0
    dropped: int = 0
    most: float = 0.0


@dataclass(frozen=True, repr=False)
class Navigable(Criterion):
    """The navigable space of one solid, as a criterion.

    Every length is in the normalised frame.

    Attributes
    ----------
    radius, tolerance : float
    balls : Balls
    allowance : float
        How deep a hull may reach into a ball: 0 except for `scaled` criteria.
    warnings : tuple of str
        Sentences for the user.
    conflicts : Conflicts
        Changes that `settled` made to the balls.
    unit : Unit
        In which warnings tell lengths of the frame.
    hull : Hull or None
        The solid's hull, beyond which primitives may reach by the tolerance; without it there are none.
    """

    radius: float
    tolerance: float
    balls: Balls
    warnings: tuple[str, ...] = ()
    conflicts: Conflicts = Conflicts()
    hull: Hull | None = None
    allowance: float = 0.0
    unit: Unit = ANY

    eliminates: ClassVar[bool] = True
    """Hulls are tested quickly against balls."""

    @cached_property
    def _intrusions(self) -> Intrusions:
        return Intrusions(self.balls)

    def __repr__(self) -> str:
        return f"Navigable(radius {self.radius:.4g}, tolerance {self.tolerance:.4g}, {len(self.balls)} balls)"

    @classmethod
    def prepare(cls, options: Options, solid: Solid, run: Run | None) -> Navigable:
        """Make the space of a solid; it has no balls if there is no time to find them."""
        space = options.criterion
        assert isinstance(space, NavigableSpace)
        if run is None:
            warning = "There was no time to find the navigable space, so there are no balls."
            return cls(*space.in_frame(solid.frame.scale), NO_BALLS, (warning,))
        with run.stage("space"):
            return cls.of(space, solid, run.threads)

    @classmethod
    def of(cls, space: NavigableSpace, solid: Solid, threads: int = 0) -> Navigable:
        """Find the space around a solid and place its balls.

        Parameters
        ----------
        space : NavigableSpace
        solid : Solid
            The repaired input; its cavities count only if it was repaired with ``keep_cavities``.
        threads : int
            0 uses every core. The result does not depend on it.

        Raises
        ------
        OptionError
            A seed lies inside the solid, closer than the radius to it or to a closed plane, or in a closed half-space;
            or a length in the input's unit is too small or too large for the object.

        Notes
        -----
        Distances are exact. Passages are found on a grid with cells half a radius wide; if the grid leaves the answer
        open, the passage itself is followed. No passage narrower than 99% of the ball counts, and one as wide as the
        ball is found unless it is too contorted to be followed in steps of half a radius.

        Measured well inside the hull of the solid, 99% of the space's boundary is within 0.6 ball radii of a centre,
        and all of it within 0.75: hulls can reach a fifth of the radius past the boundary undetected, rarely a third.
        """
        scale = solid.frame.scale
        radius, tolerance = space.in_frame(scale)
        warnings = list[str]()
        if opened := sum(body.step in _OPEN for body in solid.bodies):
            bodies = f"{opened} open bod{'y' if opened == 1 else 'ies'}"
            warnings.append(f"the space is measured from the closed surface that repair made of {bodies}")
        surface = _native.Surface(solid.vertices, solid.faces)
        planes = _planes_in_frame(space.closed_planes, solid.frame)
        seeds = None
        if space.seeds is not None:
            seeds = solid.frame.to_frame(space.seeds)
            _check_seeds(seeds, space.seeds, surface, planes, radius, solid.frame.unit)
        hull = Hull.of(solid.vertices)
        balls = NO_BALLS
        if radius >= 2:
            warnings.append("the radius is larger than the object, so no ball can get in: one hull is enough")
        elif hull is not None:
            pitch = max(radius / 2, (2 + 2 * radius) / MOST_CELLS)
            if pitch > radius / 2:
                warnings.append(
                    f"the radius, {50 * radius:.3g}% of the longest side, is small: balls are placed "
                    f"{pitch / radius:.2g} radii apart, and free space between them may be missed"
                )
            lengths, reachable = (radius, tolerance), space.reachable_only
            balls = Balls(
                *_native.navigable_balls(surface, hull.body, *lengths, reachable, seeds, planes, pitch, threads)
            )
        return cls(radius, tolerance, balls, tuple(warnings), hull=hull, unit=solid.frame.unit)

    @property
    def reach(self) -> float:
        """Twice the sum of radius and tolerance: a ball can pass through a wider gap between two parts."""
        return 2 * (self.radius + self.tolerance)

    @property
    def obstacles(self) -> Balls:
        """The balls."""
        return self.balls

    def credit(self, part: Part) -> float:
        """The sum of the volumes of its pieces' hulls: what lies between a hull and the surface is no error."""
        return sum(member.hull.volume for member in part.members) or part.hull.volume

    def summary(self, errors: Sequence[float] | None) -> CriterionSummary:
        """The number of balls, how many gave way, and how deep the parts' hulls reach into them."""
        exceeding = [error for error in errors or () if error > 0]
        sentences = list(self.warnings)
        if errors is None:
            sentences.append("There was no time to measure how deep the hulls reach into balls.")
        given_way = self.conflicts.shrunk + self.conflicts.dropped
        if given_way:
            sentences.append(
                f"No cut could keep the hulls off {given_way} balls, so {self.conflicts.shrunk} balls were shrunk and "
                f"{self.conflicts.dropped} dropped; the largest loss of radius is "
                f"{self.unit.words(self.conflicts.most)}."
            )
        if errors is not None and exceeding:
            sentences.append(
                f"{len(exceeding)} of {len(errors)} hulls reach into balls of the navigable space, "
                f"up to {self.unit.words(max(exceeding))} deep."
            )
        found = Measured(None, None) if errors is None else Measured(tuple(errors), max(errors))
        space = SpaceFit(self.radius, self.tolerance, len(self.balls), **vars(self.conflicts), intrusion=found)
        return CriterionSummary({"navigable": space}, tuple(sentences))

    def is_met(self, part: Part) -> bool:
        """Whether the hull reaches no deeper than the allowance into balls larger than that, or the part is small.

        Small is a part whose hull is smaller than half the sum of tolerance and allowance. A primitive must also stay
        within the tolerance of the solid's hull, in which other hulls lie anyway: hardly any ball stands beyond it.
        """
        if part.hull.primitive is not None and not self._stays_around(part.hull):
            return False
        if self._is_small(part) or len(self.balls) == 0:
            return True
        if not self._intrusions.any_beyond(part, max(self.allowance, ROUNDING)):
            return True
        if self.allowance == 0:
            return False
        return self.allowance >= self._deepest(part, self.allowance)

    def error(self, part: Part) -> float:
        """Greatest depth of the part's hull in a ball: the radius minus the signed distance of the ball's centre."""
        return 0.0 if self._is_small(part) else self._deepest(part, 0.0)

    def scaled(self, factor: float) -> Navigable:
        """The coarser criterion: the depth that hulls may reach, tolerance plus allowance, grows by `factor`."""
        other = replace(self, allowance=max(0.0, (self.tolerance + self.allowance) * factor - self.tolerance))
        vars(other)["_intrusions"] = self._intrusions  # the balls are the same
        return other

    def settled(self, parts: Sequence[Part]) -> Navigable:
        """Give way to finished parts: balls that their hulls touch shrink until they no longer do, or are dropped.

        Balls that would shrink below a tenth of the radius are dropped. `conflicts` of the result counts the changes.
        """
        radii = self._intrusions.radii_left(parts)
        kept = radii >= LEAST_RADIUS * self.radius
        loss = np.where(kept, self.balls.radii - radii, self.balls.radii)
        conflicts = Conflicts(
            shrunk=int(np.count_nonzero(kept & (loss > 0))),
            dropped=int(np.count_nonzero(~kept)),
            most=float(loss.max(initial=0.0)),
        )
        if conflicts == Conflicts():
            return self
        return replace(self, balls=Balls(self.balls.centres[kept], radii[kept]), conflicts=conflicts)

    def _is_small(self, part: Part) -> bool:
        small = (self.tolerance + self.allowance) / 2
        return part.hull.volume < small**3 and bool(np.ptp(part.hull.vertices, axis=0).max() < small)

    def _stays_around(self, hull: Hull) -> bool:
        """Whether a hull lies within the tolerance of the solid's, decided at its corners: the distance is convex."""
        if self.hull is None:
            return False
        around = _native.Surface(self.hull.vertices, self.hull.faces)
        away = hull.vertices[around.distance(hull.vertices, threads=1) > self.tolerance]
        return len(away) == 0 or bool((around.winding(away, accuracy=4.0, threads=1) > 0.5).all())

    def _deepest(self, part: Part, least_radius: float) -> float:
        """Deepest intrusion into a ball larger than `least_radius`."""
        touched, depth = self._intrusions.of(part)
        return float(depth[self.balls.radii[touched] > least_radius].max(initial=0.0))


class Intrusions:
    """Which balls each part touches and how deep, cached as long as the part lives.

    A part's hull lies within that of the part it was cut from, so it can only touch balls that the latter touches.
    """

    def __init__(self, balls: Balls) -> None:
        self._radii = balls.radii
        self._balls = _native.BallSet(balls.centres, balls.radii)
        self._known: WeakKeyDictionary[Part, tuple[IntArray, FloatArray]] = WeakKeyDictionary()
        self._lock = threading.Lock()

    def of(self, part: Part) -> tuple[IntArray, FloatArray]:
        """Indices of the balls that the part's hull touches [K], ascending, and its depths in them [K]."""
        known = self._recall(part)
        if known is None:
            within = part.within
            candidates = None if within is None else self.of(within)[0]
            known = self._balls.intrusions(part.hull.body, candidates, ROUNDING)
            with self._lock:  # another thread may have done the same, with the same result
                self._known[part] = known
        return known

    def any_beyond(self, part: Part, depth: float) -> bool:
        """Whether the part's hull reaches deeper than `depth` into any ball."""
        if part.within is None and self._recall(part) is None:  # a union: most fail, so stop at the first ball
            first, _ = self._balls.intrusions(part.hull.body, None, depth, first=True)
            return len(first) > 0
        _, depths = self.of(part)
        return bool((depths > depth).any())

    def radii_left(self, parts: Sequence[Part]) -> FloatArray:
        """How large each ball can be without touching any of the parts' hulls [B], 0 or less where it cannot be."""
        radii = self._radii.copy()
        for part in parts:
            touched, depth = self.of(part)
            radii[touched] = np.minimum(radii[touched], self._radii[touched] - depth)
        return radii

    def _recall(self, part: Part) -> tuple[IntArray, FloatArray] | None:
        with self._lock:
            return self._known.get(part)


def _planes_in_frame(planes: Sequence[tuple[Point, float]], frame: Frame) -> FloatArray:
    """Rows of unit normal and offset [P, 4]."""
    rows = np.empty((len(planes), 4))
    for row, (normal, offset) in zip(rows, planes, strict=True):
        row[:3] = np.array(normal) / (long := length(np.array(normal, dtype=np.float64)))
        row[3] = (offset / long - dots(row[:3], frame.center)) * frame.scale
    return rows


def _check_seeds(
    seeds: FloatArray, given: ArrayLike, surface: _native.Surface, planes: FloatArray, radius: float, unit: Unit
) -> None:
    inside = surface.winding(seeds, accuracy=4.0) > 0.5
    distance = surface.distance(seeds)
    above = (heights(seeds, planes[:, :3]) - planes[:, 3]).min(axis=1, initial=np.inf)
    for i, seed in enumerate(np.asarray(given)):
        if inside[i]:
            raise OptionError(f"seed {i} at {seed.tolist()} lies inside the solid; put it where a ball can be.")
        if distance[i] < radius:
            raise OptionError(
                f"seed {i} at {seed.tolist()} is {unit.words(distance[i])} away from the solid, which is less than "
                f"the radius, {unit.words(radius)}; put it where a ball has room."
            )
        if above[i] < radius:
            raise OptionError(
                f"seed {i} at {seed.tolist()} is nearer than the radius, {unit.words(radius)}, to a closed plane "
                "or beyond it; put it where a ball has room."
            )
