"""Rewriting a robot: read the file, decompose each solid once, write hulls and file."""

from __future__ import annotations

import inspect
import os
import time
import warnings
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from rlacd.errors import DecompositionWarning, MeshFileError, OptionError
from rlacd.find_parts import Repaired
from rlacd.io.robots.coarser import many_told
from rlacd.io.robots.decomposed import check_options, decomposed_robot, with_lengths
from rlacd.io.robots.read import KINDS, STAGES, is_robot, read_robot
from rlacd.io.robots.rewritten import RewrittenRobot, rewritten
from rlacd.io.robots.robot import Robot
from rlacd.io.write.target import check_file, check_folder, check_name, mesh_folder
from rlacd.options import ELSEWHERE, Options
from rlacd.options.fields import checked, path_like, read, shown
from rlacd.options.keywords import check_names, taking
from rlacd.options.output import OutputOptions
from rlacd.options.robots import RobotOptions
from rlacd.run import ProgressCallback


@taking(RobotOptions, Options)
def rewrite_robot(
    robot: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str] = (),
    keep_input: bool = False,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> RewrittenRobot:
    """Replace every collision mesh of a URDF, MJCF or USD file by its hulls, and keep everything else.

    Parameters
    ----------
    robot : path-like
        ``*.urdf``, ``*.xml`` for MJCF, or a USD stage (``*.usd``, ``*.usda``, ``*.usdc``). Its meshes are looked up
        relative to it and in packages (``package://NAME/...``), never outside the packages it refers to and
        `package_dirs`; a USD stage refers only to files in its folder or below.
    output : path-like
        The new file, of the same kind. Hulls go to a folder beside it, ``robot_acd_urdf`` for ``robot_acd.urdf``. For a
        USD stage it is a layer over the original, which it refers to, and holds the hulls.
    package_dirs : sequence of str
        ``NAME=FOLDER`` says where a package is; ``FOLDER`` alone may be read and is searched for packages.
    keep_input : bool
        Of a USD stage, write one file that holds all of it, instead of a layer over the original.
    progress : callable, optional
        As for `rlacd.decompose`; the `stage` ``link NAME`` comes before those of each link, `done` of `total`.
    **options
        Those of `rlacd.decompose`, for each solid. The criterion is ``distance`` by default, and the threshold 1.5% of
        the robot's longest side, with all joints at zero. `threshold` and `overlap` are relative to that, or with
        ``relative_to="mesh"`` to each solid, whose criterion and threshold are then those of `rlacd.decompose`. Lengths
        such as `threshold_abs` are in the robot's unit, after the scale of a mesh. A `timeout` applies to each solid.

    Returns
    -------
    RewrittenRobot

    Raises
    ------
    MeshError
        The file or one of its meshes cannot be read, is not allowed to be read, or there is none to replace.
    OptionError
        An option is out of range, or `output` is not of the same kind as `robot`.
    OutputError
        The place cannot be written to.

    Warns
    -----
    DecompositionWarning
        What ``warnings`` of the result says, once a call.
    """
    done = rewrite_quietly(
        robot, output, package_dirs=package_dirs, keep_input=keep_input, progress=progress, **options
    )
    if done.warnings:
        said = f"{os.path.basename(robot)}: {' '.join(done.warnings)}"
        warnings.warn(said, DecompositionWarning, stacklevel=2)
    return done


def rewrite_quietly(
    robot: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str] = (),
    keep_input: bool = False,
    progress: ProgressCallback | None = None,
    home: Path | None = None,
    **options: Any,
) -> RewrittenRobot:
    """Rewrite as `rewrite_robot` does, but warn of nothing; `home` is the folder that the result is moved to."""
    source, place = Path(read(path_like(), "robot", robot)), Path(read(path_like(), "output", output))
    check_names("rewrite_robot", options, inspect.signature(rewrite_robot).parameters, ELSEWHERE)
    own = {field.name for field in fields(RobotOptions)}
    asked = RobotOptions(**{name: value for name, value in options.items() if name in own and value is not None})
    options = {name: value for name, value in options.items() if name not in own} | {"progress": progress}
    check_options(options)
    check_places(source, place, asked, keep_input=keep_input)
    packages = checked(OutputOptions, "package_dirs", package_dirs) or ()
    began = time.perf_counter()
    description = read_robot(source, packages, apart=asked.per == "mesh", from_visual=asked.from_visual)
    return rewrite(replace(description, home=home), place, options, asked, keep_input=keep_input, began=began)


def rewrite(
    robot: Robot,
    place: Path,
    options: Mapping[str, Any],
    asked: RobotOptions,
    *,
    keep_input: bool = False,
    began: float | None = None,
) -> RewrittenRobot:
    """Rewrite a robot that has been read, since a time of `time.perf_counter`; see `rewrite_robot`."""
    began = time.perf_counter() if began is None else began
    check_options(options)
    check_places(robot.source, place, asked, keep_input=keep_input)
    robot, options, asked = with_lengths(robot, options, asked)
    repaired: dict[Hashable, Repaired] = {}
    done = decomposed_robot(robot, options, asked, repaired)
    if all(result.report.complete for result in done.results.values()):
        many = many_told(robot, done, repaired)
        done = replace(done, warnings=[*many, *done.warnings])
    pairs = done.pairs if done.samples or robot.is_alone else None
    written = robot.write(place, done.results, pairs, asked, whole=keep_input)
    return rewritten(robot, done, place, written, began)


def check_places(source: Path, place: Path, asked: RobotOptions, *, keep_input: bool) -> None:
    """Check before the work that what is asked is for this kind of file, and can be written.

    Raises
    ------
    MeshFileError
        It is no robot.
    OptionError
        It is not.
    OutputError
        A place cannot be written to.
    """
    ending, stages = source.suffix.lower(), source.suffix.lower() in STAGES
    if keep_input and not stages:
        raise OptionError("keep_input (--keep-input) is for USD stages: URDF and MJCF keep their other files.")
    if not stages and not is_robot(source):
        raise MeshFileError(f"{source} is not a robot file: its name has to end in {' or '.join(KINDS)}.")
    if place.suffix.lower() not in (endings := STAGES if stages else (ending,)):
        raise OptionError(f"{source} can only be rewritten as another {' or '.join(endings)}, not {shown(str(place))}.")
    if os.path.realpath(source) == os.path.realpath(place):
        raise OptionError(f"{place} would overwrite the input; choose another name.")
    check_name(place)
    check_file(place)
    if asked.from_visual and stages:
        raise OptionError("from_visual (--from-visual) is for URDF and MJCF: in a stage, apply PhysicsCollisionAPI.")
    if not stages:
        check_folder(mesh_folder(place, KINDS[ending]))
    if asked.exclude and ending == ".urdf":
        raise OptionError("exclude (--exclude) is for MJCF and USD; for a URDF give srdf (--srdf).")
    if asked.srdf is not None:
        if ending != ".urdf":
            raise OptionError("srdf (--srdf) is for a URDF; for MJCF and USD give exclude (--exclude).")
        if os.path.realpath(asked.srdf) in map(os.path.realpath, (source, place)):
            raise OptionError(f"srdf (--srdf) {asked.srdf} would overwrite the URDF; choose another name.")
        check_file(Path(asked.srdf))
