"""URDF: the first ``<collision>`` of a collider becomes one such element per hull, otherwise unchanged; its others go.

Links that fixed joints connect stay apart: programs name them, and attach sensors and frames to them.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import NamedTuple

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.robots.bodies import Body, Collider, PlacedMesh
from rlacd.io.robots.plan import HullFiles, Plan, Sources, colliders, read_scale
from rlacd.io.robots.poses import urdf_origin
from rlacd.io.robots.spans import Edit, Element
from rlacd.solid.arrays import FloatArray
from rlacd.solid.poses import product


class _Collision(NamedTuple):
    """A collision mesh: its element, that of its mesh, and where it is."""

    element: Element
    mesh: Element
    placed: PlacedMesh

    @property
    def kind(self) -> Hashable:
        """What its element says beside where which mesh is: extensions about contact."""
        own = {name: value for name, value in self.element.attributes.items() if name != "name"}
        about = {name: value for name, value in self.mesh.attributes.items() if name not in ("filename", "scale")}
        others = [below for below in self.element.children if below.tag not in ("origin", "geometry")]
        said = [(below.tag, tuple(below.attributes.items())) for child in others for below in child.walk()]
        inner = [(below.tag, tuple(below.attributes.items())) for child in self.mesh.children for below in child.walk()]
        return (*own.items(), *about.items(), *said, *inner)


def plan_urdf(root: Element, sources: Sources) -> Plan:
    """Find the collision meshes of a URDF.

    Raises
    ------
    MeshFileError
        A mesh cannot be found or read, a number is none, or the file still holds macros.
    """
    if any(element.tag.startswith("xacro:") for element in root.walk()):
        raise MeshFileError(f"{root.file.path} holds xacro macros: expand it with the tool xacro first.")
    poses, bodies = _link_poses(root), []
    found: dict[Collider, list[_Collision]] = {}
    for link in root.named("link"):
        name = link.attributes.get("name", "?")
        collisions = [each for element in link.named("collision") if (each := _collision(element, link, sources))]
        own = colliders(name, [(None if sources.apart else each.kind, each.placed, each) for each in collisions])
        found |= own
        bodies += [Body(name, poses.get(name, np.eye(4)), [*own])] if own else []
    replaced = {collision.mesh for collisions in found.values() for collision in collisions}
    others = [each for each in root.walk() if each.tag in ("mesh", "texture") and each not in replaced]
    names = [each.attributes.get("filename", "") for each in others]
    relative = [name for name in names if name and "://" not in name and not name.startswith("/")]

    def edit(hulls: HullFiles, _: object) -> list[Edit]:
        edits = []
        for collider, (first, *others) in found.items():
            references = [sources.named(first.mesh.attributes["filename"], hull) for hull in hulls[collider]]
            pieces = [_with_mesh(first, name, index) for index, name in enumerate(references)]
            edits.append(first.element.replaced(first.element.indent.join(pieces)))
            edits += [other.element.removed() for other in others]
        return edits

    return Plan(bodies, edit, relative)


def _collision(element: Element, link: Element, sources: Sources) -> _Collision | None:
    """What collides as a mesh, if it does."""
    mesh = next((mesh for geometry in element.named("geometry") for mesh in geometry.named("mesh")), None)
    if mesh is None:
        return None
    where = f"link {link.attributes.get('name', '?')} of {link.file.path}"
    reference = mesh.attributes.get("filename", "")
    if not reference:
        raise MeshFileError(f"a collision mesh of {where} has no filename: give it one.")
    surface = sources.load(sources.references.find(reference, link.file.folder))
    scale = read_scale(mesh.attributes.get("scale"), where)
    return _Collision(element, mesh, PlacedMesh(surface, scale, _origin(element, where), np.eye(4)))


def _origin(element: Element, where: str) -> FloatArray:
    origin = next(element.named("origin"), None)
    return np.eye(4) if origin is None else urdf_origin(origin.attributes, where)


def _link_poses(root: Element) -> dict[str, FloatArray]:
    """Where links stand with all joints at zero; those that no joint carries stand at the origin."""
    joints: dict[str, tuple[str, FloatArray]] = {}
    for joint in root.named("joint"):
        ends = {end.tag: end.attributes.get("link", "") for end in joint.named("parent", "child")}
        if len(ends) == 2:
            where = f"joint {joint.attributes.get('name', '?')} of {root.file.path}"
            joints.setdefault(ends["child"], (ends["parent"], _origin(joint, where)))

    def pose(link: str) -> FloatArray:
        chain, seen = [], {link}
        while link in joints:
            link, origin = joints[link]
            if link in seen:
                raise MeshFileError(f"in {root.file.path}, joints carry the link {link} around in a loop.")
            chain.append(origin)
            seen.add(link)
        return product(*reversed(chain))

    return {child: pose(child) for child in joints}


def _with_mesh(collision: _Collision, reference: str, index: int) -> bytes:
    """Return the bytes of the collision with another mesh; its name, if any, gets the hull's number as a suffix."""
    element, mesh = collision.element, collision.mesh
    own = element.attributes.get("name")
    whole = element.with_attributes({} if own is None else {"name": f"{own}_{index:03d}"})
    at = mesh.start - element.end + len(whole)  # the mesh stands behind what has changed
    return whole[:at] + mesh.with_attributes({"filename": reference}) + whole[at + mesh.end - mesh.start :]
