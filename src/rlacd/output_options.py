"""What the command line writes, and how: each option stated once. `rlacd.io.write` checks by them too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rlacd.fields import check_fields, custom, flag, number, one_of, option, path_like, text

Axis = Literal["x", "y", "z"]

OUTPUT = "Output"

DENSITY = 1000.0
"""Water's, where the unit is a metre."""


def _folders(given: Any) -> list[str]:
    if not isinstance(given, (list, tuple)) or not all(isinstance(word, str) for word in given):
        raise TypeError
    return list(given)


@dataclass(frozen=True)
class OutputOptions:
    """Where the hulls go and what is written beside them.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    output: str | None = option(
        None,
        "Where the hulls go: .glb, .obj, .ply or .stl for one file with a node, group or solid per hull; .xml (MJCF), "
        ".urdf, .sdf, .usd, .usda or .usdc for a body with mass, visual mesh and hulls; an existing folder, or a name "
        "ending in /, for one file per hull. An existing file is replaced.",
        text(accepts=lambda given: True),
        panel=OUTPUT,
        flags=("--output", "-o"),
        metavar="OUT",
        usual="IN_hulls beside IN, .glb or what --preset says",
        python=".save(path)",
    )
    file_format: str | None = option(
        None,
        "The format of the files in a folder: obj, glb, ply or stl; or unreal or godot, for a .glb with the mesh and "
        "hulls named for that engine.",
        text("the name of a format, such as obj"),
        panel=OUTPUT,
        flags=("--format",),
        metavar="EXT",
        usual="obj",
        python=".save(file_format=)",
    )
    density: float | None = option(
        None,
        "Mass per cubic unit, for formats that hold masses.",
        number(above=0, rule="a positive mass per cubic unit, such as 1000 for water"),
        panel=OUTPUT,
        usual=f"{DENSITY:g}",
        python=".save(density=)",
    )
    mass: float | None = option(
        None,
        "Mass of the whole body, instead of --density.",
        number(above=0, rule="a positive mass"),
        panel=OUTPUT,
        python=".save(mass=)",
    )
    keep_input: bool | None = option(
        None,
        "In a .glb, the input's own scene with the hulls added under the nodes they belong to; always so with --format "
        "unreal and godot.",
        flag(),
        panel=OUTPUT,
        flags=("--keep-input",),
        python=".save(keep_input=)",
    )
    scene: bool | None = option(
        None,
        "In .xml (MJCF), add a floor and a light and place the body just above the floor, ready for MuJoCo's viewer.",
        flag(),
        panel=OUTPUT,
        flags=("--scene",),
        python=".save(scene=)",
    )
    one_mesh: bool | None = option(
        None,
        "In a .urdf, one collision with all hulls as objects of its mesh, for Bullet.",
        flag(),
        panel=OUTPUT,
        flags=("--one-mesh",),
        python=".save(one_mesh=)",
    )
    package_dirs: list[str] | None = option(
        None,
        "Where a robot's package://NAME/ is; a FOLDER alone may be read and holds packages. May be repeated.",
        custom("a list of strings, NAME=FOLDER or FOLDER", _folders),
        panel=OUTPUT,
        flags=("--package-dir",),
        metavar="NAME=FOLDER",
        repeated=True,
        python="rewrite_robot(package_dirs=)",
    )
    report: str | None = option(
        None,
        "Write all measurements as JSON, or as an HTML page if the name ends in .html; - writes JSON to "
        "stdout, and nothing else there.",
        path_like(),
        panel=OUTPUT,
        metavar="FILE",
        python=".report, .save_report(path)",
    )
    picture: str | None = option(
        None,
        "Draw the input beside its hulls, together and pulled apart. Needs the extra rlacd[view].",
        path_like(),
        panel=OUTPUT,
        metavar="FILE.png",
        python=".picture(path)",
    )
    balls: str | None = option(
        None,
        "Write the balls that no hull touches: .csv (x, y, z, radius) or .glb. Needs --criterion navigable.",
        path_like(),
        panel=OUTPUT,
        metavar="FILE",
        python=".save_balls(path)",
    )
    up: Axis | None = option(
        None,
        "The axis of the mesh that points up, for the picture and for MJCF, SDF and USD.",
        one_of(("x", "y", "z"), rule="x, y or z"),
        panel=OUTPUT,
        metavar="AXIS",
        usual="what the format or file says (y for glb and gltf), else z",
    )
    quiet: bool | None = option(
        None,
        "Print only warnings and errors.",
        flag(),
        panel=OUTPUT,
        flags=("--quiet", "-q"),
        python="",
    )

    def __post_init__(self) -> None:
        check_fields(self)
