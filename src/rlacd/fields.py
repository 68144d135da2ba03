"""Options stated once: a dataclass whose fields carry their type, range, help and place on the command line.

Checking what was given, the command line, its help and the table of the README are all made from these fields. Nothing
here imports a library, so that ``--help`` does not wait for one.
"""

from __future__ import annotations

import dataclasses
import math
import numbers
import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from rlacd.errors import OptionError

LARGEST_INTEGER = 2**63 - 1
"""Where no other bound is given: what kernels and files can hold."""

LONGEST_SHOWN = 80
"""Characters of a value that a message shows."""


@dataclasses.dataclass(frozen=True)
class Kind:
    """What values an option takes.

    Attributes
    ----------
    rule
        What a value has to be, as the end of a sentence.
    values
        The same in a few characters, for tables; empty where the help says it.
    read
        Turns a value into a plain one; raises any exception where it is no such value.
    typed
        What the command line turns a word into.
    textual
        Whether values are strings.
    """

    rule: str
    values: str
    read: Callable[[Any], Any]
    typed: type
    textual: bool = False


def number(
    least: float = -math.inf,
    most: float = math.inf,
    *,
    above: float = -math.inf,
    rule: str | None = None,
    typed: type = float,
) -> Kind:
    """A finite number from `least` to `most` that is larger than `above`."""

    def read(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise TypeError
        plain = float(value)
        if not (math.isfinite(plain) and least <= plain <= most and plain > above):
            raise ValueError
        return plain

    rule = rule or _interval("a number", "a positive number" if above == 0 else None, least, most)
    return Kind(rule, "> 0" if above == 0 else _interval("", None, least, most), read, typed)


def integer(least: int | None = None, most: int | None = None, *, rule: str | None = None) -> Kind:
    """A whole number from `least` to `most`."""
    low, high = -math.inf if least is None else least, LARGEST_INTEGER if most is None else most

    def read(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise TypeError
        plain = int(value)
        if not low <= plain <= high:
            raise ValueError
        return plain

    greatest = math.inf if most is None else most
    return Kind(rule or _interval("an integer", None, low, greatest), _interval("", None, low, greatest), read, int)


def _interval(what: str, positive: str | None, least: float, most: float) -> str:
    if positive is not None:
        return positive
    low, high = (_plain(bound) for bound in (least, most))
    if math.isinf(least) and math.isinf(most):
        return what
    if math.isinf(most):
        return f"{what}, at least {low}" if what else f"≥ {low}"
    if math.isinf(least):
        return f"{what}, at most {high}" if what else f"≤ {high}"
    return f"{what} between {low} and {high}" if what else f"{low} to {high}"


def _plain(bound: float) -> str:
    return "2**63 - 1" if bound == 2**63 - 1 else str(bound) if isinstance(bound, int) else f"{bound:g}"


def flag() -> Kind:
    """True or False."""

    def read(value: Any) -> bool:
        # numpy's own bool is no bool; it is not imported just to ask.
        if not isinstance(value, bool) and (type(value).__module__, type(value).__name__) not in NUMPY_BOOLS:
            raise TypeError
        return bool(value)

    return Kind("True or False", "", read, bool)


NUMPY_BOOLS = {("numpy", "bool"), ("numpy", "bool_")}


def one_of(names: tuple[str, ...], *, rule: str | None = None) -> Kind:
    """One of some words."""

    def read(value: Any) -> str:
        return names[names.index(_text(value))]

    return Kind(rule or f"one of {', '.join(names)}", " ".join(names), read, str, textual=True)


def text(rule: str = "a string", values: str = "", accepts: Callable[[str], bool] = bool) -> Kind:
    """A string that `accepts` says yes to; by default any that is not empty."""

    def read(value: Any) -> str:
        plain = _text(value)
        if not accepts(plain):
            raise ValueError
        return plain

    return Kind(rule, values, read, str, textual=True)


def path_like(rule: str = "a path") -> Kind:
    """Where a file is."""

    def read(value: Any) -> str:
        return _text(os.fspath(value))

    return Kind(rule, "", read, Path, textual=True)


def custom(rule: str, read: Callable[[Any], Any], values: str = "", *, typed: type = str) -> Kind:
    """Whatever `read` takes; it raises where it does not."""
    return Kind(rule, values, read, typed, textual=True)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return str.__str__(value)


@dataclasses.dataclass(frozen=True)
class About:
    """What is known of an option beside its name, type and default.

    Attributes
    ----------
    help
        One or two sentences, for the command line and the table.
    kind
        The values it takes.
    optional
        Whether None, its default, is one of them.
    usual
        The default in words, where None or the plain value does not tell.
    panel
        The heading it stands under in the command's help.
    flags
        Its names on the command line, where they are not ``--`` and its own; none for an option of Python alone.
    metavar
        The word for its value in the help.
    python
        How Python gives it, where that is not its name as an argument; empty where Python has no such option.
    repeated
        Whether the command line takes it several times.
    """

    help: str
    kind: Kind
    optional: bool = False
    usual: str | None = None
    panel: str | None = None
    flags: tuple[str, ...] | None = None
    metavar: str | None = None
    python: str | None = None
    repeated: bool = False


def option(default: Any, help: str, kind: Kind | None = None, *, keyword: bool = False, **about: Any) -> Any:
    """Declare a field with what is known of it.

    Parameters
    ----------
    default
        With None, the option may be left out.
    help : str
    kind : Kind, optional
        Told by the default where it is left out, within the bounds ``least`` and ``most`` or the words ``one_of``.
    keyword : bool
        Whether it is given by its name only.
    **about
        Fields of `About`.
    """
    bounds = {name: about.pop(name) for name in ("least", "most", "one_of") if name in about}
    if kind is None:
        kind = _kind_of(default, **bounds)
    known = About(help, kind, optional=default is None, **about)
    return dataclasses.field(default=default, kw_only=keyword, metadata={"option": known})


def _kind_of(default: Any, least: float | None = None, most: float | None = None, one_of: Any = ()) -> Kind:
    if one_of:
        return _one_of(tuple(one_of))
    if isinstance(default, bool):
        return flag()
    if isinstance(default, int):
        return integer(None if least is None else int(least), None if most is None else int(most))
    if isinstance(default, float):
        return number(-math.inf if least is None else least, math.inf if most is None else most)
    return text(accepts=lambda value: True)


_one_of = one_of


def about(options: Any, name: str) -> About:
    """Look up what is known of an option of a dataclass."""
    known: About = next(f for f in dataclasses.fields(options) if f.name == name).metadata["option"]
    return known


def check_fields(options: Any) -> None:
    """Check every field of a frozen dataclass declared with `option`, and put plain values in their place.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """
    for field in dataclasses.fields(options):
        object.__setattr__(options, field.name, checked(options, field.name, getattr(options, field.name)))


def checked(options: Any, name: str, value: Any, *, called: str | None = None) -> Any:
    """Get the plain value of what was given for an option of a dataclass.

    Raises
    ------
    OptionError
        It is of the wrong type or out of its range.
    """
    known = about(options, name)
    if value is None and known.optional:
        return None
    return read(known.kind, called or name, value)


def read(kind: Kind, name: str, value: Any) -> Any:
    """Get the plain value of what was given under a name.

    Raises
    ------
    OptionError
        It is no value of this kind.
    """
    try:
        return kind.read(value)
    except OptionError:
        raise
    except Exception:  # an object of the caller's may raise anything when it is asked what it is
        pass
    string = ", a string" if isinstance(value, str) and not kind.textual else ""
    raise OptionError(f"{name} is {shown(value)}{string}; it has to be {kind.rule}.")


def shown(value: object) -> str:
    """Get a value as one short line, whatever it is."""
    try:
        words = " ".join(repr(value).split())
    except Exception:  # an object that cannot say what it is; an integer of thousands of digits
        words = f"an object of type {type(value).__name__}"
    return words if len(words) <= LONGEST_SHOWN else words[: LONGEST_SHOWN - 3] + "..."


def check_callback(name: str, value: Any, taken: str) -> None:
    """Check that something is a function that can be called with one argument, or None.

    Raises
    ------
    OptionError
        It is not.
    """
    if value is None:
        return
    import inspect

    fits = callable(value) and not inspect.iscoroutinefunction(value)
    try:
        if fits:
            inspect.signature(value).bind(None)
    except ValueError:  # a function written in C that does not say what it takes
        fits = not isinstance(value, type)
    except Exception:
        fits = False
    if not fits:
        raise OptionError(f"{name} is {shown(value)}; it has to be a function that takes {taken}.")


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
