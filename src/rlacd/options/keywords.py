"""Options as arguments of a function: in its signature and docstring, and which one a wrong name meant."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, ParamSpec, TypeVar

from rlacd.options.fields import About, stated_in
from rlacd.options.lengths import TAKEN

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


def meant(word: str, known: Collection[str]) -> str:
    """The end of a sentence, which names the known word most like another one; empty if none is like it."""
    alike = difflib.get_close_matches(word, known, 1)
    return f"; did you mean {alike[0]}?" if alike else ""


def check_names(function: str, given: Iterable[str], known: Collection[str], elsewhere: Sequence[type] = ()) -> None:
    """Refuse an argument that a function does not take; `elsewhere` are options that Python gives otherwise.

    Raises
    ------
    TypeError
        It names the function and what was meant.
    """
    for name in given:
        if name not in known:
            places = [place for options in elsewhere if (place := stated_in(options, name))]
            hint = f"; it belongs to {places[0]}." if places else meant(name, known)
            if name == "tolerance" and "threshold" in known:
                hint += " How far hulls may be from the mesh is threshold='10mm'."
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")


def taking(options: type[Any], *others: type[Any]) -> Callable[[Callable[Given, Returned]], Callable[Given, Returned]]:
    """State the options of dataclasses in the signature of a function that ends with ``**options``.

    Its docstring explains those of the first, before what it says of ``**options``. Defaults of the others are its own.
    """
    fields, more = dataclasses.fields(options), [field for one in others for field in dataclasses.fields(one)]
    known: dict[str, About] = {field.name: field.metadata["option"] for field in fields}
    names = {flag: name for name, each in known.items() for flag in each.flags[0].split("/")}

    def explained(name: str, kind: str) -> str:
        said = re.sub(r"--[a-z-]+", lambda flag: f"`{names.get(flag[0], flag[0][2:])}`", known[name].python_help)
        said += f" Default: {known[name].usual}." if known[name].usual else ""
        return f"    {name} : {kind}\n{textwrap.indent(textwrap.fill(said, 112), ' ' * 8)}\n"

    def completed(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
        signature, keyword = inspect.signature(function), inspect.Parameter.KEYWORD_ONLY
        own = [one for one in signature.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
        own += [inspect.Parameter(f.name, keyword, default=f.default, annotation=_type(f)) for f in fields]
        own += [inspect.Parameter(f.name, keyword, default=None, annotation=_type(f)) for f in more]
        function.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
        said = "".join(explained(field.name, _type(field)) for field in fields)
        function.__doc__ = (function.__doc__ or "").replace("    **options\n", f"{said}    **options\n")
        return function

    return completed


def _type(field: dataclasses.Field[Any]) -> str:
    """What a function takes for an option: a length as text too."""
    return str(field.type).replace("float", "float | str") if field.name in TAKEN else str(field.type)
