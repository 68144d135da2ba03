"""The viewer's input, the values of the page's controls, and both as a command for a terminal."""

from __future__ import annotations

import dataclasses
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.errors import OptionError
from rlacd.io.read.load import load_mesh
from rlacd.io.write import file_stem
from rlacd.options import CRITERIA, FAST, Options, with_criterion
from rlacd.options.names import PrimitiveKind
from rlacd.options.navigable import NavigableSpace
from rlacd.options.output import Axis
from rlacd.solid.input_mesh import InputMesh

_DEFAULTS, _SPACE = Options(), NavigableSpace()
_NUMBERS = {number for numbers in CRITERIA.values() for number in numbers}


@dataclasses.dataclass(frozen=True)
class ViewerControls:
    """Values of the page's controls; see `rlacd.decompose` for their meaning."""

    criterion: str = str(_DEFAULTS.criterion)
    threshold: float = _DEFAULTS.threshold
    radius: float = _SPACE.radius or 0.0
    tolerance: float = _SPACE.tolerance or 0.0
    volume_tolerance: float = _DEFAULTS.volume_tolerance
    quality: str = _DEFAULTS.quality or FAST
    primitives: bool | Sequence[PrimitiveKind] = False
    overlap: float = _DEFAULTS.overlap
    keep_open: float | None = None
    open: str = _DEFAULTS.open
    max_hulls: int | None = None
    max_vertices: int | None = None
    preset: str | None = None

    def options(self) -> dict[str, Any]:
        """Get the options of `rlacd.decompose`.

        Raises
        ------
        OptionError
            A value is out of range.
        """
        others = _NUMBERS - {*CRITERIA.get(self.criterion, ())}
        options = with_criterion({key: value for key, value in vars(self).items() if key not in others})
        Options(**options)
        return options

    def draft(self) -> dict[str, Any] | None:
        """Get the options of a quick first pass; None if the requested options are already quick."""
        return None if self.quality == FAST else {**self.options(), "quality": FAST}


@dataclasses.dataclass(frozen=True)
class Subject:
    """An input shown in the viewer.

    Attributes
    ----------
    path : pathlib.Path
        Read again for every decomposition.
    name : str
        Shown on the page.
    up : {"x", "y", "z"}
        The axis that points up.
    unit : str
        The unit of length if the format defines one; else empty.
    mesh : InputMesh
        The mesh as first read.
    up_is_guess : bool
        Whether the file does not say which axis points up.
    """

    path: Path
    name: str
    up: str
    unit: str
    mesh: InputMesh
    up_is_guess: bool = False


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
    return Subject(Path(mesh), Path(read.name).stem, axis, read.unit, read, up_is_guess=guess)


def read_controls(given: dict[str, Any]) -> ViewerControls:
    """Check the options given by a page or a command line.

    Raises
    ------
    OptionError
        An option is unknown or of the wrong type.
    """
    known = {field.name for field in dataclasses.fields(ViewerControls)}
    for name in given:
        if name not in known:
            raise OptionError(f"{name!r} is not an option of the viewer; choose from {', '.join(sorted(known))}.")
    return ViewerControls(**given)


SAY_NOTHING = (".obj", ".stl", ".ply", ".off", ".xyz")
"""Formats that say nothing of directions: programs for drawing write y up, programs for machines z."""

STANDING = 0.005
"""How far from the ground a mesh may stand, as a share of its longest side."""


def guessed_up(mesh: InputMesh) -> Axis:
    """Guess y if the mesh stands on y = 0 and not on z = 0, else z, which files are taken for elsewhere."""
    points = mesh.vertices[np.unique(mesh.faces)] if len(mesh.faces) else mesh.vertices
    low = points.min(axis=0)
    stands = np.abs(low) <= STANDING * (points.max(axis=0) - low).max()
    return "y" if stands[1] and not stands[2] else "z"


def as_command(mesh: str | os.PathLike[str], given: dict[str, Any], usual: Any) -> str:
    """Write ``rlacd decompose`` with the options set on the page.

    Parameters
    ----------
    mesh : path-like
    given : dict
        Values of the controls, by the field names of `usual`.
    usual : dataclass instance
        Default values of the controls; options at their default are left out.

    Returns
    -------
    str
        One line, quoted for a POSIX shell.
    """
    own = CRITERIA.get(str(given.get("criterion")), Options().numbers)
    others = _NUMBERS - {*own}
    words = ["rlacd", "decompose", os.fspath(mesh)]
    for field in dataclasses.fields(usual):
        value = given.get(field.name)
        if field.name not in others and value is not None and value != getattr(usual, field.name):
            words += [f"--{field.name.removeprefix('volume_').replace('_', '-')}", _word(value)]
    return shlex.join([*words, "-o", f"{file_stem(Path(mesh).stem)}_hulls.glb"])


def _word(value: Any) -> str:
    if value is True:
        return "all"
    if isinstance(value, (list, tuple)):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
