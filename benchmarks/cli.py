"""What the commands share: which meshes, where results go, limits; errors as one sentence."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_type_hints

import typer

from benchmarks.methods import make_method
from benchmarks.runner import Bench, Limits, find_meshes
from benchmarks.store import Store
from benchmarks.tables import Page
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import OptionError

Parameters: TypeAlias = dict[str, tuple[Any, Any]]
"""Parameters of a command: name to default and annotation."""

REQUIRED = inspect.Parameter.empty
"""The default of a parameter that is required."""

Meshes: TypeAlias = Annotated[Path, typer.Argument(help="A folder of meshes, of any depth.", show_default=False)]
Out: TypeAlias = Annotated[Path, typer.Option("--out", "-o", help="Folder of results, which a next run goes on with.")]
Threshold: TypeAlias = Annotated[float, typer.Option("--threshold", "-t", help="Concavity threshold.")]

RUNS: Parameters = {
    "listed": (
        None,
        Annotated[Path | None, typer.Option("--list", help="File with a mesh a line, relative to the folder.")],
    ),
    "first": (None, Annotated[int | None, typer.Option(min=1, help="Only the first so many.", show_default=False)]),
    "limit": (600.0, Annotated[float, typer.Option(min=0.01, help="Seconds a method may take for one mesh.")]),
    "memory": (12.0, Annotated[float, typer.Option(min=0.0, help="GB a process may use (Linux); 0: no limit.")]),
    "jobs": (1, Annotated[int, typer.Option(min=1, help="Processes at a time, of one thread each.")]),
    "threads": (1, Annotated[int, typer.Option(min=1, help="Above 1: do all again with so many, for the wall time.")]),
}
"""Options of every command that runs methods on meshes: name to default and annotation."""


def experiment(
    app: typer.Typer, name: str, check: Callable[..., object] = lambda **_: None, tasks: int = 1
) -> Callable[[Callable[..., Page]], Callable[..., Page]]:
    """Make a command of a function that takes a `Bench` and its own options, and returns a page.

    Parameters
    ----------
    app : typer.Typer
    name : str
        Of the command and of its page.
    check : callable
        Gets the command's own options before a file is read or written: raises if an extra or a tool is missing.
    tasks : int
        Tasks that a process does.
    """

    def register(make_page: Callable[..., Page]) -> Callable[..., Page]:
        hints = get_type_hints(make_page, include_extras=True)
        own = {key: (p.default, hints[key]) for key, p in list(inspect.signature(make_page).parameters.items())[1:]}

        def run(meshes: Path, out: Path, **given: Any) -> None:
            chosen = {key: given.pop(key) for key in own}
            with exit_codes():
                check(**chosen)
                names = find_meshes(meshes, given["listed"])[: given["first"]]
                limits = Limits(given["limit"], int(given["memory"] * 2**30), given["jobs"], tasks, given["threads"])
                store = Store(out)
                try:
                    write(make_page(Bench(meshes, names, store, limits, typer.echo), **chosen), out, name)
                finally:
                    store.close()

        parameters: Parameters = {"meshes": (REQUIRED, Meshes), "out": (REQUIRED, Out), **own, **RUNS}
        app.command(name)(_command(run, inspect.getdoc(make_page) or "", parameters))
        return make_page

    return register


def _command(run: Callable[..., None], text: str, parameters: Parameters) -> Callable[..., None]:
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


def write(page: Page, folder: Path, name: str) -> None:
    """Print a page, and save it."""
    typer.echo(f"\n{page}")
    typer.echo(f"wrote {page.save(folder, name)}")


def words(given: str) -> list[str]:
    """Words with commas between, each once."""
    return list(dict.fromkeys(word.strip() for word in given.split(",") if word.strip()))


def check_methods(methods: str, **_: object) -> None:
    """Report unknown and missing methods before any work."""
    if not words(methods):
        raise OptionError("--methods is empty; name at least one.")
    for name in words(methods):
        make_method(name)
