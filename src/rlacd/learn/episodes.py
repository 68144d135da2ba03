"""Episodes: which solid is cut next, turned how, and when the cutting of it is broken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rlacd.criteria import Criterion
from rlacd.errors import TrainingError
from rlacd.learn.mdp import Cutting
from rlacd.learn.meshes import TURNS, Solids

TRIES = 1000
"""So many solids in a row without anything to cut, and there is nothing to learn on."""


@dataclass(frozen=True)
class Start:
    """The solid of an episode: a mesh, turned about a coordinate axis."""

    name: str
    axis: int
    degrees: float


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

    def draw(self, rng: np.random.Generator) -> tuple[Start, Cutting]:
        """Draw the next solid that needs a cut.

        Raises
        ------
        TrainingError
            There seems to be none.
        """
        for _ in range(TRIES):
            name = self.names[int(rng.integers(len(self.names)))]
            axis = int(rng.integers(3))
            degrees = TURNS[int(rng.integers(len(TURNS)))] if self.rotate else 0.0
            start = Start(name, axis, degrees)
            if (cutting := self.begin(start)) is not None:
                return start, cutting
        raise TrainingError(
            f"none of {TRIES} solids drawn from {len(self.names)} meshes needs a cut; give other meshes, or a smaller "
            "threshold."
        )

    def begin(self, start: Start) -> Cutting | None:
        """Begin an episode; None when the solid cannot be had, or there is nothing to cut or too much."""
        solid = self.solids.get(start.name, start.axis, start.degrees)
        cutting = None if solid is None else Cutting(solid, self.criterion)
        return None if cutting is None or cutting.over or cutting.count > self.max_parts else cutting

    def is_capped(self, cutting: Cutting, cuts: int) -> bool:
        """Tell whether an episode has to be broken off after so many cuts."""
        return cuts >= self.max_cuts or cutting.count >= self.max_parts
