"""Commands from options that are stated once: click's parameters, built from the fields of dataclasses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import click

from rlacd.cli.exit_codes import EPILOG, give
from rlacd.options.fields import About, shown

ARGUMENTS, OPTIONS = "Arguments", "Options"
"""Headings of the help."""


class Argument(click.Argument):
    """A required word of the command line, with a help text."""

    panel = ARGUMENTS

    def __init__(self, name: str, metavar: str, text: str) -> None:
        super().__init__([name], metavar=metavar, type=_PATH)
        self.text = text

    def get_help_record(self, ctx: click.Context) -> tuple[str, str]:
        """Name and help, as for an option."""
        return str(self.metavar), self.text


class Option(click.Option):
    """An option under a heading of the help; None unless it is given."""

    def __init__(self, *words: str, panel: str = OPTIONS, **known: Any) -> None:
        usual = {} if known.get("required") else {"default": None}  # to click, None is a value
        super().__init__(list(words), **{**usual, **known})
        self.panel = panel


def help_option() -> click.Option:
    """Make ``--help``; stdout may be full or closed when it prints."""

    def show(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
        if wanted and not ctx.resilient_parsing:
            give(ctx.get_help() + "\n")
            ctx.exit()

    known: dict[str, Any] = {"is_flag": True, "is_eager": True, "expose_value": False, "callback": show}
    return click.Option(["-h", "--help"], help="Show this message and exit.", **known)


class Command(click.Command):
    """A command whose help has headings.

    Parameters
    ----------
    name : str
    run : callable
        Called with the value of each parameter by its name. Its docstring is the help.
    parameters : sequence of Argument or Option
    first : collection of str
        The options that ``--help`` shows, by name; ``--help-all`` shows all. All if there are none.
    """

    def __init__(
        self,
        name: str,
        run: Callable[..., None],
        parameters: Sequence[Argument | Option],
        first: Collection[str] = (),
        **settings: Any,
    ) -> None:
        params: list[click.Parameter] = [*parameters]
        if first:
            params.append(_help_all())
        self._first = first
        super().__init__(name, callback=run, params=params, help=run.__doc__, epilog=EPILOG, **settings)

    def get_help_option(self, ctx: click.Context) -> click.Option:
        """What shows the help."""
        return help_option()

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the parameters under their headings."""
        panels: dict[str, list[tuple[str, str]]] = {ARGUMENTS: [], OPTIONS: []}
        for param in self.get_params(ctx):
            panel, short = getattr(param, "panel", OPTIONS), bool(self._first) and not ctx.meta.get(_ALL)
            if short and panel not in (ARGUMENTS, OPTIONS):
                panel = OPTIONS if param.name in self._first else ""
            if panel and (record := param.get_help_record(ctx)) is not None:
                panels.setdefault(panel, []).append(record)
        for panel, records in panels.items():
            if records:
                with formatter.section(panel):
                    formatter.write_dl(records)


_ALL = "rlacd.help_all"


def _help_all() -> Option:
    def show(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
        if wanted:
            ctx.meta[_ALL] = True
            give(ctx.get_help() + "\n")
            ctx.exit()

    text = "Show all options and exit."
    return Option("--help-all", is_flag=True, is_eager=True, expose_value=False, callback=show, help=text)


def options_of(options: type[Any], *, only: Collection[str] | None = None, note: str = "default: ") -> list[Option]:
    """Make an option for each field of a dataclass; None unless it is given, since defaults are stated once.

    Parameters
    ----------
    options : type
        A dataclass of fields declared with `rlacd.options.fields.option`.
    only : collection of str, optional
        The fields to include.
    note : str
        Text before each default in the help.
    """
    made = []
    for field in dataclasses.fields(options):
        known: About = field.metadata["option"]
        if only is None or field.name in only:
            made.append(
                Option(
                    field.name,
                    *known.flags,
                    panel=known.panel or OPTIONS,
                    type=_typed(known),
                    is_flag=known.kind.typed is bool,
                    multiple=known.repeated,
                    metavar=known.metavar,
                    help=_help(known, note),
                )
            )
    return made


def chosen(given: dict[str, Any]) -> dict[str, Any]:
    """Keep the options that were given; defaults are stated once, by the fields."""
    return {name: list(v) if isinstance(v, tuple) else v for name, v in given.items() if v is not None and v != ()}


def taken(given: dict[str, Any], options: type[Any]) -> dict[str, Any]:
    """Remove the options of a dataclass from `given` and return those that were given."""
    names = {field.name for field in dataclasses.fields(options)} & set(given)
    return chosen({name: given.pop(name) for name in sorted(names)})


_PATH = click.Path(path_type=Path)


def _typed(known: About) -> Any:
    """What click turns words into; a word that is no number is told what it has to be."""
    kind = known.kind
    if kind.typed not in (int, float):
        return _PATH if kind.typed is Path else kind.typed

    def number(word: str) -> Any:
        try:
            return kind.typed(word)
        except ValueError:
            raise click.ClickException(f"{known.flags[0]} is {shown(word)}; it has to be {kind.rule}.") from None

    number.__name__ = {int: "integer", float: "float"}[kind.typed]  # as the help calls it
    return number


def _help(known: About, note: str) -> str:
    facts = [f"{note}{known.usual}"] if known.usual not in ("", "–") else []
    if known.kind.values and known.kind.values.replace(" ", "|") != known.metavar:
        facts.append(known.kind.values)
    return known.help + (f"  [{'; '.join(facts)}]" if facts else "")
