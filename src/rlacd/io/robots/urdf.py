"""URDF: the first ``<collision>`` of a collider becomes one such element per hull, otherwise unchanged; its others go.

Links that fixed joints connect stay apart: programs name them, and attach sensors and frames to them.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import networkx
import numpy as np

from rlacd.clear import LinkPair, Motion, Primitive, urdf_motion
from rlacd.errors import MeshFileError
from rlacd.io.robots.document import Document, Files, HullFiles, opened
from rlacd.io.robots.matrix import srdf
from rlacd.io.robots.poses import numbers, read_scale, urdf_origin
from rlacd.io.robots.references import seen_from
from rlacd.io.robots.robot import Body, Collider, PlacedMesh, colliders
from rlacd.io.robots.spans import Edit, Element
from rlacd.io.write import write_file
from rlacd.options.robots import RobotOptions
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import ROUNDING
from rlacd.solid.poses import product


class _Collision(NamedTuple):
    """A collision mesh: its element, that of its mesh, and where it is."""

    element: Element
    mesh: Element
    placed: PlacedMesh

    @property
    def kind(self) -> Hashable:
        """What its element says beside where which mesh is: extensions about contact; what is shown says nothing."""
        if self.element.tag == "visual":
            return ()
        own = {name: value for name, value in self.element.attributes.items() if name != "name"}
        about = {name: value for name, value in self.mesh.attributes.items() if name not in ("filename", "scale")}
        others = [below for below in self.element.children if below.tag not in ("origin", "geometry")]
        said = [(below.tag, tuple(below.attributes.items())) for child in others for below in child.walk()]
        inner = [(below.tag, tuple(below.attributes.items())) for child in self.mesh.children for below in child.walk()]
        return (*own.items(), *about.items(), *said, *inner)


@dataclass(frozen=True, eq=False)
class Urdf(Document):
    """A URDF, and what it says of the meshes of each collider."""

    found: Mapping[Collider, Sequence[_Collision]]

    kind = "urdf"

    def motion(self, samples: int, seed: int) -> Motion:
        """See `Robot`."""
        return self.with_seen(urdf_motion(self.source, samples, seed, [body.name for body in self.bodies]))

    def edits(self, place: Path, folder: Path, hulls: HullFiles, *_: object) -> list[Edit]:
        """See `Document`."""
        edits = self._relocations(self.elsewhere(place))
        edits += [_behind(one, [_colliding(one, next(one.named("geometry")).with_attributes({}))]) for one in self.seen]
        for collider, (first, *others) in self.found.items():
            names = [self._reference(first.mesh.attributes["filename"], hull, folder) for hull in hulls[collider]]
            if first.element.tag == "visual":
                meshes = [first.mesh.with_attributes({"filename": name}) for name in names]
                pieces = [_colliding(first.element, b"<geometry>" + mesh + b"</geometry>") for mesh in meshes]
                edits.append(_behind(first.element, pieces))
                continue
            pieces = [_with_mesh(first, name, index) for index, name in enumerate(names)]
            edits.append(first.element.replaced(first.element.indent.join(pieces)))
            edits += [other.element.removed() for other in others]
        return edits

    def _relocations(self, elsewhere: Path | None) -> list[Edit]:
        """Correct the names of other files, which are relative to the folder of the file."""
        if elsewhere is None:
            return []
        taken = {one.mesh for together in self.found.values() for one in together if one.element.tag == "collision"}
        edits = []
        for each in (each for each in self.root.walk() if each.tag in ("mesh", "texture") and each not in taken):
            name = each.attributes.get("filename", "")
            if name and "://" not in name and not Path(name).is_absolute():
                moved = seen_from(elsewhere, self.root.file.folder / name.replace("\\", "/"))
                edits.append(each.replaced(each.with_attributes({"filename": moved})))
        return edits

    def paired(self, pairs: Sequence[LinkPair], asked: RobotOptions, said: list[str]) -> list[Edit]:
        """See `Document`."""
        if asked.srdf is not None:
            write_file(Path(asked.srdf), srdf(self.root.attributes.get("name", "robot"), pairs))
        return []

    def _reference(self, old: str, hull: str, folder: Path) -> str:
        """Refer to a hull the way the mesh was: by its package if it lies in that, else relative to the file."""
        package, target = self.references.package_of(old), Path(os.path.abspath(folder)) / hull
        if package is not None and target.is_relative_to(package):
            scheme, rest = old.split("://", 1)
            return f"{scheme}://{rest.split('/', 1)[0]}/{target.relative_to(package).as_posix()}"
        return f"{folder.name}/{hull}"


def read_urdf(source: Path, files: Files, *, apart: bool, from_visual: bool) -> Urdf:
    """Find the collision meshes of a URDF, to be decomposed each for itself or, not `apart`, as links.

    Raises
    ------
    MeshFileError
        It or a mesh cannot be found or read, a number is none, or it still holds macros.
    """
    root = opened(source, "robot")
    if any(element.tag.startswith("xacro:") for element in root.walk()):
        raise MeshFileError(f"{source} holds xacro macros: expand it with the tool xacro first.")
    poses, bodies = _link_poses(root), list[Body]()
    found: dict[Collider, list[_Collision]] = {}
    seen, bare = list[Element](), set[str]()
    for link in root.named("link"):
        name = link.attributes.get("name", "?")
        is_bare = from_visual and not any(link.named("collision"))
        elements = [*link.named("visual" if is_bare else "collision")]
        collisions = [each for element in elements if (each := _collision(element, link, files))]
        own = colliders(name, [(None if apart else each.kind, each.placed, each) for each in collisions])
        found |= own
        stated = [(element, one) for element in elements for one in _primitives(element, link)]
        primitives = [one for _, one in stated]
        seen += [element for element, _ in stated] if is_bare else []
        bare |= {name} if is_bare else set()
        if own or (primitives and name != "world"):
            bodies.append(Body(name, poses.get(name, np.eye(4)), [*own], primitives=primitives))
    said, of_file = [*_of_mass(root, bodies), *_of_inertia(root)], (root, files.references, found)
    return Urdf(source, bodies, said, 1.0, "z", *of_file, seen=seen, bare=frozenset(bare))


def _of_mass(root: Element, bodies: Sequence[Body]) -> list[str]:
    """What to say of links whose mass is for a simulator to find from their collision geometry."""
    stated = {link.attributes.get("name") for link in root.named("link") if any(link.named("inertial"))}
    light = [body.name for body in bodies if body.colliders and body.name not in stated]
    if not light:
        return []
    some = f"The link {light[0]} has" if len(light) == 1 else f"{len(light)} links, such as {light[0]}, have"
    return [f"{some} no <inertial>: MuJoCo takes the mass from the hulls, which differs from that of the meshes."]


def _of_inertia(root: Element) -> list[str]:
    """What to say of links with an inertia that is no positive matrix: MuJoCo refuses the file, whatever collides."""
    stated = [
        (link.attributes.get("name", "?"), inertia.attributes)
        for link in root.named("link")
        for inertial in link.named("inertial")
        for inertia in inertial.named("inertia")
    ]
    if not (wrong := [name for name, inertia in stated if _is_impossible(inertia)]):
        return []
    some = f"the link {wrong[0]}" if len(wrong) == 1 else f"{len(wrong)} links, such as {wrong[0]},"
    return [f"The <inertia> of {some} cannot be one of a body, and MuJoCo refuses it: correct it."]


def _is_impossible(inertia: Mapping[str, str]) -> bool:
    try:
        xx, xy, xz, yy, yz, zz = (float(inertia.get(name, 0)) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        least, _, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    except ValueError:  # no numbers; LinAlgError is one, too
        return False
    return bool(least < -ROUNDING * most)


def _collision(element: Element, link: Element, files: Files) -> _Collision | None:
    """What collides as a mesh, if it does."""
    mesh = next((mesh for geometry in element.named("geometry") for mesh in geometry.named("mesh")), None)
    if mesh is None:
        return None
    where = f"link {link.attributes.get('name', '?')} of {link.file.path}"
    reference = mesh.attributes.get("filename", "")
    if not reference:
        raise MeshFileError(f"a collision mesh of {where} has no filename: give it one.")
    scale, file = read_scale(mesh.attributes.get("scale"), where), files.mesh(reference, link.file.folder)
    return _Collision(element, mesh, PlacedMesh(file, scale, _origin(element, where), np.eye(4)))


SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}
"""What a primitive states of its sizes, and how many numbers that is."""


def _primitives(element: Element, link: Element) -> Iterator[Primitive]:
    """What collides as a primitive, if it does."""
    where = f"link {link.attributes.get('name', '?')} of {link.file.path}"
    for shape in (shape for geometry in element.named("geometry") for shape in geometry.named(*SIZES)):
        said = [numbers(shape.attributes, name, count, where) or [] for name, count in SIZES[shape.tag].items()]
        sizes = [value for values in said for value in values]
        whole = 0 if shape.tag == "box" else 1  # radii are whole, lengths are halved
        halved = [*sizes[:whole], *(value / 2 for value in sizes[whole:])]
        if (own := Primitive.read(shape.tag, halved, _origin(element, where))) is not None:
            yield own


def _origin(element: Element, where: str) -> FloatArray:
    origin = next(element.named("origin"), None)
    return np.eye(4) if origin is None else urdf_origin(origin.attributes, where)


def _link_poses(root: Element) -> dict[str, FloatArray]:
    """Where links stand with all joints at zero; those that no joint carries stand at the origin."""
    tree = networkx.DiGraph()
    names = {link.attributes.get("name") for link in root.named("link")}
    for joint in root.named("joint"):
        ends = {end.tag: end.attributes.get("link", "") for end in joint.named("parent", "child")}
        where = f"joint {joint.attributes.get('name', '?')} of {root.file.path}"
        if lost := sorted({*ends.values()} - names):
            raise MeshFileError(f"the {where} names the link {lost[0]}, which is not in the file: correct the name.")
        if len(ends) == 2 and not (ends["child"] in tree and tree.in_degree(ends["child"])):
            tree.add_edge(ends["parent"], ends["child"], origin=_origin(joint, where))
    if not networkx.is_directed_acyclic_graph(tree):
        (link, _), *_ = networkx.find_cycle(tree)
        raise MeshFileError(f"in {root.file.path}, joints carry the link {link} around in a loop.")
    poses: dict[str, FloatArray] = {}
    for link in networkx.topological_sort(tree):
        carried = [product(poses[up], at) for up, _, at in tree.in_edges(link, data="origin")]
        poses[link] = carried[0] if carried else np.eye(4)
    return poses


def _colliding(element: Element, geometry: bytes) -> bytes:
    """A collision where an element shows something."""
    origin = next(element.named("origin"), None)
    return b"<collision>" + (b"" if origin is None else origin.with_attributes({})) + geometry + b"</collision>"


def _behind(element: Element, pieces: Sequence[bytes]) -> Edit:
    """The edit that adds pieces behind an element."""
    return Edit(element.file, element.end, element.end, b"".join(element.indent + piece for piece in pieces))


def _with_mesh(collision: _Collision, reference: str, index: int) -> bytes:
    """Return the bytes of the collision with another mesh; its name, if any, gets the hull's number as a suffix."""
    element, mesh = collision.element, collision.mesh
    own = element.attributes.get("name")
    whole = element.with_attributes({} if own is None else {"name": f"{own}_{index:03d}"})
    at = mesh.start - element.end + len(whole)  # the mesh stands behind what has changed
    return whole[:at] + mesh.with_attributes({"filename": reference}) + whole[at + mesh.end - mesh.start :]
