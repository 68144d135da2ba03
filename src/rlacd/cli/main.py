"""The command line: one module per command, imported when the command is used."""

from __future__ import annotations

import atexit
import gc
import importlib
import io
import os
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

from rlacd._version import __version__
from rlacd.cli.commands import help_option
from rlacd.cli.exit_codes import EPILOG, ExitCode, exit_codes, give, leave, say
from rlacd.errors import DecompositionWarning, OptionError
from rlacd.options.keywords import meant
from rlacd.plain_json import printable

COMMANDS = ("decompose", "tradeoff", "info", "view", "batch", "train")
COMPLETE = "_RLACD_COMPLETE"
"""The variable by which a shell asks for completions."""


class Commands(click.Group):
    """Finds a command in the module of its name, and suggests the right one; every error becomes an exit code."""

    def make_context(self, *args: Any, **more: Any) -> click.Context:
        """Read the words before the command."""
        with exit_codes():
            return super().make_context(*args, **more)

    def invoke(self, ctx: click.Context) -> Any:
        """Read the other words and run the command."""
        with exit_codes():
            return super().invoke(ctx)

    def get_help_option(self, ctx: click.Context) -> click.Option:
        """What shows the help."""
        return help_option()

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All commands, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"rlacd.cli.{cmd_name}").COMMAND
        return command

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command that the arguments start with."""
        word = args[0]
        if word not in COMMANDS and (Path(word).suffix or os.path.exists(word)):
            verb = "batch" if os.path.isdir(word) else "decompose"
            import shlex

            typed = shlex.join(["rlacd", verb, *args])
            say(f"rlacd: {printable(word)} is not a command; did you mean  {printable(typed)}")
            raise SystemExit(ExitCode.BAD_INPUT)
        if word not in COMMANDS and not word.startswith("-"):
            others = f"; use one of {', '.join(COMMANDS)}"
            raise OptionError(f"there is no command {word!r}{meant(word, COMMANDS) or others}")
        return super().resolve_command(ctx, args)


def _print_and_exit(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    if not value:
        return
    complete = param.name == "show_completion" and get_completion_class(value)
    give(complete(app, {}, "rlacd", COMPLETE).source() + "\n" if complete else f"rlacd {__version__}\n")
    ctx.exit()


_EAGER: dict[str, Any] = {"is_eager": True, "expose_value": False, "callback": _print_and_exit}

app = Commands(
    name="rlacd",
    help="Approximate convex decomposition: any mesh in, few tight convex hulls out.",
    epilog=EPILOG,
    no_args_is_help=True,
    params=[
        click.Option(["--version"], is_flag=True, help="Show the version and exit.", **_EAGER),
        click.Option(
            ["--show-completion"],
            metavar="bash|zsh|fish",
            type=click.Choice(["bash", "zsh", "fish"]),
            help="Print what completes commands and options in a shell, and exit.",
            **_EAGER,
        ),
    ],
)


def main() -> None:
    """Run the command line."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # JSON is UTF-8, and file names hold more than a code page of Windows
        sys.stdout.reconfigure(encoding="utf-8")
    warnings.simplefilter("ignore", DecompositionWarning)  # commands print them themselves
    # Little of what a command allocates can be freed before it ends, so look for that rarely.
    gc.set_threshold(100_000, 50, 50)
    try:
        app(prog_name="rlacd", complete_var=COMPLETE)
    except SystemExit as ended:
        # Taking the interpreter down takes a tenth of a small mesh's time, and after a stop more than is left.
        late = ended.code == ExitCode.STOPPED_EARLY
        if late or threading.active_count() == 1:
            if not late:
                atexit._run_exitfuncs()
            leave(ended.code if isinstance(ended.code, int) else int(ended.code is not None))
        raise
