"""The command `rlacd batch`: a folder of meshes in one run, on this machine or on a cluster."""

from __future__ import annotations

import re
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rlacd.cli.commands import Argument, Command, options_of, taken
from rlacd.cli.exit_codes import ExitCode, give, say
from rlacd.cli.lean import ctrl_c_at_once
from rlacd.cli.options import PoolOptions, decompose_options, how
from rlacd.errors import OptionError
from rlacd.options.fields import check_fields, option, stated
from rlacd.options.output import OutputOptions
from rlacd.options.robots import RobotOptions
from rlacd.plain_json import printable

if TYPE_CHECKING:
    from rlacd.batch import Batch

Redo = Literal["none", "failed", "all"]

WRITTEN = ("density", "mass", "up", "one_mesh", "keep_input")
"""Options of `rlacd decompose` that describe how hulls are written."""


@stated(panel="Batch")
@dataclass(frozen=True)
class BatchOptions:
    """What is done to which meshes."""

    output: str = option(
        "",
        flags=("--output", "-o"),
        metavar="OUT",
        usual="",
        help="The folder of the results. Required.",
    )
    glob: str = option(
        "**", usual="", help="Only meshes that match: 'chair_*.obj' in any folder, 'furniture/*' by the whole path."
    )
    fallback: bool = option(True, usual="fallback", help="Give a mesh that fails its convex hull.")
    shard: str = option(
        "1/1",
        metavar="K/N",
        usual="",
        help="Only the K-th of N parts of the meshes: one run for each K, on machines that share a disk.",
    )
    folders: bool = option(False, help="Write a folder for each mesh, with a file for each hull.")
    redo: Redo = option("none", one_of=Redo, help="Which meshes to do again: none, those that failed (failed), or all.")
    file_type: str | None = option(
        None,
        flags=("--format",),
        metavar="EXT",
        usual="what --preset says, or glb",
        help="The format of each result: glb, obj, ply, stl, mjcf, urdf, sdf, usd, unreal or godot.",
    )
    threads: int = option(1, least=1, help="Threads for each mesh.")
    dry_run: bool = option(False, help="List the meshes that would be decomposed, and write nothing.")

    def __post_init__(self) -> None:
        if self.output in ("", "-") or "://" in self.output:
            raise OptionError(
                "a batch needs -o with a folder for its results; to stdout or an address it cannot write."
            )
        check_fields(self)
        self.part()

    def part(self) -> tuple[int, int]:
        """K and N of the shard."""
        found = re.fullmatch(r"([1-9]\d{0,8})/([1-9]\d{0,8})", self.shard)
        part, parts = map(int, found.groups()) if found else (1, 0)
        if part > parts:
            raise OptionError(f"--shard is {self.shard!r}; it has to be K/N, from 1/N to N/N, such as 3/16.")
        return part, parts


def _batch(assets: Path, quiet: bool | None, **given: Any) -> None:
    """Decompose every mesh in a folder, skipping those already done.

    \b
    Examples:
      rlacd batch assets/ -o hulls/
      rlacd batch assets/ -o hulls/ --glob 'furniture/*.obj' --preset mujoco --jobs 8
      rlacd batch assets/ -o hulls/ --dry-run
      rlacd batch assets/ -o hulls/ --shard 3/16

    A mesh whose process dies or needs too much memory is tried once more. If that fails too, or the mesh takes longer
    than --limit, it is given its convex hull. OUT/manifest.jsonl records the outcome of each mesh. To resume after an
    interruption, run the same command again. Ctrl-C or SIGTERM finishes what is running; twice quits.
    """
    with ctrl_c_at_once():
        from rlacd.batch import Batch, JobSpec

    for name in taken(given, RobotOptions):
        flag = {"links": "link"}.get(name, name)
        raise OptionError(f"--{flag} is for one robot: run  rlacd decompose ROBOT --{flag} ...  for each.")
    own, where = BatchOptions(**taken(given, BatchOptions)), PoolOptions(**taken(given, PoolOptions))
    if where.jobs == 0:
        raise OptionError("--jobs is 0; a batch needs at least 1 process.")
    written = {"file_type": own.file_type, **{name: given.pop(name) for name in WRITTEN}}
    options = decompose_options({**given, "threads": own.threads})
    spec = JobSpec.of(options, folders=own.folders, **written)
    work = Batch(assets, Path(own.output), spec, where.limits(), own.fallback, own.glob, own.redo, own.part())
    if own.dry_run:
        _print_plan(work)
    else:
        _run(work, where, quiet=bool(quiet))


def _print_plan(batch: Batch) -> None:
    from rlacd.batch.assets import result_ending
    from rlacd.cli.terminal import counted

    plan = batch.plan()
    todo = [asset for asset, finished in plan if not finished]
    for asset in todo:
        result = asset.place + (result_ending(asset.name, batch.spec.ending) or "/")
        give(printable(f"{asset.name} -> {result}") + "\n")
    done = len(plan) - len(todo)
    say(f"{counted(len(plan), 'mesh', 'meshes')}: {done} done, {len(todo)} to do; nothing was written")


def _run(batch: Batch, where: PoolOptions, *, quiet: bool) -> None:
    from rlacd.cli.batch_screen import Screen, summary_lines
    from rlacd.cli.terminal import graceful_stop
    from rlacd.run import available_cpus

    with (
        graceful_stop("what is running will be finished") as stop,
        where.open(available_cpus()) as pool,
        closing(Screen(quiet=quiet)) as screen,
    ):
        summary = batch.run(pool, screen, stop)
    if not quiet:
        say("\n".join(summary_lines(summary, str(batch.out), screen.told)))
    if summary.stopped:
        raise SystemExit(ExitCode.STOPPED_EARLY)
    if summary.failures:
        raise SystemExit(ExitCode.SOME_FAILED)
    if summary.uncovered:
        raise SystemExit(ExitCode.UNCOVERED)


_OWN = [*options_of(BatchOptions), *options_of(PoolOptions), *options_of(OutputOptions, only=(*WRITTEN, "quiet"))]
_ROBOT = options_of(RobotOptions)
for _option in _ROBOT:
    _option.hidden = True  # they are refused, with a sentence
_HOW = [option for option in how() if option.name not in {own.name for own in _OWN}]

COMMAND = Command(
    "batch",
    _batch,
    [Argument("assets", "ASSETS", "A folder of meshes, of any depth."), *_OWN, *_ROBOT, *_HOW],
    first=(
        *(own.name for own in _OWN if own.panel != "Output"),
        *("threshold", "quality", "max_hulls", "max_vertices", "preset", "quiet"),
    ),
)
