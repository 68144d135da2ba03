"""The plan of a rewrite: which meshes to decompose, and how the file changes once their hulls are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import trimesh

from rlacd.io.robots.spans import Edit

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


HullFiles: TypeAlias = Mapping[MeshUse, Sequence[str]]
"""The names of the files of each mesh's hulls."""


@dataclass(frozen=True)
class Plan:
    """How to rewrite one description.

    Attributes
    ----------
    uses
        The meshes to decompose, in the order of the file, each once.
    edit
        Takes the hull files of each and its mesh at scale, and the copies
        of meshes that the consumer cannot read; returns the edits of the file and of those it includes.
    relative
        Paths that other parts of the file name relative to its folder: they break if the result goes elsewhere.
    warnings
        What is left unchanged, and why.
    """

    uses: list[MeshUse]
    edit: Callable[[HullFiles, Mapping[MeshUse, trimesh.Trimesh], Mapping[MeshUse, str]], list[Edit]]
    relative: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
