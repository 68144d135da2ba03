"""What the commands share: which meshes, where results go, limits; errors as one sentence."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from benchmarks.methods import make_method
from benchmarks.runner import Bench, Limits, find_meshes
from benchmarks.tables import Page
from rlacd.cli.exit_codes import exit_codes
from rlacd.errors import OptionError
from rlacd.pool import ProcessLimits

PATH = click.Path(path_type=Path)

OUT = click.option("--out", "-o", required=True, type=PATH, help="Folder of results, which a next run goes on with.")

RUNS = (
    click.argument("meshes", type=PATH),
    OUT,
    click.option("--list", "listed", type=PATH, help="File with a mesh a line, relative to the folder."),
    click.option("--first", type=click.IntRange(1), help="Only the first so many."),
    click.option("--limit", default=600.0, show_default=True, help="Seconds a method may take for one mesh."),
    click.option("--memory", default=12.0, show_default=True, help="GB a process may hold; 0: no limit."),
    click.option("--jobs", type=click.IntRange(1), default=1, help="Processes at a time, of one thread each."),
    click.option("--threads", type=click.IntRange(1), default=1, help="Do all again with so many, for the wall time."),
    click.option(
        "--warm", is_flag=True, help="One process for many meshes: faster, but its peak memory is not each's."
    ),
)
"""Of every command that runs methods on meshes."""


def experiment(check: Callable[..., object]) -> Callable[[Callable[..., Page]], click.Command]:
    """Make a command of a function that takes a `Bench` and its own options, and returns a page.

    `check` gets the command's own options before a file is read or written: raises if an extra or a tool is missing.
    """

    def register(make_page: Callable[..., Page]) -> click.Command:
        own = list(getattr(make_page, "__click_params__", []))
        name = make_page.__module__.rpartition(".")[2].replace("_", "-")

        def run(meshes: Path, out: Path, **given: Any) -> None:
            chosen = {parameter.name: given.pop(parameter.name) for parameter in own}
            with exit_codes():
                check(**chosen)
                names = find_meshes(meshes, given["listed"])[: given["first"]]
                process = ProcessLimits(given["limit"], int(given["memory"] * 2**30))
                limits = Limits(process, given["jobs"], not given["warm"], given["threads"])
                write(make_page(Bench(meshes, names, out, limits, click.echo), **chosen), out, name)

        vars(run)["__click_params__"] = list(own)
        for decorate in reversed(RUNS):
            decorate(run)
        return click.command(name, help=inspect.getdoc(make_page))(run)

    return register


def write(page: Page, folder: Path, name: str) -> None:
    """Print a page, and save it."""
    click.echo(f"\n{page}")
    click.echo(f"wrote {page.save(folder, name)}")


def words(given: str) -> list[str]:
    """Words with commas between, each once."""
    return list(dict.fromkeys(word.strip() for word in given.split(",") if word.strip()))


def check_methods(methods: str, **_: object) -> None:
    """Report unknown and missing methods before any work."""
    if not words(methods):
        raise OptionError("--methods is empty; name at least one.")
    for name in words(methods):
        make_method(name.partition("@")[0])
