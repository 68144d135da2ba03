"""Episodes: which solid is cut next, and how it is turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rlacd.criteria import Criterion
from rlacd.errors import TrainingError
from rlacd.learn.meshes import TURNS
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
