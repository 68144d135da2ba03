"""The command `rlacd decompose`: options, files, and one call."""

from __future__ import annotations

import dataclasses
import os
import sys
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from rlacd.cli.commands import Argument, Command, Option, chosen, options_of, taken
from rlacd.cli.exit_codes import ExitCode, give, say
from rlacd.cli.lean import import_trimesh
from rlacd.cli.options import decompose_options, how, link_lengths
from rlacd.cli.pipes import STDIO, file_for, stdin_as_file, stdout_name
from rlacd.errors import ImplausibleBodyWarning, MeshFileError, OptionError
from rlacd.io.read import READERS
from rlacd.io.read.open_file import missing
from rlacd.options.output import REPORTS, OutputOptions
from rlacd.options.robots import RobotOptions
from rlacd.run import Progress, ProgressCallback

ROBOTS = (".urdf", ".xml")
MESH = (
    f"The mesh: {', '.join(READERS)}. It need not be closed or clean. Or a robot, .urdf or .xml (MJCF), whose "
    "collision meshes are to be replaced. - reads stdin."
)

LOG_EVERY = 30.0
"""Seconds between two lines in a log about a robot that takes long, as between those of a batch."""

FROM = "What stdin holds, if IN is -: obj, stl, ...  [default: told from its content]"

FIRST = (
    *("output", "threshold", "quality", "max_hulls", "max_vertices"),
    *("preset", "criterion", "picture", "report", "timeout"),
)
"""The options that ``--help`` shows; ``--help-all`` shows all."""


def _decompose(mesh: Path, source: str | None, **how: Any) -> None:
    """Turn a mesh into convex hulls for collision.

    \b
    Examples:
      rlacd decompose chair.glb
      rlacd decompose chair.glb -o chair_hulls.obj --threshold 0.02
      rlacd decompose chair.glb -o hulls/ --format stl --max-vertices 64
      rlacd decompose arm.dae -o arm.glb --picture arm.png --report - | jq .hulls
      rlacd decompose chair.glb -o chair.xml --preset mujoco
      rlacd decompose robot.urdf -o robot_acd.urdf
      cat chair.obj | rlacd decompose - --from obj -o - --format stl > hulls.stl
      rlacd decompose house.glb --criterion navigable --radius-abs 0.3 --tolerance-abs 0.05

    Ctrl-C or SIGTERM once stops and writes the result so far; twice quits at once.
    """
    asked, robots = OutputOptions(**taken(how, OutputOptions)), taken(how, RobotOptions)
    if more := click.get_current_context().args:
        if len(more) == 1 and not os.path.exists(more[0]):
            raise OptionError(f"the name of the output follows -o: rlacd decompose {mesh} -o {more[0]}")
        many = f"rlacd batch {mesh.parent} -o hulls/ --glob '*{mesh.suffix or '.obj'}'"
        raise OptionError(f"decompose takes one mesh, not {1 + len(more)}; for many, put them in a folder: {many}.")
    if asked.output is None and str(mesh) == STDIO:
        if sys.stdout is not None and sys.stdout.isatty():
            raise OptionError("the hulls would go to the terminal: give -o a file name, or - to print them anyway.")
        asked = dataclasses.replace(asked, output=STDIO)
    with stdin_as_file(mesh, source) as file:
        complete = _run(file, asked, robots, how)
    if not complete:
        raise SystemExit(ExitCode.STOPPED_EARLY)


def _run(mesh: Path, asked: OutputOptions, robots: dict[str, Any], how: dict[str, Any]) -> bool:
    """Check everything, then do it; returns whether it is complete."""
    _check_input(mesh)
    import_trimesh(mesh)
    if STDIO in (asked.report, asked.output):
        give("")  # before any work
    options = decompose_options(how)
    wanted = _named(mesh, asked, options.get("preset"))
    stage = _stage(mesh, wanted, apart=robots.get("per") == "mesh")
    robot = mesh.suffix.lower() in ROBOTS or stage is not None
    _check_output(mesh, wanted)
    _check_robot(asked, wanted) if robot else _check_mesh(mesh, wanted, robots)
    if wanted.balls is not None and isinstance(options.get("criterion", ""), str):
        raise OptionError("--balls needs --criterion navigable.")
    run = partial(_rewrite, stage, RobotOptions(**link_lengths(robots))) if robot else _write
    return run(mesh, wanted, options)


def _write(mesh: Path, wanted: OutputOptions, options: dict[str, Any]) -> bool:
    """Decompose a mesh and write all requested files; returns whether it is complete."""
    from rlacd.cli.terminal import summary, watching, writing
    from rlacd.decompose_mesh import decompose_quietly
    from rlacd.plain_json import to_json

    up, quiet = wanted.up, bool(wanted.quiet)
    with watching(quiet=quiet) as watch:
        result = decompose_quietly(mesh, **options, progress=watch)
    place = str(wanted.output)
    names = ("file_type", "density", "mass", "one_mesh", "keep_input", "scene")
    written = chosen({name: getattr(wanted, name) for name in names})
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always", ImplausibleBodyWarning)
        with file_for(place, wanted.file_type) as file:
            result.save(file, up=up, **written)
    if not quiet:
        say(summary(result, "stdout" if place == STDIO else place))
    for doubt in doubts:
        say(f"  warning: {doubt.message}")
    extras: dict[str, tuple[str | None, Callable[[str], object]]] = {
        "report": (wanted.report, partial(result.save_report, up=up)),
        "balls": (wanted.balls, result.save_balls),
        "picture": (wanted.picture, partial(result.save_picture, up=up)),
    }
    if wanted.report == STDIO:
        give(to_json(result.report))
        del extras["report"]
    for what, (path, write) in extras.items():
        if path is not None:
            with writing(what, path, quiet=quiet):
                write(path)
    return result.report.complete


def _rewrite(stage: Any, how: RobotOptions, robot: Path, wanted: OutputOptions, options: dict[str, Any]) -> bool:
    """Replace the collision meshes of a robot, or of a stage that has been read; returns whether all are complete."""
    from rlacd.cli.terminal import rewrite_summary, watching, writing
    from rlacd.io.robots.rewrite import rewrite, rewrite_quietly
    from rlacd.plain_json import to_json

    with watching(quiet=bool(wanted.quiet)) as watch:
        watch = watch if wanted.quiet else _told_in_logs(watch)
        options, place, flat = {**options, "progress": watch}, str(wanted.output), bool(wanted.keep_input)
        if stage is not None:
            done = rewrite(stage, Path(place), options, how, keep_input=flat)
        else:
            given = {"package_dirs": wanted.package_dirs or (), "keep_input": flat, **vars(how)}
            done = rewrite_quietly(robot, place, **given, **options)
    if not wanted.quiet:
        say(rewrite_summary(done))
    if wanted.report == STDIO:
        give(to_json(done.as_dict()))
    elif wanted.report is not None:
        with writing("report", wanted.report, quiet=bool(wanted.quiet)):
            done.save_report(wanted.report)
    return done.complete


def _told_in_logs(watch: ProgressCallback) -> ProgressCallback:
    """Say every `LOG_EVERY` seconds which link of a robot is under way; on a terminal, a bar shows it."""
    if sys.stderr is not None and sys.stderr.isatty():
        return watch
    link, told = "", time.monotonic()

    def told_too(progress: Progress) -> object:
        nonlocal link, told
        if progress.stage.startswith("link "):
            link = f"{progress.stage} ({progress.done + 1} of {progress.total})"
        elif time.monotonic() - told >= LOG_EVERY:
            told = time.monotonic()
            say(f"{link}: {progress.stage}")
        return watch(progress)

    return told_too


def _stage(mesh: Path, wanted: OutputOptions, *, apart: bool) -> Any:
    """The USD stage with colliding meshes, if that is the input and the output is a stage too; else None."""
    if any(path.suffix.lower() not in (".usd", ".usda", ".usdc") for path in (mesh, Path(str(wanted.output)))):
        return None
    from rlacd.io.robots.read import robot_or_none

    return robot_or_none(mesh, apart=apart)


def _named(mesh: Path, asked: OutputOptions, preset: str | None) -> OutputOptions:
    """Fill in the output path and format that the preset or the input determines."""
    from rlacd.io.write.target import MODELS, file_kind

    ending, file_type = file_kind(asked.file_type, preset)
    if mesh.suffix.lower() in ROBOTS:
        ending = mesh.suffix
    beside = str(mesh.parent / f"{mesh.stem or 'mesh'}_hulls{ending}")
    output = beside if asked.output is None else asked.output
    model, ending = MODELS.get(str(file_type)), Path(output).suffix.lower().lstrip(".")
    if asked.file_type is None and (model is None or ending not in model.endings):
        file_type = None
    return dataclasses.replace(asked, output=output, file_type=file_type)


def _check_mesh(mesh: Path, wanted: OutputOptions, robots: dict[str, Any]) -> None:
    """Check before any work that all outputs can be written."""
    from rlacd.io.write import file_stem, hull_target
    from rlacd.io.write.balls import check_balls
    from rlacd.io.write.folder import check_names

    target = hull_target(stdout_name(str(wanted.output), wanted.file_type), wanted)
    if target.is_folder:
        stem = file_stem(mesh.stem)
        check_names(target.path, stem, [f"{stem}_000.{target.file_type}"])  # the one that every result has
    for flag in ["package-dir"] * bool(wanted.package_dirs) + [{"links": "link"}.get(name, name) for name in robots]:
        raise OptionError(f"--{flag} is for robots, a .urdf or .xml file as input.")
    if wanted.picture is not None:
        from rlacd.viewer.picture import check_picture

        check_picture(wanted.picture, up=wanted.up)
    if wanted.balls is not None:
        check_balls(Path(wanted.balls))


def _check_robot(asked: OutputOptions, wanted: OutputOptions) -> None:
    """Reject options for single meshes."""
    if wanted.output == STDIO:
        raise OptionError("a robot is written as several files, which cannot go to stdout: give -o a file name.")
    for name in ("picture", "balls", "file_type", "density", "mass", "one_mesh", "scene"):
        if getattr(asked, name) is not None:
            spelled = "format" if name == "file_type" else name.replace("_", "-")
            raise OptionError(f"--{spelled} is for a single mesh; leave it out for a robot.")


def _check_input(mesh: Path) -> None:
    """Report a missing input before any problem with the output; loading reports everything else."""
    if os.path.isdir(mesh):
        raise MeshFileError(f"{mesh} is a folder; for all meshes in it run  rlacd batch {mesh} -o hulls/")
    if not os.path.exists(mesh):
        raise missing(mesh)


def _check_output(mesh: Path, wanted: OutputOptions) -> None:
    """Check that no file is written twice, that the input is never overwritten, and that the report can be written."""
    from rlacd.io.write.target import checked_place

    seen = {_same(mesh): "the input"}
    for name, flag in (("output", "-o"), ("report", "--report"), ("picture", "--picture"), ("balls", "--balls")):
        path = getattr(wanted, name)
        if path is None:
            continue
        place = path if path == STDIO else _same(path)
        if place in seen:
            raise OptionError(f"{flag} {path} would overwrite {seen[place]}; choose another name.")
        if name == "report" and path != STDIO:
            checked_place(path, "the report", REPORTS)
        seen[place] = "the hulls" if name == "output" else f"what {flag} writes"


def _same(path: str | Path) -> str:
    return os.path.normcase(os.path.realpath(path))  # unlike Path.resolve, accepts circular links


COMMAND = Command(
    "decompose",
    _decompose,
    [
        Argument("mesh", "IN", MESH),
        Option("source", "--from", metavar="EXT", panel="Input", help=FROM),
        *options_of(OutputOptions),
        *options_of(RobotOptions),
        *how(),
    ],
    first=FIRST,
    context_settings={"allow_extra_args": True},
)
