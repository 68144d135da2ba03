"""The plan of a rewrite: which meshes to decompose, and how the file changes once their hulls are known; that of URDF.

Each ``<collision>`` with a mesh becomes one such element per hull, otherwise unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import trimesh

from rlacd.errors import MeshFileError
from rlacd.io.robots.references import References
from rlacd.io.robots.spans import Edit, Element

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


def plan_urdf(root: Element, references: References, named: Callable[[str, str], str]) -> Plan:
    """Find the collision meshes of a URDF.

    Parameters
    ----------
    root : Element
        The root of the file.
    references : References
        Resolves the files it refers to.
    named : callable
        Takes the reference to the mesh and a hull's file name; returns the reference to the hull.

    Raises
    ------
    MeshFileError
        A mesh cannot be found or its scale is unusable, or the file still holds macros.
    """
    if any(element.tag.startswith("xacro:") for element in root.walk()):
        raise MeshFileError(f"{root.file.path} holds xacro macros: expand it with the tool xacro first.")
    found: list[tuple[Element, Element, MeshUse]] = []
    for mesh in root.walk():
        around = [*mesh.up()]
        if [element.tag for element in around] != ["mesh", "geometry", "collision", "link", "robot"]:
            continue
        reference, (collision, link) = mesh.attributes.get("filename", ""), around[2:4]
        where = f"link {link.attributes.get('name', '?')} of {root.file.path}"
        if not reference:
            raise MeshFileError(f"a collision mesh of {where} has no filename: give it one.")
        scale = read_scale(mesh.attributes.get("scale"), where)
        found.append((collision, mesh, MeshUse(references.find(reference, root.file.folder), scale)))
    replaced_meshes = {mesh for _, mesh, _ in found}
    others = [each for each in root.walk() if each.tag in ("mesh", "texture") and each not in replaced_meshes]
    names = [each.attributes.get("filename", "") for each in others]
    relative = [name for name in names if name and "://" not in name and not name.startswith("/")]

    def edit(hulls: HullFiles, *_: object) -> list[Edit]:
        edits = []
        for collision, mesh, use in found:
            references = [named(mesh.attributes["filename"], hull) for hull in hulls[use]]
            pieces = [_collision(collision, mesh, name, index) for index, name in enumerate(references)]
            edits.append(collision.replaced(collision.indent.join(pieces)))
        return edits

    return Plan(list(dict.fromkeys(use for _, _, use in found)), edit, relative)


def read_scale(text: str | None, where: str) -> Scale:
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
    return (values[0], values[1], values[2])


def _collision(collision: Element, mesh: Element, reference: str, index: int) -> bytes:
    """Return the bytes of the collision with another mesh; its name, if any, gets the hull's number as a suffix."""
    own = collision.attributes.get("name")
    whole = collision.with_attributes({} if own is None else {"name": f"{own}_{index:03d}"})
    at = mesh.start - collision.end + len(whole)  # the mesh stands behind what has changed
    return whole[:at] + mesh.with_attributes({"filename": reference}) + whole[at + mesh.end - mesh.start :]
