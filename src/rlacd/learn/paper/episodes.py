"""Episodes: which solid is cut next, turned how, and when the cutting of it is broken off."""

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
"""So many solids in a row without anything to cut, and there is nothing to learn on."""


@dataclass(frozen=True)
class Start:
    """The solid of an episode: a mesh, turned about a coordinate axis."""

    name: str
    axis: int
    degrees: float


def draw_start(names: Sequence[str], rotate: bool, rng: np.random.Generator) -> Start:
    """Draw a mesh, and if wanted a turn as the paper's (`TURNS`)."""
    name = names[int(rng.integers(len(names)))]
    axis = int(rng.integers(3))
    return Start(name, axis, TURNS[int(rng.integers(len(TURNS)))] if rotate else 0.0)


def begin(solid: Component, criterion: Criterion, max_parts: int) -> CutProcess | None:
    """Begin an episode; None when there is nothing to cut, or too much."""
    cutting = CutProcess(solid, criterion)
    return None if cutting.over or cutting.count > max_parts else cutting


def nothing_to_cut(tries: int, meshes: int) -> TrainingError:
    """Say that so many solids in a row were drawn in vain."""
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
        Where episodes are broken off.
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
            There seems to be none.
        """
        for _ in range(TRIES):
            start = draw_start(self.names, self.rotate, rng)
            if (cutting := self.begin(start)) is not None:
                return start, cutting
        raise nothing_to_cut(TRIES, len(self.names))

    def begin(self, start: Start) -> CutProcess | None:
        """Begin an episode; None when the solid cannot be had, or there is nothing to cut or too much."""
        solid = self.solids.get(start.name, start.axis, start.degrees)
        return None if solid is None else begin(solid, self.criterion, self.max_parts)

    def is_capped(self, cutting: CutProcess, cuts: int) -> bool:
        """Tell whether an episode has to be broken off after so many cuts."""
        return cuts >= self.max_cuts or cutting.count >= self.max_parts
