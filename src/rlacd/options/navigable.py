"""The options of navigable space, each stated once; `extras/criteria/navigable.py` says what they mean to a solid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from rlacd.errors import OptionError
from rlacd.options.fields import check_fields, custom, number, option, stated
from rlacd.options.lengths import LENGTH, as_given, in_unit, read_lengths, relative

Point: TypeAlias = tuple[float, float, float]

BOUNDS = (2e-4, 20.0)
"""Of radius and tolerance, where the longest side is 2: less takes endless balls, more fills everything."""

USUAL = {"radius": 0.05, "tolerance": 0.1}
"""Defaults where the length is given in neither way."""

LARGEST_COORDINATE = 1e100
"""Largest coordinate: products of larger ones would be infinite."""


_coordinate = number(-LARGEST_COORDINATE, LARGEST_COORDINATE).read


def _rows(given: Any) -> Sequence[Any]:
    """Take a list, a tuple or an array; raise for other things, some of which never end."""
    rows = given.tolist() if type(given).__name__ == "ndarray" else given
    if not isinstance(rows, (list, tuple)):
        raise TypeError
    return rows


def _point(given: Any) -> Point:
    x, y, z = (_coordinate(value) for value in _rows(given))
    return x, y, z


def _seeds(given: Any) -> tuple[Point, ...]:
    points = tuple(_point(row) for row in _rows(given))
    if not points:
        raise ValueError
    return points


def _planes(given: Any) -> tuple[tuple[Point, float], ...]:
    planes = []
    for row in _rows(given):
        normal, offset = _rows(row)
        point = _point(normal)
        if not math.hypot(*point) > 0:
            raise ValueError
        planes.append((point, _coordinate(offset)))
    return tuple(planes)


_LENGTH = number(*BOUNDS, typed=str)
_SEEDS = custom("a list of at least one finite point [x, y, z]", _seeds)
_PLANES = custom("a list of (normal, offset) pairs, every normal a finite vector [x, y, z] that is not zero", _planes)


@stated(panel="Navigable space (--criterion navigable)", python="NavigableSpace({}=)")
@dataclass(frozen=True)
class NavigableSpace:
    """The criterion "no hull intrudes into the space that a ball can reach".

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    radius: float | str | None = option(
        None,
        kind=_LENGTH,
        metavar="NUMBER",
        usual=f"{USUAL['radius']:g}",
        help="""Radius of the ball, where the longest side of the mesh is 2; also a share of that side (2.5%) or
        a length (20cm).""",
    )
    tolerance: float | str | None = option(
        None,
        kind=_LENGTH,
        metavar="NUMBER",
        usual=f"{USUAL['tolerance']:g}",
        help="""Space nearer to the surface than this may be filled, given as --radius is. With --criterion
        volume: the share of volume that a hull may add, such as 1%.""",
    )
    reachable_only: bool = option(
        True,
        keyword=True,
        flags=("--reachable-only/--everywhere",),
        usual="reachable-only",
        help="Count only what a ball can reach from outside, or every room.",
    )
    seeds: tuple[Point, ...] | None = option(
        None,
        kind=_SEEDS,
        keyword=True,
        flags=("--seed-point",),
        metavar="X,Y,Z",
        repeated=True,
        usual="outside",
        help="A point from which balls start, instead of from outside, in the mesh's own unit; may be repeated.",
    )
    closed_planes: tuple[tuple[Point, float], ...] = option(
        (),
        kind=_PLANES,
        keyword=True,
        flags=("--closed-plane",),
        metavar="X,Y,Z,D",
        repeated=True,
        usual="–",
        help="""A plane that balls do not cross, such as the ground 0,0,1,0: they stay on the side to which the
        normal X,Y,Z points; D is the plane's distance from the origin; may be repeated.""",
    )
    radius_abs: float | None = option(
        None, kind=LENGTH, keyword=True, help="The same as --radius, as a length in the mesh's own unit."
    )
    tolerance_abs: float | None = option(
        None, kind=LENGTH, keyword=True, help="The same as --tolerance, as a length in the mesh's own unit."
    )

    def __post_init__(self) -> None:
        for name, value in ({name: None for name in USUAL} | read_lengths(vars(self))).items():
            object.__setattr__(self, name, value)
        check_fields(self)
        for name, usual in USUAL.items():
            bare, length = getattr(self, name), getattr(self, f"{name}_abs")
            if bare is not None and length is not None:
                raise OptionError(f"{name} is {bare!r} and {name}_abs is {length!r}; give one of them.")
            if bare is None and length is None:
                object.__setattr__(self, name, usual)

    def in_unit(self, metres: float | None, name: str) -> NavigableSpace:
        """Get the same with lengths that have a unit in that of a mesh; see `rlacd.options.lengths.in_unit`."""
        return replace(self, **in_unit(vars(self), metres, name))

    def as_plain(self) -> dict[str, Any]:
        """All options, of which the same can be made."""
        return as_given(vars(self))

    def in_frame(self, scale: float) -> tuple[float, float]:
        """Get radius and tolerance in the frame where the longest side is 2; `scale` is its units per the input's.

        Raises
        ------
        OptionError
            `radius_abs` or `tolerance_abs` is too small or too large for the object.
        """
        return self._in_frame("radius", scale), self._in_frame("tolerance", scale)

    @property
    def sees_cavities(self) -> bool:
        """Whether sealed cavities may count, so repair has to keep them."""
        return not self.reachable_only or self.seeds is not None

    def _in_frame(self, name: str, scale: float) -> float:
        bare, length = getattr(self, name), getattr(self, f"{name}_abs")
        return float(bare) if length is None else relative(name, length, scale, BOUNDS)
