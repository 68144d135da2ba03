"""The viewer's input, the values of the page's controls, and both as a command for a terminal."""

from __future__ import annotations

import dataclasses
import os
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import OptionError
from rlacd.io.read.load import load_mesh
from rlacd.io.write import file_stem
from rlacd.io.write.target import MODEL_OF
from rlacd.options import Options
from rlacd.options.criterion import CRITERIA, with_criterion
from rlacd.options.fields import shown
from rlacd.options.lengths import read_lengths
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import Axis
from rlacd.options.presets import PRESETS
from rlacd.options.ranges import FAST
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.topology import compacted

_NAMES = (
    *("criterion", "threshold", "radius", "tolerance", "volume_tolerance", "quality", "primitives"),
    *("overlap", "keep_open", "openings", "keep_cavities", "max_hulls", "max_vertices", "preset"),
)
_USUAL, _SPACE = Options(), NavigableSpace()
_NUMBERS = {number for numbers in CRITERIA.values() for number in numbers}

CONTROLS: dict[str, Any] = {name: getattr(_SPACE if hasattr(_SPACE, name) else _USUAL, name) for name in _NAMES}
_FLAGS = {name for name, usual in CONTROLS.items() if usual is False}
CONTROLS["primitives"] = False
"""The page's controls, by the names of options, with their first values."""


def read_controls(given: dict[str, Any]) -> dict[str, Any]:
    """Check the options given by a page or a command line; returns the values of all controls.

    Raises
    ------
    OptionError
        An option is unknown, of the wrong type or out of range.
    """
    given = read_lengths(given)
    for name in given:
        if name.removesuffix("_abs") in CONTROLS and name not in CONTROLS:
            plain = name.removesuffix("_abs")
            raise OptionError(f"{plain} is {shown(given[name])}; it has to be a number or a share such as 2%.")
        if name not in CONTROLS:
            raise OptionError(f"{name!r} is not an option of the viewer; choose from {', '.join(sorted(CONTROLS))}.")
    controls = {name: usual if given.get(name) is None else given[name] for name, usual in CONTROLS.items()}
    Options.of(options_of(controls))
    return controls


def options_of(controls: dict[str, Any]) -> dict[str, Any]:
    """Get the options of `rlacd.decompose`."""
    others = _NUMBERS - {*CRITERIA.get(str(controls["criterion"]), ())}
    return with_criterion({name: value for name, value in controls.items() if name not in others})


def passes_of(controls: dict[str, Any]) -> list[dict[str, Any]]:
    """Get the options of each pass: a quick one first, unless those requested are quick already."""
    return [options_of({**controls, "quality": quality}) for quality in dict.fromkeys((FAST, controls["quality"]))]


@dataclasses.dataclass(frozen=True)
class Subject:
    """An input shown in the viewer."""

    path: Path
    """Read again for every decomposition."""
    name: str
    """Shown on the page."""
    up: str
    """The axis that points up."""
    mesh: InputMesh
    """The mesh as first read."""
    up_is_guess: bool = False
    """Whether the file does not say which axis points up."""
    is_robot: bool = False
    """Whether it is a robot, which becomes a robot."""


def read_subject(mesh: str | os.PathLike[str], up: str | None = None) -> Subject:
    """Read the mesh to be viewed.

    Raises
    ------
    MeshError
        The file cannot be read or holds nothing usable.
    """
    read = load_mesh(mesh)
    guess = up is None and Path(mesh).suffix.lower() in SAY_NOTHING
    axis = up or (guessed_up(read) if guess else read.up)
    return Subject(Path(mesh), Path(read.name).stem, axis, read, up_is_guess=guess)


SAY_NOTHING = (".obj", ".stl", ".ply", ".off", ".xyz")
"""Formats that say nothing of directions: programs for drawing write y up, programs for machines z."""

STANDING = 0.005
"""How far from the ground a mesh may stand, as a share of its longest side."""


def guessed_up(mesh: InputMesh) -> Axis:
    """Guess y if the mesh stands on y = 0 and not on z = 0, else z, the default elsewhere."""
    points = compacted(mesh.vertices, mesh.faces)[0]
    low = points.min(axis=0)
    stands = np.abs(low) <= STANDING * (points.max(axis=0) - low).max()
    return "y" if stands[1] and not stands[2] else "z"


def as_command(subject: Subject, mesh: str | os.PathLike[str], controls: dict[str, Any]) -> str:
    """Write ``rlacd decompose`` with the options set on the page: one line, quoted for a POSIX shell."""
    others = _NUMBERS - {*CRITERIA[controls["criterion"]]}
    words = ["rlacd", "decompose", os.fspath(mesh)]
    for name, value in controls.items():
        if name not in others and value not in (None, CONTROLS[name]):
            flag = f"--{name.removeprefix('volume_').replace('_', '-')}"
            words += [flag] if name in _FLAGS else [flag, _word(value)]
    ending = Path(mesh).suffix if subject.is_robot else ".glb"
    return shlex.join([*words, "-o", f"{file_stem(Path(mesh).stem)}_hulls{ending}"])


def _word(value: Any) -> str:
    if value is True:
        return "all"
    if isinstance(value, (list, tuple)):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def file_name(name: str) -> str:
    """Clean the name of an uploaded file: no folders, and no characters that a file system may refuse."""
    last = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r'[\x00-\x1f\x7f<>:"|?*]', "_", last).strip(". ")[-120:]
    return plain.encode(errors="replace").decode() or "mesh"


def preset_words(name: str) -> dict[str, Any]:
    """Describe a preset for the page: its engine, limits and format."""
    preset = PRESETS[name]
    ending = preset.ending.lstrip(".")
    stated = {"vertices": preset.max_vertices, "triangles": preset.max_faces}
    limits = " and ".join(f"{limit} {what}" for what, limit in stated.items() if limit)
    return {"engine": preset.engine, "format": preset.file_type or MODEL_OF.get(ending, ending), "limits": limits}
