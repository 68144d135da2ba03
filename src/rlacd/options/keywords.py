"""Names of options that a function does not have: which one was meant."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable, Collection, Sequence
from typing import ParamSpec, TypeVar

from rlacd.options.fields import stated_in

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


def meant(word: str, known: Collection[str]) -> str:
    """A question that names the known word that looks most like another one; empty if none does."""
    alike = difflib.get_close_matches(word, known, 1)
    return f" Did you mean {alike[0]!r}?" if alike else ""


def unknown_option(function: str, name: str, known: Collection[str], elsewhere: Sequence[type] = ()) -> TypeError:
    """The error for an argument that a function does not take; `elsewhere` are options that Python gives otherwise."""
    places = [place for options in elsewhere if (place := stated_in(options, name))]
    hint = f" It belongs to {places[0]}." if places else meant(name, known)
    return TypeError(f"{function}() got an unexpected keyword argument {name!r}.{hint}")


def suggesting(
    *elsewhere: type,
) -> Callable[[Callable[Given, Returned]], Callable[Given, Returned]]:
    """Let a function name the argument that was meant by an unknown one, as Python 3.13 does."""

    def completed(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
        known = inspect.signature(function).parameters

        @functools.wraps(function)
        def call(*args: Given.args, **given: Given.kwargs) -> Returned:
            for name in given:
                if name not in known:
                    raise unknown_option(function.__name__, name, known, elsewhere)
            return function(*args, **given)

        return call

    return completed
