"""Commands from options that are stated once: typer's parameters, built from the fields of a dataclass."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Collection
from typing import Annotated, Any

import typer

from rlacd.options.fields import About

Parameters = dict[str, tuple[Any, Any]]
"""Parameters of a command: name to default and annotation."""

REQUIRED = inspect.Parameter.empty
"""The default of a parameter that is required."""


def command(run: Callable[..., None], text: str, parameters: Parameters) -> Callable[..., None]:
    """Give a function of keyword arguments the signature and help that typer inspects."""
    run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
            for name, (default, annotation) in parameters.items()
        ]
    )
    run.__annotations__ = {name: annotation for name, (_, annotation) in parameters.items()}
    run.__doc__ = text
    return run


def option_parameters(
    options: type[Any], *, only: Collection[str] | None = None, note: str = "default: "
) -> Parameters:
    """Make a parameter for each field of a dataclass; the default is None.

    Parameters
    ----------
    options : type
        A dataclass of fields declared with `rlacd.options.fields.option`.
    only : collection of str, optional
        The fields to include.
    note : str
        Text before each default in the help.
    """
    parameters: Parameters = {}
    for field in dataclasses.fields(options):
        known: About = field.metadata["option"]
        if only is not None and field.name not in only:
            continue
        kind = list[known.kind.typed] if known.repeated else known.kind.typed  # type: ignore[name-defined]
        declared = typer.Option(
            *known.flags,
            help=_help(known, note),
            metavar=known.metavar,
            rich_help_panel=known.panel,
            show_default=False,
        )
        parameters[field.name] = (None, Annotated[kind | None, declared])
    return parameters


def chosen(given: dict[str, Any]) -> dict[str, Any]:
    """Keep the options that were given; defaults are stated once, by the fields."""
    return {name: value for name, value in given.items() if value is not None and value != []}


def taken(given: dict[str, Any], options: type[Any]) -> dict[str, Any]:
    """Remove the options of a dataclass from `given` and return them."""
    names = {field.name for field in dataclasses.fields(options)} & set(given)
    return chosen({name: given.pop(name) for name in sorted(names)})


def _help(known: About, note: str) -> str:
    """Build the help text; ``[`` is escaped, since it begins markup."""
    facts = [f"{note}{known.usual}"] if known.usual not in ("", "–") else []
    if known.kind.values and known.kind.values.replace(" ", "|") != known.metavar:
        facts.append(known.kind.values)
    behind = f" [dim]\\[{'; '.join(facts)}][/dim]" if facts else ""
    return known.help.replace("[", "\\[") + behind
