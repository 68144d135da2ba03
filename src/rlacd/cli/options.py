"""Conversion of command-line options to the keyword arguments of `rlacd.decompose`."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

from rlacd.cli.parameters import Parameters, chosen, option_parameters
from rlacd.errors import OptionError
from rlacd.options import CONCAVITY, VOLUME, Options
from rlacd.options.fields import about
from rlacd.options.navigable import NAVIGABLE, SpaceOptions

_SPACE = tuple(field.name for field in dataclasses.fields(SpaceOptions))

_LENGTH = re.compile(r"([-+.\deE]+)\s*(%|m|cm|mm)")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def how_parameters() -> Parameters:
    """Make the parameters that control the decomposition."""
    return option_parameters(Options) | option_parameters(SpaceOptions)


def decompose_options(given: dict[str, Any], *, metres: bool = False) -> dict[str, Any]:
    """Keep the options that were given, and build the criterion from its own options.

    Parameters
    ----------
    given : dict
        Options that control the decomposition, by name; None if not given.
    metres : bool
        Whether the mesh is in metres, so that lengths with a unit can be taken.

    Returns
    -------
    dict
        Keyword arguments of `rlacd.decompose`: defaults are stated once, by its options.

    Raises
    ------
    OptionError
        Options contradict each other or are malformed.
    """
    given = _lengths(chosen(given), metres)
    space = {name: given.pop(name) for name in _SPACE if name in given}
    criterion = given.pop("criterion", CONCAVITY)
    if criterion not in (CONCAVITY, VOLUME, NAVIGABLE):
        raise OptionError(f"criterion is {criterion!r}; it has to be {CONCAVITY}, {VOLUME} or {NAVIGABLE}.")
    if criterion == VOLUME:
        if "tolerance" in space:
            given["volume_tolerance"] = space.pop("tolerance")
        if space:
            raise OptionError(f"{_typed(next(iter(space)), space)} needs --criterion navigable.")
        if "threshold" in given or "threshold_abs" in given:
            raise OptionError("--threshold belongs to --criterion concavity; give --tolerance instead, such as 1%.")
        return {**given, "criterion": VOLUME}
    if "volume_of" in given:
        raise OptionError("--volume-of needs --criterion volume.")
    if criterion == CONCAVITY:
        if space:
            needed = f"{VOLUME} or {NAVIGABLE}" if "tolerance" in space else NAVIGABLE
            raise OptionError(f"{_typed(next(iter(space)), space)} needs --criterion {needed}.")
        return given
    if "threshold" in given or "threshold_abs" in given:
        raise OptionError("--threshold belongs to --criterion concavity; give --radius and --tolerance instead.")
    from rlacd.criteria import NavigableSpace

    if "seeds" in space:
        space["seeds"] = [_numbers("--seed-point", text, 3) for text in space["seeds"]]
    if "closed_planes" in space:
        space["closed_planes"] = [_plane(text) for text in space["closed_planes"]]
    return {**given, "criterion": NavigableSpace(**space)}


def _typed(name: str, space: dict[str, Any]) -> str:
    """Spell an option as on the command line."""
    yes, _, no = about(SpaceOptions, name).flags[0].partition("/")
    return no if space[name] is False else yes


def _lengths(given: dict[str, Any], metres: bool) -> dict[str, Any]:
    """Parse lengths: a number, a share of the longest side (5%), or metres (0.05m)."""
    taken = dict(given)
    for name, of_longest in (("threshold", 2.0), ("overlap", 2.0), ("radius", 1.0), ("tolerance", 1.0)):
        word = taken.get(name)
        if not isinstance(word, str):
            continue
        found = _LENGTH.fullmatch(word.strip())
        value = _number(found[1] if found else word)
        if value is None:
            raise OptionError(
                f"--{name} is {word!r}; it has to be a number, a share such as 5%, or a length in metres."
            )
        unit = found[2] if found else None
        if unit in METRES:
            if not metres:
                raise OptionError(
                    f"--{name} is {word}, but the file does not say its unit; give --{name}-abs in the file's own unit."
                )
            if f"{name}_abs" in taken:
                raise OptionError(f"--{name} and --{name}-abs are both lengths; give one of the two.")
            del taken[name]
            taken[f"{name}_abs"] = value * METRES[unit]
        else:
            taken[name] = value / 100 * of_longest if unit == "%" else value
    return taken


def unit_given(how: dict[str, Any]) -> str | None:
    """The unit in which the threshold was given; None if in the frame or the input's own."""
    found = _LENGTH.fullmatch(str(how.get("threshold") or "").strip())
    return found[2] if found else None


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    values = [_number(word) for word in text.split(",")]
    found = tuple(value for value in values if value is not None)
    if len(found) != count or len(values) != count:
        raise OptionError(
            f"{option} is {text!r}; it takes {count} numbers separated by commas, such as {'0,0,1,0'[: 2 * count - 1]}."
        )
    return found


def _plane(text: str) -> tuple[tuple[float, ...], float]:
    *normal, offset = _numbers("--closed-plane", text, 4)
    return tuple(normal), offset
