"""What the command line writes, and how: each option stated once. `rlacd.io.write` checks by them too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from rlacd.errors import OptionError
from rlacd.options.fields import check_fields, custom, flag, number, one_of, option, path_like, stated

Axis = Literal["x", "y", "z"]

DENSITY = 1000.0
"""Density of water, where the unit is a metre."""

PAGES = (".html", ".htm")
REPORTS = (".json", *PAGES)
"""Endings of reports that are pages, and of all."""


def _folders(given: Any) -> list[str]:
    if not isinstance(given, (list, tuple)) or not all(isinstance(word, str) for word in given):
        raise TypeError
    return list(given)


_DENSITY = number(above=0, rule="a positive mass per cubic unit, such as 1000 for water")
_MASS = number(above=0, rule="a positive mass")
_FORMAT = custom("the name of a format, such as obj", lambda given: given.lower().lstrip("."))
_PACKAGES = custom("a list of strings, NAME=FOLDER or FOLDER", _folders)
_AXIS = one_of(Axis, rule="x, y or z")


@stated(panel="Output", python=".save({}=)")
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
        flags=("--output", "-o"),
        metavar="OUT",
        usual="IN_hulls beside IN, .glb or what --preset says",
        python=".save(path)",
        help="""Where the hulls go: .glb, .obj, .ply or .stl for one file with a node, group or solid per hull;
        .xml (MJCF), .urdf, .sdf, .usd, .usda or .usdc for a body with mass, visual mesh and hulls; an existing
        folder, or a name ending in /, for one file per hull. An existing file is replaced, a link refused. -
        writes to stdout what --format says.""",
    )
    file_type: str | None = option(
        None,
        kind=_FORMAT,
        flags=("--format",),
        metavar="EXT",
        usual="obj",
        help="""The format of the files in a folder: obj, glb, ply or stl; or unreal or godot, for a .glb with
        the mesh and hulls named for that engine.""",
    )
    density: float | None = option(
        None, kind=_DENSITY, usual=f"{DENSITY:g}", help="Mass per cubic unit, for formats that hold masses."
    )
    mass: float | None = option(None, kind=_MASS, help="Mass of the whole body, instead of --density.")
    keep_input: bool | None = option(
        None,
        kind=flag(),
        help="""In a .glb, the input's own scene with the hulls added under the nodes they belong to; always so
        with --format unreal and godot. Of a USD stage with colliding meshes, one file that holds all of it, not
        a layer over it.""",
    )
    scene: bool | None = option(
        None,
        kind=flag(),
        help="""In .xml (MJCF), add a floor and a light and place the body just above the floor, ready for
        MuJoCo's viewer.""",
    )
    one_mesh: bool | None = option(
        None, kind=flag(), help="In a .urdf, one collision with all hulls as objects of its mesh, for Bullet."
    )
    package_dirs: list[str] | None = option(
        None,
        kind=_PACKAGES,
        flags=("--package-dir",),
        metavar="NAME=FOLDER",
        repeated=True,
        python="rewrite_robot(package_dirs=)",
        help="Where a robot's package://NAME/ is; a FOLDER alone may be read and holds packages. May be repeated.",
    )
    report: str | None = option(
        None,
        kind=path_like(),
        metavar="FILE",
        python=".save_report(path)",
        help="Write all measurements: .json, or .html for a page; - writes JSON to stdout, and nothing else there.",
    )
    picture: str | None = option(
        None,
        kind=path_like(),
        metavar="FILE.png",
        python=".save_picture(path)",
        help="Draw the input beside its hulls, together and pulled apart. Needs the extra rlacd[view].",
    )
    balls: str | None = option(
        None,
        kind=path_like(),
        metavar="FILE",
        python=".save_balls(path)",
        help="Write the balls that no hull touches: .csv (x, y, z, radius) or .glb. Needs --criterion navigable.",
    )
    up: Axis | None = option(
        None,
        kind=_AXIS,
        metavar="AXIS",
        usual="what the format or file says (y for glb and gltf), else z",
        python="up",
        help="The axis of the mesh that points up, for the picture and for MJCF, SDF and USD.",
    )
    quiet: bool | None = option(
        None, kind=flag(), flags=("--quiet", "-q"), python="", help="Print only warnings and errors."
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.mass is not None and self.density is not None:
            raise OptionError(f"density is {self.density} and mass is {self.mass}; give one of them.")
