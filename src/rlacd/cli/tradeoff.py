"""The command `rlacd tradeoff`: how many hulls a mesh takes at several thresholds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rlacd.cli.commands import Argument, Command, Option, options_of
from rlacd.cli.decompose import ROBOTS
from rlacd.cli.exit_codes import ExitCode, give, say
from rlacd.cli.lean import import_trimesh
from rlacd.cli.options import decompose_options
from rlacd.cli.pipes import refuse_stdin
from rlacd.errors import OptionError
from rlacd.options import Options
from rlacd.options.output import OutputOptions
from rlacd.plain_json import to_json

TAKEN = (
    *("threshold", "criterion", "max_hulls", "threshold_abs", "volume_tolerance", "volume_of", "max_vertices"),
    *("max_faces", "preset", "detail", "merge", "policy", "openings", "unit", "scale", "quality", "seed", "threads"),
    "timeout",
)


def _tradeoff(
    mesh: Path,
    picture: str | None,
    as_json: bool,
    quiet: bool | None,
    package_dirs: Sequence[str] | None,
    **how: Any,
) -> None:
    """Show how many hulls each of ten thresholds leads to.

    \b
    Examples:
      rlacd tradeoff chair.glb
      rlacd tradeoff chair.glb --picture curve.png
      rlacd tradeoff chair.glb --max-hulls 16
      rlacd tradeoff bracket.step -t 0.2mm
      rlacd tradeoff robot.urdf

    --threshold is the finest to try, 0.02 by default, of a robot 0.6% of its longest side; the coarsest is 25 times
    that. A star marks the knee, beyond which a finer threshold costs ever more hulls, or the finest with at most
    --max-hulls. The hulls are those of --quality fast: a search finds fewer.
    """
    refuse_stdin(mesh)
    is_robot = mesh.suffix.lower() in ROBOTS
    if package_dirs and not is_robot:
        raise OptionError("--package-dir is for robots, a .urdf or .xml file as input.")
    import_trimesh(mesh)
    if picture is not None:
        from rlacd.viewer.picture import check_picture

        check_picture(picture)
    options = decompose_options(how)
    from rlacd.cli.terminal import watching, writing
    from rlacd.io.robots.coarser import RobotTradeoff, tradeoff_of
    from rlacd.io.robots.read import read_robot
    from rlacd.thresholds import Tradeoff, tradeoff

    found: Tradeoff | RobotTradeoff
    with watching(quiet=bool(quiet)) as watch:
        if is_robot:
            found = tradeoff_of(read_robot(mesh, package_dirs or ()), {**options, "progress": watch})
        else:
            found = tradeoff(mesh, **options, progress=watch)
    give(to_json(found.as_dict()) if as_json else f"{found}\n")
    points = found.total if isinstance(found, RobotTradeoff) else found.rows
    if found.pick is None and points:
        say("none of these thresholds gives so few hulls; rlacd decompose --max-hulls finds the tightest that does.")
    if picture is not None and points:
        with writing("picture", picture, quiet=bool(quiet)):
            found.save_picture(picture)
    if not found.complete:
        raise SystemExit(ExitCode.STOPPED_EARLY)


COMMAND = Command(
    "tradeoff",
    _tradeoff,
    [
        Argument("mesh", "IN", "The mesh or robot, as for decompose."),
        Option("as_json", "--json", is_flag=True, default=False, help="Print JSON instead of a table."),
        *options_of(OutputOptions, only=("picture", "quiet", "package_dirs")),
        *options_of(Options, only=TAKEN),
    ],
    first=("as_json", "picture", "quiet", *TAKEN[:3], "preset", "timeout"),
)
