"""The viewer's input and the values of the page's controls."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rlacd.options import CRITERIA, FAST, Options, with_criterion
from rlacd.options.names import PrimitiveKind
from rlacd.options.navigable import NavigableSpace
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
