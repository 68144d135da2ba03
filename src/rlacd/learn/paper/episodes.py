"""Episodes: which solid is cut next, how it is turned, and when cutting is truncated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria import Criterion
from rlacd.errors import TrainingError
from rlacd.learn.meshes import TURNS, Solids
from rlacd.learn.paper.mdp import CutProcess
from rlacd.solid.component import Component

TRIES = 1000
"""Training stops with an error after this many consecutive solids without anything to cut."""


@dataclass(frozen=True)
class Start:
    """The solid of an episode: a mesh, turned about a coordinate axis."""

    name: str
    axis: int
    degrees: float


def draw_start(names: Sequence[str], rotate: bool, rng: np.random.Generator) -> Start:
    """Draw a mesh and, if requested, one of the paper's rotations (`TURNS`)."""
    name = names[int(rng.integers(len(names)))]
    axis = int(rng.integers(3))
    return Start(name, axis, TURNS[int(rng.integers(len(TURNS)))] if rotate else 0.0)


def begin(solid: Component, criterion: Criterion, max_parts: int) -> CutProcess | None:
    """Start an episode; None if there is nothing to cut, or too many components."""
    cutting = CutProcess(solid, criterion)
    return None if cutting.over or cutting.count > max_parts else cutting


def nothing_to_cut(tries: int, meshes: int) -> TrainingError:
    """Build the error for `tries` consecutive solids that need no cut."""
    return TrainingError(
        f"none of {tries} solids drawn from {meshes} meshes needs a cut; give other meshes, or a smaller threshold."
    )


@dataclass(frozen=True)
class Episodes:
    """Draws episodes.

    Attributes
    ----------
    solids : Solids
    names : tuple of str
        The meshes to draw from.
    criterion : Criterion
    rotate : bool
        Turn solids as the paper does (`TURNS`).
    max_cuts, max_parts : int
        Limits at which episodes are truncated.
    """

    solids: Solids
    names: tuple[str, ...]
    criterion: Criterion
    rotate: bool
    max_cuts: int
    max_parts: int

    def draw(self, rng: np.random.Generator) -> tuple[Start, CutProcess]:
        """Draw the next solid that needs a cut.

        Raises
        ------
        TrainingError
            Many consecutive solids needed no cut.
        """
        for _ in range(TRIES):
            start = draw_start(self.names, self.rotate, rng)
            if (cutting := self.begin(start)) is not None:
                return start, cutting
        raise nothing_to_cut(TRIES, len(self.names))

    def begin(self, start: Start) -> CutProcess | None:
        """Start an episode; None if the solid cannot be repaired, needs no cut, or has too many components."""
        solid = self.solids.get(start.name, start.axis, start.degrees)
        return None if solid is None else begin(solid, self.criterion, self.max_parts)

    def is_capped(self, cutting: CutProcess, cuts: int) -> bool:
        """Tell whether an episode has to be truncated after `cuts` cuts."""
        return cuts >= self.max_cuts or cutting.count >= self.max_parts
