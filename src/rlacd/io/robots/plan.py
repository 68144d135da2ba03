"""The plan of a rewrite: which meshes collide, and how the file changes once their hulls are known."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.robots.bodies import Body, Collider, PlacedMesh, Surface
from rlacd.io.robots.references import References
from rlacd.io.robots.spans import Edit
from rlacd.solid.arrays import FloatArray

Found = TypeVar("Found")

HullFiles: TypeAlias = Mapping[Collider, Sequence[str]]
"""The names of the files of each collider's hulls."""


@dataclass(frozen=True)
class Plan:
    """How to rewrite one description.

    Attributes
    ----------
    bodies
        Those with meshes to decompose, in the order of the file.
    edit
        Takes the hull files of each collider, and the copies of meshes that the consumer cannot read; returns the edits
        of the file and of those it includes.
    relative
        Paths that other parts of the file name relative to its folder: they break if the result goes elsewhere.
    warnings
        What is left unchanged, and why.
    """

    bodies: list[Body]
    edit: Callable[[HullFiles, Mapping[Path, str]], list[Edit]]
    relative: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


class Sources(NamedTuple):
    """What a plan is made with.

    Attributes
    ----------
    references
        Resolves the files that the description refers to.
    load
        Reads a mesh file.
    named
        Takes the reference to a mesh and a hull's file name; returns the reference to the hull.
    apart
        Whether every mesh is a collider of its own.
    """

    references: References
    load: Callable[[Path], Surface]
    named: Callable[[str, str], str]
    apart: bool


def colliders(body: str, uses: Sequence[tuple[Hashable | None, PlacedMesh, Found]]) -> dict[Collider, list[Found]]:
    """Join the meshes of a body that are of the same kind; those of the kind None, and clouds of points, stay apart.

    Returns
    -------
    dict of Collider to list
        What was found for its meshes, in their order.
    """
    kinds: dict[Hashable, list[tuple[PlacedMesh, Found]]] = {}
    for index, (kind, placed, use) in enumerate(uses):
        kinds.setdefault((kind,) if kind is not None and len(placed.surface.faces) else index, []).append((placed, use))
    made = {}
    for group in kinds.values():
        meshes = tuple(placed for placed, _ in group)
        name = meshes[0].surface.path.stem if len(meshes) == 1 else body
        made[Collider(name, meshes)] = [use for _, use in group]
    return made


def read_scale(text: str | None, where: str) -> FloatArray:
    """Read three factors, or one for all axes.

    Raises
    ------
    MeshFileError
        They are not numbers, or one of them is zero.
    """
    try:
        values = [float(word) for word in (text or "1 1 1").split()]
    except ValueError:
        values = []
    values = values * 3 if len(values) == 1 else values
    if len(values) != 3 or not all(0 < abs(value) < float("inf") for value in values):
        raise MeshFileError(f"the scale {text!r} in {where} is not three numbers other than zero.")
    return np.array(values)
