"""The command line: one module per command; this one only assembles them."""

from __future__ import annotations

import contextlib
import gc
import io
import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from rlacd._version import __version__
from rlacd.cli.batch import BATCH_EPILOG, batch_command
from rlacd.cli.decompose import decompose_command
from rlacd.cli.exit_codes import EPILOG, ExitCode, exit_codes, give
from rlacd.cli.train import train_command
from rlacd.cli.view import view
from rlacd.plain_json import printable


class Commands(TyperGroup):
    """Suggests the right command if a file is given in its place."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that the arguments start with."""
        word = args[0]
        if self.get_command(ctx, word) is None and (Path(word).suffix or os.path.exists(word)):
            verb = "batch" if os.path.isdir(word) else "decompose"
            typed = shlex.join(["rlacd", verb, *args])
            typer.echo(f"rlacd: {printable(word)} is not a command; did you mean  {printable(typed)}", err=True)
            raise typer.Exit(ExitCode.BAD_INPUT)
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="rlacd",
    cls=Commands,
    help="Approximate convex decomposition: any mesh in, few tight convex hulls out.",
    epilog=EPILOG,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line: the entry point of the ``rlacd`` script and of ``python -m rlacd``."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # JSON is UTF-8, and file names hold more than a code page of Windows
        sys.stdout.reconfigure(encoding="utf-8")
    # Little of what a command allocates can be freed before it ends, so look for that rarely.
    gc.set_threshold(100_000, 50, 50)
    try:
        app(prog_name="rlacd")
    except SystemExit as ended:
        if ended.code == ExitCode.STOPPED_EARLY:  # late already: freeing thousands of hulls one by one takes long
            with contextlib.suppress(BrokenPipeError):
                sys.stdout.flush()
            os._exit(ExitCode.STOPPED_EARLY)
        raise


def _print_version(wanted: bool) -> None:
    if wanted:
        with exit_codes():
            give(f"rlacd {__version__}\n")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Approximate convex decomposition: any mesh in, few tight convex hulls out."""


app.command("decompose", epilog=EPILOG)(decompose_command())


@app.command(epilog=EPILOG)
def info(
    mesh: Annotated[Path, typer.Argument(metavar="FILE", help="The mesh to look at.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Show what a file contains and how it would be repaired, without decomposing it.

    \b
    [bold]Examples[/bold]
      rlacd info chair.glb
      rlacd info chair.glb --json | jq .repair
    """
    with exit_codes():
        from rlacd.cli.describe import describe, describe_text
        from rlacd.plain_json import printable, to_json

        facts = describe(mesh)
        give(to_json(facts) if as_json else printable(describe_text(facts)))


app.command("view", epilog=EPILOG)(view)
app.command("batch", epilog=BATCH_EPILOG)(batch_command())
app.command("train", epilog=EPILOG)(train_command())
