"""The plan of a rewrite: which meshes to decompose, and how the file changes once their hulls are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

Scale: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class MeshUse:
    """A mesh file at a scale: decomposed once, however many times it is used.

    Attributes
    ----------
    path
        The file.
    scale
        The factors that the description applies to its coordinates; negative ones mirror.
    """

    path: Path
    scale: Scale


@dataclass(frozen=True)
class HullFile:
    """A hull on disk: its file's name, and its share of the volume of all hulls of its mesh."""

    name: str
    share: float


Edits: TypeAlias = list[tuple[int, int, bytes]]
HullFiles: TypeAlias = Mapping[MeshUse, Sequence[HullFile]]


@dataclass(frozen=True)
class Plan:
    """How to rewrite one description.

    Attributes
    ----------
    uses
        The meshes to decompose, in the order of the file, each once.
    edit
        Takes the hull files of each and returns the edits of the file's bytes.
    relative
        Paths that other parts of the file name relative to its folder: they break if the result goes elsewhere.
    warnings
        What is left unchanged, and why.
    """

    uses: list[MeshUse]
    edit: Callable[[HullFiles], Edits]
    relative: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
