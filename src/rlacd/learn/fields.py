"""Fields of option dataclasses that carry their own help and range, and the check of what was given."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from typing import Any

from rlacd.errors import OptionError


def option(
    default: Any, text: str, *, least: float = -math.inf, most: float = math.inf, one_of: tuple[str, ...] = ()
) -> Any:
    """Declare a field with its help and its range."""
    metadata = {"help": text, "least": least, "most": most, "one_of": one_of}
    return dataclasses.field(default=default, metadata=metadata)


def check_fields(options: Any) -> None:
    """Check every field of a dataclass declared with `option`.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """
    for field in dataclasses.fields(options):
        given = getattr(options, field.name)
        kind = type(field.default)
        ok = isinstance(given, kind) if kind is not float else isinstance(given, (int, float))
        if not ok or (kind is not bool and isinstance(given, bool)):
            raise OptionError(f"{field.name} is {given!r}; it has to be of type {kind.__name__}.")
        least, most, one_of = (field.metadata[name] for name in ("least", "most", "one_of"))
        if kind in (int, float) and not least <= given <= most:
            raise OptionError(f"{field.name} is {given!r}; it has to be between {least} and {most}.")
        if one_of and given not in one_of:
            raise OptionError(f"{field.name} is {given!r}; it has to be one of {', '.join(one_of)}.")


def require_same(before: Mapping[str, Any], now: Any, may_change: Collection[str]) -> None:
    """Refuse options that differ from those a run began with; an option that the run is older than had its default.

    Raises
    ------
    OptionError
        One that may not change does.
    """
    for name, value in dataclasses.asdict(now).items():
        was = before.get(name, getattr(type(now), name))
        if name not in may_change and was != value:
            raise OptionError(
                f"{name} is {value!r}, but was {was!r} when the run began; "
                "resume with the same options, or begin another run."
            )


def refuse_unknown(known: Any, given: Mapping[str, Any], command: str) -> None:
    """Refuse names that are no fields of the dataclass `known`.

    Raises
    ------
    OptionError
        There is one.
    """
    for unknown in sorted(set(given) - {field.name for field in dataclasses.fields(known)}):
        raise OptionError(f"there is no option {unknown!r}; see `rlacd {command} --help`.")
