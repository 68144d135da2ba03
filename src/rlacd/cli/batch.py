"""The command `rlacd batch`: a folder of meshes in one run, on this machine or on a cluster."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rlacd.cli.exit_codes import ExitCode, exit_codes, give, say
from rlacd.cli.options import decompose_options, how_parameters
from rlacd.cli.parameters import REQUIRED, Parameters, command, option_parameters
from rlacd.errors import OptionError
from rlacd.options.output import OutputOptions
from rlacd.run import available_cpus

if TYPE_CHECKING:
    from rlacd.batch import Batch
    from rlacd.pool import Pool

HELP = """Decompose every mesh in a folder, skipping those already done.

\b
[bold]Examples[/bold]
  rlacd batch assets/ -o hulls/
  rlacd batch assets/ -o hulls/ --glob 'furniture/*.obj' --preset mujoco --jobs 8
  rlacd batch assets/ -o hulls/ --dry-run
  rlacd batch assets/ -o s3://bucket/hulls --ray auto

A mesh whose process dies, hangs or needs too much memory is given its convex hull, unless a second
try succeeds; one that hangs has no second try.
OUT/manifest.jsonl records the outcome for each mesh. To resume after an interruption, run the same command again.
Ctrl-C once finishes what is running; twice quits at once.
"""

BATCH_EPILOG = """\b
[bold]Exit codes[/bold]
  0    all done
  1    a bug in rlacd (RLACD_DEBUG=1 shows the traceback)
  2    bad option, or no meshes
  3    the results cannot be written
  4    stopped by Ctrl-C; run again to go on
  5    all done, but some meshes failed or were given their convex hull
  130  interrupted at once; no file is left half-written
"""

BATCH = "Batch"
"""Help panel of this command's own options."""

WRITTEN = ("density", "mass", "up", "one_mesh", "keep_input")
"""Options of `rlacd decompose` that describe how hulls are written."""


def _option(default: Any, kind: Any, *names: str, **about: Any) -> tuple[Any, Any]:
    return default, Annotated[kind, typer.Option(*names, rich_help_panel=BATCH, **about)]


_OWN: Parameters = {
    "assets": (
        REQUIRED,
        Annotated[Path, typer.Argument(metavar="ASSETS", help="A folder of meshes, of any depth.")],
    ),
    "out": _option(
        REQUIRED,
        str,
        "--output",
        "-o",
        metavar="OUT",
        help="A folder, or an address that fsspec knows: s3://bucket/path.",
    ),
    "glob": _option(
        "**", str, help="Only meshes that match: 'chair_*.obj' in any folder, 'furniture/*' by the whole path."
    ),
    "jobs": _option(
        None,
        int | None,
        min=1,
        help="Meshes processed at a time. [dim]\\[default: all cores][/dim]",
        show_default=False,
    ),
    "ray": _option(None, str | None, metavar="ADDRESS", help="Use a Ray cluster: its address, auto, or local."),
    "limit": _option(
        600.0, float, metavar="SECONDS", min=0.1, help="Time limit per mesh; after it the mesh's process is killed."
    ),
    "memory": _option(4.0, float, metavar="GB", min=0.0, help="Memory limit per mesh; 0 means no limit."),
    "fallback": _option(True, bool, "--fallback/--no-fallback", help="Write the convex hull of a mesh that fails."),
    "folders": _option(False, bool, "--folders", help="Write a folder per mesh with one file per hull."),
    "redo": _option(
        "none", str, metavar="WHICH", help="Which meshes to do again: none, those that failed (failed), or all."
    ),
    "folder_format": _option(
        None,
        str | None,
        "--format",
        metavar="EXT",
        help="The format of each result: glb, obj, ply, stl, mjcf, urdf, sdf, usd, unreal or godot. "
        "[dim]\\[default: what --preset says, or glb][/dim]",
        show_default=False,
    ),
    "threads": _option(None, int | None, help="Threads per mesh. [dim]\\[default: 1][/dim]", show_default=False),
    "timeout": _option(
        None,
        float | None,
        metavar="SECONDS",
        help="Stop a mesh after this time and keep the result so far.",
        show_default=False,
    ),
    "dry_run": _option(False, bool, "--dry-run", help="List the meshes that would be processed, and write nothing."),
}


def batch_command() -> Callable[..., None]:
    """Build the command."""

    def batch(**given: Any) -> None:
        with exit_codes():
            own = {name: given.pop(name) for name in _OWN}
            quiet = bool(given.pop("quiet"))
            work = _batch(own, given)
            if not quiet:
                _print_large(work)
            if own["dry_run"]:
                _print_plan(work)
            else:
                _run(work, own, quiet=quiet)

    written = option_parameters(OutputOptions, only=(*WRITTEN, "quiet"))
    return command(batch, HELP, {**_OWN, **{k: p for k, p in {**written, **how_parameters()}.items() if k not in _OWN}})


def _batch(own: dict[str, Any], given: dict[str, Any]) -> Batch:
    from rlacd.batch import REDO, Batch, JobSpec
    from rlacd.pool import ProcessLimits

    if own["redo"] not in REDO:
        raise OptionError(f"--redo is {own['redo']!r}; it has to be one of {', '.join(REDO)}.")
    if own["out"] == "-":
        raise OptionError("a batch cannot be written to stdout; give -o a folder.")
    written = OutputOptions(**{name: given.pop(name) for name in WRITTEN})
    options = decompose_options({**given, "threads": own["threads"], "timeout": own["timeout"]})
    spec = JobSpec.of(
        options,
        file_format=own["folder_format"],
        folders=own["folders"],
        density=written.density,
        up=written.up,
        one_mesh=bool(written.one_mesh),
        mass=written.mass,
        keep_input=bool(written.keep_input),
    )
    limits = ProcessLimits(own["limit"], int(own["memory"] * 2**30))
    return Batch(own["assets"], own["out"], spec, limits, own["fallback"], own["glob"], own["redo"])


def _pool(own: dict[str, Any]) -> Pool:
    from rlacd.pool import open_pool

    return open_pool(own["jobs"] or (None if own["ray"] else available_cpus()), own["ray"])


NAMED = 5
"""Maximum number of large meshes listed by name."""


def _print_large(batch: Batch) -> None:
    """Print one line that lists the large meshes, before any work."""
    from rlacd.plain_json import printable

    large = batch.large()
    if large:
        named = [f"{printable(asset.name)} ({size / 1e6:.0f} MB)" for asset, size in large[:NAMED]]
        more = [f"{len(large) - NAMED} more"] if len(large) > NAMED else []
        count = "1 mesh is" if len(large) == 1 else f"{len(large)} meshes are"
        say(f"{count} large and may take minutes and gigabytes each: {', '.join([*named, *more])}")


def _print_plan(batch: Batch) -> None:
    from rlacd.batch.assets import result_ending
    from rlacd.cli.terminal import counted
    from rlacd.plain_json import printable

    plan = batch.plan()
    for asset, finished in plan:
        if not finished:
            result = asset.place + (result_ending(asset.name, batch.spec.ending) or "/")
            give(printable(f"{asset.name} -> {result}") + "\n")
    done = sum(finished for _, finished in plan)
    say(f"{counted(len(plan), 'mesh', 'meshes')}: {done} done, {len(plan) - done} to do; nothing was written")


def _run(batch: Batch, own: dict[str, Any], *, quiet: bool) -> None:
    from rlacd.cli.batch_screen import Screen, summary_lines

    stop = threading.Event()

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()
        say("stopping; what is running will be finished (Ctrl-C again to quit at once)")

    previous: Any = None
    with suppress(ValueError):  # not in the main thread, which alone receives Ctrl-C
        previous = signal.signal(signal.SIGINT, on_interrupt)
    try:
        with _pool(own) as pool, Screen(quiet=quiet) as screen:
            summary = batch.run(pool, screen, stop)
    finally:
        if previous is not None:
            signal.signal(signal.SIGINT, previous)
    if not quiet:
        say("\n".join(summary_lines(summary, batch.out)))
    if summary.stopped:
        raise typer.Exit(ExitCode.STOPPED_EARLY)
    if summary.failures:
        raise typer.Exit(ExitCode.SOME_FAILED)
