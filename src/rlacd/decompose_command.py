"""The command `rlacd decompose`: options, files, and one call."""

from __future__ import annotations

import os
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from rlacd.command_options import decompose_options
from rlacd.errors import OptionError
from rlacd.exit_codes import ExitCode, exit_codes

STDOUT = Path("-")
ROBOTS = (".urdf", ".xml")

QUALITY, SPACE, LIMITS, METHOD, RUN, OUTPUT = (
    "How tight",
    "Navigable space (--criterion navigable)",
    "Limits",
    "Method",
    "Running",
    "Output",
)


class Criterion(str, Enum):
    """What --criterion takes."""

    CONCAVITY = "concavity"
    NAVIGABLE = "navigable"


class Quality(str, Enum):
    """What --quality takes."""

    FAST = "fast"
    BALANCED = "balanced"
    BEST = "best"


def decompose(
    mesh: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            help="The mesh: obj, stl, ply, off, glb, gltf, dae, 3mf. It need not be closed or clean. "
            "Or a robot, .urdf or .xml (MJCF), whose collision meshes are to be replaced.",
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            rich_help_panel=OUTPUT,
            help="Where the hulls go: .glb, .obj, .ply or .stl for one file with a node, group or solid a hull; "
            ".xml (MJCF), .urdf, .sdf, .usd, .usda or .usdc for a body with mass, looks and hulls; "
            "an existing folder, or a name ending in /, for one file a hull. An older file is replaced. "
            "[dim]\\[default: IN_hulls beside IN, .glb or what --preset says][/dim]",
            show_default=False,
        ),
    ] = None,
    folder_format: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="EXT",
            rich_help_panel=OUTPUT,
            help="The format of the files in a folder: obj, glb, ply or stl [dim]\\[default: obj][/dim]; or unreal or "
            "godot, for a .glb with the mesh and hulls named for that engine.",
            show_default=False,
        ),
    ] = None,
    density: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=OUTPUT,
            help="Mass per cubic unit, for formats that hold masses. [dim]\\[default: 1000][/dim]",
            show_default=False,
        ),
    ] = None,
    one_mesh: Annotated[
        bool,
        typer.Option(
            "--one-mesh",
            rich_help_panel=OUTPUT,
            help="In a .urdf, one collision with all hulls as objects of its mesh, for Bullet.",
        ),
    ] = False,
    package_dir: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FOLDER",
            rich_help_panel=OUTPUT,
            help="Where a robot's package://NAME/ is; a FOLDER alone may be read and holds packages. May be repeated.",
            show_default=False,
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=OUTPUT,
            help="Write everything measured: as JSON, or as a page to look at if the name ends in .html; "
            "- writes JSON to stdout, and nothing else there.",
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png",
            rich_help_panel=OUTPUT,
            help="Draw the input beside its hulls, together and pulled apart. Needs the extra rlacd\\[view].",
        ),
    ] = None,
    balls: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            rich_help_panel=OUTPUT,
            help="Write the balls that no hull touches: .csv (x, y, z, radius) or .glb. Needs --criterion navigable.",
        ),
    ] = None,
    up: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS",
            rich_help_panel=OUTPUT,
            help="The axis of the mesh that points up, for the picture and for MJCF, SDF and USD: x, y or z. "
            "[dim]\\[default: y for glb and gltf, else z][/dim]",
            show_default=False,
        ),
    ] = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", rich_help_panel=OUTPUT, help="Say nothing unless something is wrong.")
    ] = False,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold",
            "-t",
            rich_help_panel=QUALITY,
            help="The concavity a hull may have, where the longest side of the mesh is 2. Smaller is tighter, with "
            "more hulls: 0.02 is fine, 0.2 coarse. [dim]\\[default: 0.05][/dim]",
            show_default=False,
        ),
    ] = None,
    threshold_m: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=QUALITY,
            help="The same as a length in the mesh's own unit, e.g. 0.002 for 2 mm in a file in metres.",
            show_default=False,
        ),
    ] = None,
    criterion: Annotated[
        Criterion | None,
        typer.Option(
            rich_help_panel=QUALITY,
            help="When a hull is tight enough: concavity (see --threshold), or navigable: it stays out of the space "
            "that a ball of --radius can reach, and what nobody can reach costs nothing. "
            "[dim]\\[default: concavity][/dim]",
            show_default=False,
        ),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=SPACE,
            help="The ball's radius, as a share of the longest side of the mesh. [dim]\\[default: 0.025][/dim]",
            show_default=False,
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=SPACE,
            help="Space nearer to the surface than this may be filled; the same share. [dim]\\[default: 0.05][/dim]",
            show_default=False,
        ),
    ] = None,
    radius_m: Annotated[
        float | None,
        typer.Option(rich_help_panel=SPACE, help="--radius in the mesh's own unit.", show_default=False),
    ] = None,
    tolerance_m: Annotated[
        float | None,
        typer.Option(rich_help_panel=SPACE, help="--tolerance in the mesh's own unit.", show_default=False),
    ] = None,
    reachable_only: Annotated[
        bool | None,
        typer.Option(
            "--reachable-only/--everywhere",
            rich_help_panel=SPACE,
            help="Only what a ball can reach from outside, or every room. [dim]\\[default: reachable-only][/dim]",
            show_default=False,
        ),
    ] = None,
    seed_point: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,Z",
            rich_help_panel=SPACE,
            help="A place balls come from instead of outside, in the mesh's own unit; may be repeated.",
            show_default=False,
        ),
    ] = None,
    closed_plane: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,Z,D",
            rich_help_panel=SPACE,
            help="A plane that balls do not cross, such as the ground 0,0,1,0: they stay where the normal X,Y,Z "
            "points, D its distance from the origin; may be repeated.",
            show_default=False,
        ),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="ENGINE",
            rich_help_panel=LIMITS,
            help="The limits, and the format, of an engine: mujoco, physx, physx-gpu, unity, unreal, newton or bullet. "
            "Other options go before it.",
            show_default=False,
        ),
    ] = None,
    max_hulls: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=LIMITS,
            help="At most this many hulls, even if the threshold must be exceeded; the report says by how much.",
            show_default=False,
        ),
    ] = None,
    max_vertices: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=LIMITS,
            help="At most this many vertices a hull, e.g. 64 for PhysX on a GPU.",
            show_default=False,
        ),
    ] = None,
    max_faces: Annotated[
        int | None,
        typer.Option(rich_help_panel=LIMITS, help="At most this many triangles a hull.", show_default=False),
    ] = None,
    merge: Annotated[
        bool | None,
        typer.Option(
            "--merge/--no-merge",
            rich_help_panel=METHOD,
            help="Join neighbouring hulls again where one hull is tight enough. [dim]\\[default: merge][/dim]",
            show_default=False,
        ),
    ] = None,
    policy: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=METHOD,
            help="What chooses the next cut. [dim]\\[default: greedy][/dim]",
            show_default=False,
        ),
    ] = None,
    resolution: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=METHOD,
            help="Grid cells along the longest side when bodies that are not closed are repaired.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=RUN,
            help="The same seed, input and options give the same bytes. [dim]\\[default: 0][/dim]",
            show_default=False,
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=RUN,
            help="Threads to use; the result does not depend on it. [dim]\\[default: all cores][/dim]",
            show_default=False,
        ),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            rich_help_panel=RUN,
            help="Stop after this time and write what is reached (exit code 4).",
            show_default=False,
        ),
    ] = None,
    quality: Annotated[
        Quality | None,
        typer.Option(
            rich_help_panel=METHOD,
            help="How long to search for fewer hulls: fast hardly, balanced about a second, best until --budget "
            "ends. [dim]\\[default: balanced; fast with --no-merge][/dim]",
            show_default=False,
        ),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            rich_help_panel=METHOD,
            help="How long the search may take. [dim]\\[default: 5 with --quality best][/dim]",
            show_default=False,
        ),
    ] = None,
    search_steps: Annotated[
        int | None,
        typer.Option(
            rich_help_panel=METHOD,
            help="How many steps the search may take; unlike --budget, this gives the same bytes however busy it is. "
            "[dim]\\[default: 16 with --quality balanced][/dim]",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Turn a mesh into convex hulls for collision.

    \b
    [bold]Examples[/bold]
      rlacd decompose chair.glb
      rlacd decompose chair.glb -o chair_hulls.obj --threshold 0.02
      rlacd decompose chair.glb -o hulls/ --format stl --max-vertices 64
      rlacd decompose arm.dae -o arm.glb --picture arm.png --report - | jq .parts
      rlacd decompose chair.glb -o chair.xml --preset mujoco
      rlacd decompose robot.urdf -o robot_acd.urdf
      rlacd decompose house.glb --criterion navigable --radius-m 0.3 --tolerance-m 0.05

    Ctrl-C once stops gracefully and writes what is reached; twice quits at once.
    """
    with exit_codes():
        from rlacd.formats import check_balls, check_file, check_model_options, hull_target, write_file
        from rlacd.show import check_picture, check_up, draw_picture, is_html, save_report_page

        place, folder_format = _output_name(mesh, output, folder_format, preset)
        _check_output(mesh, {"-o": Path(place), "--report": report, "--picture": picture, "--balls": balls})
        robot = mesh.suffix.lower() in ROBOTS
        written = {"density": density, "up": up or _usual_up(mesh)}
        if robot:
            if report is not None and is_html(report):
                raise OptionError("--report as a page belongs to a single mesh; for a robot give a .json file.")
            one_body = {"--picture": picture, "--balls": balls, "--format": folder_format, "--density": density}
            _check_robot({**one_body, "--one-mesh": one_mesh or None})
        else:
            check_model_options(**_chosen({"density": 1.0, **_chosen(written)}))
            hull_target(place, folder_format, one_mesh=one_mesh)
            if package_dir:
                raise OptionError("--package-dir belongs to robots: a .urdf or .xml file as input.")
        if report is not None and report != STDOUT:
            check_file(report)
            check_up(up)
        if picture is not None:
            check_picture(picture, up=up)
        if balls is not None:
            check_balls(balls)
        if criterion != Criterion.NAVIGABLE and balls is not None:
            raise OptionError("--balls needs --criterion navigable.")
        options = decompose_options(
            {
                "criterion": criterion,
                "radius": radius,
                "tolerance": tolerance,
                "radius_m": radius_m,
                "tolerance_m": tolerance_m,
                "reachable_only": reachable_only,
                "seed_point": seed_point,
                "closed_plane": closed_plane,
                "threshold": threshold,
                "threshold_m": threshold_m,
                "max_hulls": max_hulls,
                "max_vertices": max_vertices,
                "max_faces": max_faces,
                "merge": merge,
                "policy": policy,
                "resolution": resolution,
                "seed": seed,
                "threads": threads,
                "timeout": timeout,
                "quality": quality,
                "budget": budget,
                "search_steps": search_steps,
                "preset": preset,
            }
        )
        if robot:
            _rewrite(mesh, place, package_dir or [], report, quiet, options)
            return

        from rlacd.decompose_mesh import decompose as run
        from rlacd.plain_json import to_json
        from rlacd.terminal import Watch, say, summary

        with Watch(quiet=quiet) as watch:
            result = run(mesh, **options, progress=watch)
        result.save(place, file_format=folder_format, one_mesh=one_mesh, **_chosen(written))
        if not quiet:
            say(summary(result, place))
        if report == STDOUT:
            typer.echo(to_json(result.report), nl=False)
        elif report is not None and is_html(report):
            save_report_page(result, report, up=up or _usual_up(mesh))
        elif report is not None:
            write_file(report, to_json(result.report).encode())
        if balls is not None:
            result.save_balls(balls)
        if picture is not None:
            draw_picture(result, picture, up=up or _usual_up(mesh))
        if not result.report.get("complete", True):
            raise typer.Exit(ExitCode.STOPPED_EARLY)


def _output_name(mesh: Path, output: str | None, file_format: str | None, preset: str | None) -> tuple[str, str | None]:
    """Where to write and in which format, as far as a preset or the input decides that."""
    from rlacd.formats import MODELS
    from rlacd.presets import find_preset

    if output == str(STDOUT):
        raise OptionError("hulls cannot be written to stdout; give -o a file name, and use - with --report only.")
    engine = None if preset is None else find_preset(preset)
    if output is None:
        ending = ".glb" if engine is None else engine.ending
        if mesh.suffix.lower() in ROBOTS:
            ending = mesh.suffix
        elif file_format in MODELS:
            ending = f".{MODELS[file_format][0]}"
        output = str(mesh.parent / f"{mesh.stem or 'mesh'}_hulls{ending}")
    if engine is not None and engine.file_format is not None and file_format is None:
        fits = Path(output).suffix.lower().lstrip(".") in MODELS[engine.file_format]
        file_format = engine.file_format if fits else None
    return output, file_format


def _check_robot(given: dict[str, object]) -> None:
    for option, value in given.items():
        if value is not None:
            raise OptionError(f"{option} belongs to a single mesh; leave it out for a robot.")


def _rewrite(
    robot: Path, place: str, packages: list[str], report: Path | None, quiet: bool, options: dict[str, Any]
) -> None:
    from rlacd.formats import write_file
    from rlacd.plain_json import to_json
    from rlacd.robots import rewrite_robot
    from rlacd.terminal import Watch, rewrite_summary, say

    with Watch(quiet=quiet) as watch:
        done = rewrite_robot(robot, place, package_dirs=packages, **options, progress=watch)
    if not quiet:
        say(rewrite_summary(done))
    told = to_json({str(mesh.path): mesh.result.report for mesh in done.meshes})
    if report == STDOUT:
        typer.echo(told, nl=False)
    elif report is not None:
        write_file(report, told.encode())
    if not done.complete:
        raise typer.Exit(ExitCode.STOPPED_EARLY)


def _check_output(mesh: Path, named: dict[str, Path | None]) -> None:
    """No file may be written twice, and the input never."""
    seen = {_same(mesh): "the input"}
    for option, path in named.items():
        if path is None or path == STDOUT:
            continue
        if _same(path) in seen:
            raise OptionError(f"{option} {path} would overwrite {seen[_same(path)]}; choose another name.")
        seen[_same(path)] = f"what {option} writes"


def _same(path: Path) -> str:
    return os.path.normcase(os.path.realpath(path))  # unlike Path.resolve, at ease with links in a circle


def _usual_up(mesh: Path) -> str:
    return "y" if mesh.suffix.lower() in (".glb", ".gltf") else "z"


def _chosen(options: dict[str, Any]) -> dict[str, Any]:
    """Keep what the user gave: defaults are stated once, by `rlacd.decompose`."""
    return {name: value for name, value in options.items() if value is not None}
