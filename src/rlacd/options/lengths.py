"""Lengths as options take them, in Python and on the command line alike.

A number is in the frame, where the longest side of the mesh is 2 (CoACD's, and the paper's). ``"2.5%"`` is a share of
the longest side. ``"5mm"`` is a length, for which the unit of the mesh has to be known. A number in the mesh's own unit
goes by the option's name and ``_abs``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rlacd.errors import OptionError
from rlacd.options.fields import Kind, number, shown
from rlacd.options.names import UNITS

LONGEST_SIDE = 2.0
"""Length of the longest side of a mesh in the frame."""

OF = {"volume_tolerance": 1.0, "keep_open": 1.0}
"""What 100% is of options that are shares of something else: of a volume, of the radius of each passage."""

TAKEN = ("threshold", "overlap", "keep_open", "radius", "tolerance", "gap", "volume_tolerance")
"""Options that take a share as text; first those whose unit messages use."""

IN_METRES = TAKEN[:5]
"""Those that take a length with a unit."""

_TYPED = re.compile(rf"([-+.\deE]+)\s*(%|{'|'.join(UNITS)})?")


class Metres(float):
    """A length that was given with a unit, in metres, until the unit of the mesh is known."""

    word: str
    unit: str

    def __new__(cls, word: str, value: float, unit: str) -> Metres:
        """Of ``5mm``: that, 5 and mm."""
        made = super().__new__(cls, value * UNITS[unit])
        made.word, made.unit = word, unit
        return made

    def __getnewargs__(self) -> tuple[str, float, str]:  # type: ignore[override]
        return self.word, float(self) / UNITS[self.unit], self.unit


def _positive(value: Any) -> float:
    plain: float = number(above=0).read(value)
    return value if isinstance(value, Metres) else plain


LENGTH = Kind("a positive length in the input's unit", "> 0", _positive, float)


def read_length(word: str, whole: float = LONGEST_SIDE) -> float | Metres | None:
    """Read a number, a share of a whole, or a length with a unit; None for anything else."""
    found = _TYPED.fullmatch(word.strip())
    try:
        value = float(found[1]) if found else None
    except ValueError:
        value = None
    if found is None or value is None:
        return None
    if found[2] in UNITS:
        return Metres(word.strip(), value, found[2])
    return value / 100 * whole if found[2] == "%" else value


def read_lengths(given: Mapping[str, Any]) -> dict[str, Any]:
    """Put numbers in place of text: those in metres under the option's name and ``_abs``.

    Raises
    ------
    OptionError
        Text is no length, or no length of this option.
    """
    taken = dict(given)
    for name in TAKEN:
        word = taken.get(name)
        if not isinstance(word, str):
            continue
        value = read_length(word, OF.get(name, LONGEST_SIDE))
        if value is None or (isinstance(value, Metres) and name not in IN_METRES):
            lengths = ", a share such as 5%, or a length such as 5mm" if name in IN_METRES else " or a share such as 5%"
            raise OptionError(f"{name} is {shown(word)}; it has to be a number{lengths}.")
        if isinstance(value, Metres):
            if (length := taken.get(f"{name}_abs")) is not None:
                raise OptionError(f"{name} is {shown(word)} and {name}_abs is {shown(length)}; give one of them.")
            del taken[name]
            taken[f"{name}_abs"] = value
        else:
            taken[name] = value
    return taken


def in_unit(given: Mapping[str, Any], metres: float | None, name: str) -> dict[str, Any]:
    """Put lengths in metres into the unit of a mesh of that name, which is so many metres.

    Raises
    ------
    OptionError
        The unit of the mesh is not known.
    """
    taken = dict(given)
    for option, value in given.items():
        if isinstance(value, Metres):
            if metres is None:
                flag = f"--{option.replace('_', '-')}"
                raise OptionError(
                    f"{option.removesuffix('_abs')} is {value.word}, but {name} does not say its unit: give unit "
                    f"(--unit mm, cm, m or in), or {option} ({flag}) in the mesh's own."
                )
            taken[option] = value / metres
    return taken


def as_given(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Put text in place of lengths in metres, as `read_lengths` takes it."""
    texts = {name: value.word for name, value in plain.items() if isinstance(value, Metres)}
    others = {name: value for name, value in plain.items() if name not in texts}
    return others | {name.removesuffix("_abs"): word for name, word in texts.items()}


def unit_of(given: Mapping[str, Any]) -> str | None:
    """The unit in which a length was given, first of all the threshold; None if none was."""
    found = (given.get(f"{name}_abs") for name in IN_METRES)
    return next((one.unit for one in found if isinstance(one, Metres)), None)


def relative(name: str, length: float, scale: float, bounds: tuple[float, float]) -> float:
    """Get what a length in the input's unit is in the frame; `scale` is units of the frame per unit of the input.

    Raises
    ------
    OptionError
        The length is too small or too large for the object.
    """
    number, (least, most) = length * scale, bounds
    if not least <= number <= most:
        share = 100 / LONGEST_SIDE
        given = f"{name}_abs (--{name.replace('_', '-')} as a length) is {share * number:.3g}% of this object's"
        side = f"longest side, {LONGEST_SIDE / scale:.4g} in its unit"
        between = f"it has to be between {share * least:g}% and {share * most:g}%"
        raise OptionError(f"{given} {side}; {between}: is the unit right (--unit)?")
    return number
