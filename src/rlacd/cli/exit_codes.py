"""Exit codes of the commands, and the conversion of every error into one sentence."""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
from collections.abc import Iterator
from enum import IntEnum
from typing import NoReturn

import click

from rlacd.errors import OutputError, RlacdError, sentence_of
from rlacd.options.keywords import meant


class ExitCode(IntEnum):
    """Exit codes:
    0    done
    1    a bug in rlacd (RLACD_DEBUG=1 shows the traceback)
    2    bad input or option; no meshes
    3    the output cannot be written
    4    stopped early by --timeout, Ctrl-C or SIGTERM; what was written is valid
    5    batch only: some meshes failed or were given their convex hull
    6    batch only: hulls of some meshes miss some of the surface
    130  interrupted at once; no file is left half-written
    """

    OK = 0
    BUG = 1
    BAD_INPUT = 2
    CANNOT_WRITE = 3
    STOPPED_EARLY = 4
    SOME_FAILED = 5
    UNCOVERED = 6
    INTERRUPTED = 130


EPILOG = "\b\n" + inspect.cleandoc(ExitCode.__doc__ or "").replace("\n", "\n  ")
"""The end of every command's help; the mark preserves its lines."""


INTERRUPTED = "interrupted; no file is left half-written."


@contextlib.contextmanager
def exit_codes() -> Iterator[None]:
    """Turn every error into one sentence on stderr and an exit code; RLACD_DEBUG=1 lets the traceback through."""
    try:
        yield
    except click.exceptions.Exit:
        raise  # click's own
    except click.ClickException as error:
        if isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):  # the help is its message
            raise
        _fail(_told(error), ExitCode.BAD_INPUT)
    except KeyboardInterrupt:
        _fail(INTERRUPTED, ExitCode.INTERRUPTED)
    except BrokenPipeError:
        _silence_stdout()  # its reader (head, jq) has closed it
        raise SystemExit(ExitCode.CANNOT_WRITE) from None
    except OutputError as error:
        _fail(error, ExitCode.CANNOT_WRITE)
    except (RlacdError, MemoryError) as error:
        _fail(sentence_of(error), ExitCode.BAD_INPUT)
    except Exception as error:
        _fail(f"{sentence_of(error)[:-1]}; RLACD_DEBUG=1 shows the traceback.", ExitCode.BUG)


def give(content: str | bytes) -> None:
    """Print what was asked for to stdout.

    Raises
    ------
    OutputError
        It is closed, or its disk is full; a `BrokenPipeError` is passed on.
    """
    if sys.stdout is None:
        raise OutputError("cannot write to stdout: it is closed.")
    try:
        if isinstance(content, bytes):
            sys.stdout.buffer.write(content)
        else:
            sys.stdout.write(content)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _silence_stdout()
        raise OutputError(f"cannot write to stdout ({error.strerror}).") from error


def say(text: str) -> None:
    """Print a line to stderr; stdout is reserved for requested output. A stderr that nobody can read loses it."""
    with contextlib.suppress(OSError, AttributeError):
        sys.stderr.write(f"{text}\n")


def _silence_stdout() -> None:
    """Print nothing more, not even when Python flushes at exit."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def leave(code: int) -> NoReturn:
    """End the process now, even if threads are running; only for when nothing is left to write."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(code)


def _told(error: click.ClickException) -> str:
    """Say in one sentence which word click does not take, and which one was meant."""
    said, hint = error.format_message().rstrip("."), ""
    if isinstance(error, click.NoSuchOption):
        said, hint = f"there is no option {error.option_name}", meant(error.option_name, error.possibilities or ())
    if not hint and isinstance(error, click.UsageError) and error.ctx is not None:
        hint = f"; {error.ctx.command_path} --help shows what it takes"
    return f"{said[0].lower()}{said[1:]}{hint}"


def _fail(message: object, code: ExitCode) -> None:
    if os.environ.get("RLACD_DEBUG") == "1":
        raise
    say(f"rlacd: {message}")
    raise SystemExit(code)
