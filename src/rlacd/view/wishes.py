"""What the viewer is asked for: the input it looks at, and what the page's controls hold."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from rlacd.criteria import NavigableSpace
from rlacd.errors import OptionError
from rlacd.options import CONCAVITY, QUALITIES, Options
from rlacd.solid.input_mesh import InputMesh

NAVIGABLE = "navigable"
FAST = QUALITIES[0]
_DEFAULTS, _SPACE = Options(), NavigableSpace()


@dataclasses.dataclass(frozen=True)
class ViewerControls:
    """What the page's controls hold; see `rlacd.decompose` for the meaning of each."""

    criterion: str = CONCAVITY
    threshold: float = _DEFAULTS.threshold
    radius: float = _SPACE.radius or 0.0
    tolerance: float = _SPACE.tolerance or 0.0
    quality: str = _DEFAULTS.quality or QUALITIES[0]
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
        if self.criterion not in (CONCAVITY, NAVIGABLE):
            raise OptionError(f"criterion is {self.criterion!r}; it has to be {CONCAVITY} or {NAVIGABLE}.")
        goal: dict[str, Any] = {"threshold": self.threshold}
        if self.criterion == NAVIGABLE:
            goal = {"criterion": NavigableSpace(radius=self.radius, tolerance=self.tolerance)}
        options = {
            **goal,
            "quality": self.quality,
            "max_hulls": self.max_hulls,
            "max_vertices": self.max_vertices,
            "preset": self.preset,
        }
        Options(**options)
        return options

    def draft(self) -> dict[str, Any] | None:
        """Get the options of a quick first pass; None where these are quick themselves."""
        return None if self.quality == FAST else {**self.options(), "quality": FAST}


@dataclasses.dataclass(frozen=True)
class Subject:
    """An input that is looked at.

    Attributes
    ----------
    path : pathlib.Path
        Read anew for every decomposition.
    name : str
        For the page.
    up : {"x", "y", "z"}
        The axis that points up.
    unit : str
        The unit of length, where the format says one; else empty.
    mesh : InputMesh
        As it was first read.
    """

    path: Path
    name: str
    up: str
    unit: str
    mesh: InputMesh
