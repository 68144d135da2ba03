"""Options stated once: a dataclass whose fields carry their meaning, type, range and place on the command line.

Lengths: see `rlacd.options.lengths`.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import numbers
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, get_args

from rlacd.errors import OptionError

LARGEST_INTEGER = 2**63 - 1
"""Bound of integers without another: what kernels and files can hold."""

TYPED = "On the command line: "
"""Begins a paragraph of an option's help that is for the command line only."""

LONGEST_SHOWN = 80
"""Characters of a value that a message shows."""

Stated = TypeVar("Stated")


@dataclasses.dataclass(frozen=True)
class Kind:
    """What values an option takes."""

    rule: str
    """What a value has to be, as the end of a sentence."""
    values: str
    """The same in a few characters, for tables; empty where the help says it."""
    read: Callable[[Any], Any]
    """Turns a value into a plain one; raises any exception for a value of another kind."""
    typed: type
    """What the command line turns a word into."""
    textual: bool = False
    """Whether values are strings."""


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
        plain: float = _within(value, numbers.Real, float, least, most)
        if plain <= above:
            raise ValueError
        return plain

    said, values = ("a positive number", "> 0") if above == 0 else _interval("a number", least, most)
    return Kind(rule or said, values, read, typed)


def integer(least: int | None = None, most: int | None = None, *, rule: str | None = None) -> Kind:
    """A whole number from `least` to `most`."""
    low, high = -math.inf if least is None else least, LARGEST_INTEGER if most is None else most
    said, values = _interval("an integer", low, math.inf if most is None else most)
    return Kind(rule or said, values, lambda value: _within(value, numbers.Integral, int, low, high), int)


def _within(value: Any, taken: type, plain_type: type, least: float, most: float) -> Any:
    if isinstance(value, bool) or not isinstance(value, taken):
        raise TypeError
    plain = plain_type(value)
    if not (least <= plain <= most and math.isfinite(plain)):
        raise ValueError
    return plain


def _interval(what: str, least: float, most: float) -> tuple[str, str]:
    """Say in a sentence and in a table what is taken."""
    low, high = (str(bound) if isinstance(bound, int) else f"{bound:g}" for bound in (least, most))
    if math.isinf(most):
        return (what, "") if math.isinf(least) else (f"{what}, at least {low}", f"≥ {low}")
    if math.isinf(least):
        return f"{what}, at most {high}", f"≤ {high}"
    return f"{what} between {low} and {high}", f"{low} to {high}"


def flag() -> Kind:
    """True or False."""

    def read(value: Any) -> bool:
        if type(value).__name__ not in ("bool", "bool_"):  # numpy's own is no bool; it is not imported just to ask
            raise TypeError
        return bool(value)

    return Kind("True or False", "", read, bool)


def one_of(names: Any, *, rule: str | None = None) -> Kind:
    """One of some words: a tuple of them, or their ``Literal`` type."""
    words: tuple[str, ...] = get_args(names) or tuple(names)
    return custom(rule or f"one of {', '.join(words)}", lambda given: words[words.index(_text(given))], " ".join(words))


def path_like() -> Kind:
    """Where a file is."""
    return custom("a path", lambda value: _text(os.fspath(value)), typed=Path)


def custom(rule: str, read: Callable[[Any], Any], values: str = "", *, typed: type = str) -> Kind:
    """Any value for which `read` does not raise."""
    return Kind(rule, values, read, typed, textual=True)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return str.__str__(value)


@dataclasses.dataclass
class About:
    """What is known of an option beside its name, type and default."""

    kind: Kind
    """The values it takes."""
    optional: bool
    """Whether None, its default, is one of them."""
    flags: tuple[str, ...] = ()
    """Its names on the command line."""
    help: str = ""
    python_help: str = ""
    """What it means, for the command line and the table, and for Python."""
    usual: str = ""
    """The default in words."""
    panel: str | None = None
    """The heading it stands under in the command's help."""
    metavar: str | None = None
    """The word for its value in the help."""
    python: str | None = None
    """How Python gives it, where that is not its name as an argument; empty where Python has no such option."""
    repeated: bool = False
    """Whether the command line takes it several times."""


def option(
    default: Any, panel: str | None = None, kind: Kind | None = None, *, help: str, keyword: bool = False, **about: Any
) -> Any:
    """Declare a field with what is known of it.

    Parameters
    ----------
    default
        With None, the option may be left out.
    panel : str, optional
        The heading it stands under in the command's help.
    kind : Kind, optional
        By default that of the default value, within the bounds ``least`` and ``most`` or the words ``one_of``.
    help : str
        What it means. The first paragraph appears everywhere, those that begin with `TYPED` on the command line only,
        and others in Python only.
    keyword : bool
        Whether it is given by its name only.
    **about
        Fields of `About`, where they are not what its name and default tell.
    """
    bounds = {name: about.pop(name) for name in ("least", "most", "one_of") if name in about}
    if "one_of" in bounds:
        about.setdefault("metavar", "|".join(get_args(bounds["one_of"]) or bounds["one_of"]))
    words = str(default).lower() if isinstance(default, bool) else str(default) or "none"
    about.setdefault("usual", "" if default is None else words)
    first, *others = (" ".join(each.split()) for each in help.split("\n\n"))
    typed = [each.removeprefix(TYPED) for each in others if each.startswith(TYPED)]
    about["help"] = " ".join([first, *(each[0].upper() + each[1:] for each in typed)])
    about["python_help"] = " ".join([first, *(each for each in others if not each.startswith(TYPED))])
    known = About(kind or _kind_of(default, **bounds), default is None, panel=panel, **about)
    return dataclasses.field(default=default, kw_only=keyword, metadata={"option": known})


def _kind_of(default: Any, **bounds: Any) -> Kind:
    if "one_of" in bounds:
        return one_of(bounds["one_of"])
    if isinstance(default, bool):
        return flag()
    if isinstance(default, float):
        return number(**bounds)
    return integer(**bounds) if isinstance(default, int) or bounds else custom("a string", _text)


def stated(panel: str | None = None, python: str = "{}") -> Callable[[type[Stated]], type[Stated]]:
    """Complete the fields of a dataclass by their names.

    Parameters
    ----------
    panel : str, optional
        Heading of the options that state none.
    python : str
        How Python gives an option, with ``{}`` for its name.
    """

    def completed(options: type[Stated]) -> type[Stated]:
        for field in dataclasses.fields(options):  # type: ignore[arg-type]
            known: About = field.metadata["option"]
            word = field.name.replace("_", "-")
            known.flags = known.flags or (f"--{word}/--no-{word}" if field.default is True else f"--{word}",)
            known.panel = known.panel or panel
            known.python = python.format(field.name) if known.python is None else known.python
        return options

    return completed


def about(options: Any, name: str) -> About:
    """Look up what is known of an option of a dataclass."""
    known: About = next(f for f in dataclasses.fields(options) if f.name == name).metadata["option"]
    return known


def stated_in(options: Any, name: str) -> str:
    """How Python gives an option of a dataclass; empty if it has none of that name, or Python none."""
    fields = {field.name: field.metadata["option"] for field in dataclasses.fields(options)}
    return fields[name].python or "" if name in fields else ""


def check_fields(options: Any) -> None:
    """Check every field of a frozen dataclass declared with `option`, and put plain values in their place.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """
    for field in dataclasses.fields(options):
        value = _plain(field.metadata["option"], field.name, getattr(options, field.name))
        object.__setattr__(options, field.name, value)


def checked(options: Any, name: str, value: Any) -> Any:
    """Get the plain value of what was given for an option of a dataclass.

    Raises
    ------
    OptionError
        It is of the wrong type or out of its range.
    """
    return _plain(about(options, name), name, value)


def _plain(known: About, name: str, value: Any) -> Any:
    return None if value is None and known.optional else read(known.kind, name, value)


def read(kind: Kind, name: str, value: Any) -> Any:
    """Get the plain value of what was given under a name.

    Raises
    ------
    OptionError
        The value is not of this kind.
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
    fits = value is None or (callable(value) and not inspect.iscoroutinefunction(value))
    try:
        if fits and value is not None:
            inspect.signature(value).bind(None)
    except Exception as error:  # a function written in C may not say what it takes
        fits = isinstance(error, ValueError) and not isinstance(value, type)
    if not fits:
        raise OptionError(f"{name} is {shown(value)}; it has to be a function that takes {taken}.")
