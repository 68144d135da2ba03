"""MJCF: each geom that collides as a mesh becomes one geom per hull.

A geom's settings come from its own attributes and from defaults: its class, or the nearest ``childclass`` above it, and
the classes that contain that class (https://mujoco.readthedocs.io, "Default settings").

A geom with a name is a collider of its own, since sensors, contact pairs and programs go by names, and so is one of the
world. The others of a body are joined where all they say is the same but their mesh, place, mass and colour. Bodies
without joints stay apart from the one that carries them, as in MuJoCo, where they have names and frames.

Hulls weigh nothing. A geom stays, without contacts, if its body's mass follows from it: then mass, centre and inertia
are the original's, however they were given. A geom in a group that MuJoCo shows by default (0, 1, 2) may also be the
only visible one of its body; unless another geom shows the same mesh there, it stays and remains visible.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from rlacd.clear import PRIMITIVES, LinkPair, Motion, Primitive, mjcf_motion
from rlacd.io.robots.document import Document, Files, HullFiles, opened, unused_stem
from rlacd.io.robots.matrix import excludes
from rlacd.io.robots.mjcf_model import FOLDERS, TURNED, Compiler, Defaults, geom_numbers, mujoco_reads, read_model
from rlacd.io.robots.poses import Angles, numbers, read_scale
from rlacd.io.robots.references import seen_from
from rlacd.io.robots.robot import Body, Collider, MeshFile, PlacedMesh, colliders
from rlacd.io.robots.spans import Edit, Element
from rlacd.options.robots import RobotOptions
from rlacd.solid.arrays import FloatArray
from rlacd.solid.poses import inverse

SHOWN, HIDDEN = ("0", "1", "2"), "3"
"""Groups that MuJoCo shows by default, and one that it does not."""

BODIES = ("worldbody", "body", "frame", "replicate")
NAMED_BY = {"geom1": None, "geom2": None, "objname": "objtype", "refname": "reftype"}
"""Attributes that may name a geom, and those that then say so."""

OWN = ("mesh", "mass", "density", "shellinertia", "rgba", "material")
PLACED = ("pos", *TURNED)
"""Attributes in which geoms that collide as one solid may differ."""

LEAST_VOLUME = 1e-14
"""A mesh with less volume is refused by MuJoCo 4.0, unless its inertia is that of a shell."""


@dataclass(frozen=True)
class _Geom:
    """A geom that collides as a mesh."""

    element: Element
    attributes: Mapping[str, str]  # its own, completed by those of its classes
    mesh: str
    is_seen: bool  # whether it is the only one to show its mesh
    is_weighed: bool  # whether the mass of its body follows from it
    is_visual: bool = False  # whether it only shows what its body is to collide as

    @property
    def is_kept(self) -> bool:
        """Whether it stays, without contacts; a shape for fluids belongs to the whole, not to its hulls."""
        return self.is_seen or self.is_weighed or self.attributes.get("fluidshape", "none") != "none"

    @property
    def name(self) -> str | None:
        """Its name, by which other elements and programs refer to it; of one that only shows, none that hulls take."""
        return None if self.is_visual else self.element.attributes.get("name")

    @property
    def body(self) -> Element:
        """The body that it belongs to."""
        return _owner(self.element)

    @property
    def kind(self) -> Hashable | None:
        """Equal for geoms of a body that may become one solid; None if it stays apart."""
        if self.name is not None or self.body.tag == "worldbody":
            return None
        copied = next(element for element in self.element.up() if element.tag in ("replicate", "body"))
        if self.is_visual:
            return id(copied)
        said = sorted((name, value) for name, value in self.attributes.items() if name not in (*OWN, *PLACED))
        return id(copied), self.is_seen, *said


class _Mesh(NamedTuple):
    """A mesh that is replaced: its asset, the asset's attributes with those of its classes, and its file, unplaced."""

    name: str
    asset: Element
    full: Mapping[str, str]
    placed: PlacedMesh


@dataclass(frozen=True, eq=False)
class Mjcf(Document):
    """An MJCF model, the names of its assets, the meshes that are replaced, and the geoms of each collider."""

    compiler: Compiler
    assets: Sequence[str]
    meshes_of: Mapping[str, _Mesh]
    found: Mapping[Collider, Sequence[_Geom]]

    kind = "mjcf"

    def motion(self, samples: int, seed: int) -> Motion:
        """See `Robot`."""
        return self.with_seen(mjcf_motion(self.source, samples, seed, [body.name for body in self.bodies]))

    def copied(self, stem: str) -> dict[MeshFile, str]:
        """See `Document`."""
        files = [mesh.file for body in self.bodies for collider in body.colliders for mesh in collider.meshes]
        unread, taken = [file for file in dict.fromkeys(files) if not mujoco_reads(file.path)], set[str]()
        return {file: f"{stem}_{unused_stem(file.path.stem, taken)}_visual.obj" for file in unread}

    def paired(self, pairs: Sequence[LinkPair], asked: RobotOptions, said: list[str]) -> list[Edit]:
        """See `Document`."""
        return excludes(self.root, [pair for pair in pairs if pair.kind in asked.exclude], said)

    def edits(
        self, place: Path, folder: Path, hulls: HullFiles, copies: Mapping[Path, str], said: list[str]
    ) -> list[Edit]:
        """See `Document`."""
        elsewhere = self.elsewhere(place)
        target = Path(seen_from(place.absolute().parent / self.compiler.mesh_folder, folder))
        taken = {*self.assets, *(str(e.attributes.get("name")) for e in self.root.walk() if e.tag == "geom")}
        names, edits = _hull_assets(self.found, self.meshes_of, hulls, target, {*taken})
        of_geom: dict[str, list[str]] = {}
        for mesh in self.meshes_of.values():
            values = self.compiler.relocated(mesh.asset, elsewhere)
            path = mesh.placed.file.path
            if path in copies:
                values["file"] = (target / copies[path]).as_posix()
            if _lacks_volume(mesh.placed, mesh.full.get("inertia", "legacy")):
                values["inertia"] = "shell"
                weighed = any(
                    geom.mesh == mesh.name and geom.is_weighed and "mass" not in geom.attributes
                    for geoms in self.found.values()
                    for geom in geoms
                )
                more = " Its mass is its area times the density." if weighed else ""
                said.append(f'{path.name} has no volume, so its mesh got inertia="shell".{more}')
            edits += [mesh.asset.replaced(mesh.asset.with_attributes(values))] if values else []
        for collider, together in self.found.items():
            edits += _geom_edits(together, names[collider], taken, of_geom)
        for geom in self.seen:
            copy = geom.with_attributes(_colliding_too(geom, "collision", taken))
            edits.append(Edit(geom.file, geom.end, geom.end, geom.indent + copy))
        edits += _pair_edits(self.root, of_geom, {str(pair.attributes.get("name")) for pair in _pairs(self.root)})
        done = {mesh.asset for mesh in self.meshes_of.values()}
        return edits + _relocations(self.compiler, edits, done, elsewhere)


def read_mjcf(source: Path, files: Files, *, apart: bool, from_visual: bool) -> Mjcf:
    """Find the collision meshes of an MJCF model, as `rlacd.io.robots.urdf.read_urdf` does."""
    root = opened(source, "mujoco")
    compiler = read_model(root, files.references)
    defaults = Defaults.of(root)
    assets = {_mesh_name(mesh, defaults): mesh for section in root.named("asset") for mesh in section.named("mesh")}
    warnings: list[str] = []
    paired = {pair.attributes.get(end) for pair in _pairs(root) for end in ("geom1", "geom2")}
    bodies_of = [each for each in root.walk() if each.tag in BODIES]
    bare = _bare(bodies_of, defaults, paired) if from_visual else frozenset()
    geoms = [geom for body in bodies_of for geom in _colliding(body, defaults, compiler, paired, bare)]
    meshes: dict[str, _Mesh] = {}
    for name in dict.fromkeys(geom.mesh for geom in geoms):
        full = defaults.full(assets[name]) if name in assets else {}
        if "file" in full:
            meshes[name] = _Mesh(name, assets[name], full, _unplaced(assets[name], full, compiler, files))
        else:
            why = "has no file of its own" if name in assets else "is not in the file"
            warnings.append(f"The mesh {name} is left unchanged: it {why}.")
    geoms = [geom for geom in geoms if geom.mesh in meshes]
    warnings += _caveats(root, geoms)
    primitives = [own for body in bodies_of for own in _primitives(body, defaults, compiler, paired, bare)]
    bodies, found = _bodies(geoms, primitives, meshes, compiler, apart=apart)
    shown = [geom for geom, owner, _ in primitives if owner in bare]
    seen_as = frozenset(_body_name(body, root) for body in bare)
    of_file = (root, files.references, compiler, [*assets], meshes, found)
    return Mjcf(source, bodies, warnings, 1.0, "z", *of_file, seen=shown, bare=seen_as)


def _bodies(
    geoms: Sequence[_Geom],
    primitives: Sequence[tuple[Element, Element, Primitive]],
    meshes: Mapping[str, _Mesh],
    compiler: Compiler,
    *,
    apart: bool,
) -> tuple[list[Body], dict[Collider, list[_Geom]]]:
    """Sort geoms by their bodies, and by what may become one solid."""
    of_body: dict[Element, list[_Geom]] = {}
    for geom in geoms:
        of_body.setdefault(geom.body, []).append(geom)
    others: dict[Element, list[Primitive]] = {}
    for _, element, one in primitives:
        others.setdefault(element, []).append(one)
    bodies: list[Body] = []
    found: dict[Collider, list[_Geom]] = {}
    chosen = [each for each in compiler.root.walk() if each in of_body or (each in others and _is_single(each))]
    for element in chosen:
        own = of_body.get(element, [])
        name = _body_name(element, compiler.root)
        placed = [replace(meshes[g.mesh].placed, to_body=compiler.to_body(g.element, g.attributes)) for g in own]
        uses = [(None if apart else geom.kind, at, geom) for geom, at in zip(own, placed, strict=True)]
        joined = colliders(name, uses)
        is_world = element.tag == "worldbody"
        bodies.append(Body(name, compiler.pose(element.up()), [*joined], is_world, others.get(element, ())))
        found |= joined
    return bodies, found


def _body_name(body: Element, root: Element) -> str:
    """Its name, or a name by its number."""
    if body.tag == "worldbody":
        return "world"
    order = (element for element in root.walk() if element.tag == "body")
    own = body.attributes.get("name")
    return f"body_{[*order].index(body) + 1}" if own is None else own


def _bare(bodies_of: Sequence[Element], defaults: Defaults, paired: Collection[str | None]) -> frozenset[Element]:
    """Bodies none of whose geoms collides."""
    each = [(_owner(body), full) for body in bodies_of for _, full in _geoms(body, defaults)]
    solid = {owner for owner, full in each if _collides(full, paired)}
    return frozenset(owner for owner, _ in each if owner.tag == "body" and owner not in solid)


def _owner(element: Element) -> Element:
    return next(each for each in element.up() if each.tag in ("body", "worldbody"))


def _geoms(body: Element, defaults: Defaults) -> list[tuple[Element, dict[str, str]]]:
    """The geoms of a body or of a frame in it, with their attributes, completed by those of their classes."""
    childclass = next((e.attributes["childclass"] for e in body.up() if "childclass" in e.attributes), None)
    return [(geom, defaults.full(geom, childclass)) for geom in body.named("geom")]


def _is_single(body: Element) -> bool:
    """Whether it is a body, and one only: copies of a ``<replicate>`` have names that only MuJoCo knows."""
    return body.tag == "body" and all(element.tag != "replicate" for element in body.up())


def _hull_assets(
    found: Mapping[Collider, Sequence[_Geom]],
    meshes: Mapping[str, _Mesh],
    hulls: HullFiles,
    target: Path,
    taken: set[str],
) -> tuple[dict[Collider, list[str]], list[Edit]]:
    """Name the hulls, and add their assets behind those of the meshes whose place they take."""
    names: dict[Collider, list[str]] = {}
    done: dict[tuple[str, ...], list[str]] = {}
    behind: dict[str, list[bytes]] = {}
    for collider, geoms in found.items():
        mesh = meshes[geoms[0].mesh]
        if (key := (mesh.name, *hulls[collider])) not in done:
            stem = mesh.name if len(geoms) == 1 else collider.name
            done[key] = [_unused(f"{stem}_{i:03d}", taken) for i in range(len(hulls[collider]))]
            own = zip(done[key], hulls[collider], strict=True)
            values = [{"name": name, "file": (target / file).as_posix()} for name, file in own]
            if "inertia" in mesh.full:  # hulls weigh nothing, and may be too thin for the others
                values = [each | {"inertia": "shell"} for each in values]
            behind.setdefault(mesh.name, []).extend(mesh.asset.with_attributes(each) for each in values)
        names[collider] = done[key]
    ends = [(meshes[name].asset, copies) for name, copies in behind.items()]
    edits = [Edit(e.file, e.end, e.end, b"".join(e.indent + copy for copy in copies)) for e, copies in ends]
    return names, edits


def _relocations(compiler: Compiler, edits: Sequence[Edit], done: set[Element], elsewhere: Path | None) -> list[Edit]:
    """Correct the paths of a file that is written elsewhere, and those in files that are written into the main one."""
    every = compiler.strips or elsewhere is not None
    naming = [element for element in compiler.root.walk() if element.tag in FOLDERS and element not in done]
    changed = {id(edit.file) for edit in edits}
    changed |= {id(element.file) for element in naming if every and compiler.relocated(element, elsewhere)}
    includes = [element for element in naming if element.included is not None]
    for element in reversed(includes):  # what an inner file changes, the outer ones hold
        if element.included is not None and id(element.included.file) in changed:
            changed.add(id(element.file))
    moved = {
        element: {"strippath": "false"}
        for element in compiler.root.named("compiler")
        if compiler.strips and "strippath" in element.attributes
    }
    for element in naming:
        written = element.included is not None and id(element.included.file) in changed
        if (every or id(element.file) in changed) and not written:
            moved[element] = compiler.relocated(element, elsewhere)
    return [element.replaced(element.with_attributes(values)) for element, values in moved.items() if values]


def _geom_edits(
    geoms: Sequence[_Geom], meshes: Sequence[str], taken: set[str], of_geom: dict[str, list[str]]
) -> list[Edit]:
    """Put a geom for each hull in the place of the first; all that stay no longer collide.

    The names of the hulls `of_geom`s that have names are added.
    """
    edits = []
    for geom in geoms:
        pieces = [geom.element.with_attributes({})] if geom.is_visual else [_kept(geom, taken)] * geom.is_kept
        if geom.name is not None:
            of_geom[geom.name] = [
                _unused(f"{geom.name}_{i:03d}", taken) if i else geom.name for i in range(len(meshes))
            ]
        pieces += _hull_geoms(geom, meshes, of_geom, taken) if geom is geoms[0] else []
        element = geom.element
        edits.append(element.replaced(element.indent.join(pieces)) if pieces else element.removed())
    return edits


def _kept(geom: _Geom, taken: set[str]) -> bytes:
    values = {"contype": "0", "conaffinity": "0"}
    if geom.name is not None:
        values["name"] = _unused(f"{geom.name}_visual" if geom.is_seen else f"{geom.name}_mass", taken)
    if not geom.is_seen:
        values["rgba"] = "0 0 0 0"  # neither drawn nor hit by rays
    return geom.element.with_attributes(values)


def _pairs(root: Element) -> Iterator[Element]:
    """The pairs of geoms that collide whatever their contact properties say."""
    return (pair for section in root.named("contact") for pair in section.named("pair"))


def _pair_edits(root: Element, of_geom: Mapping[str, Sequence[str]], taken: set[str]) -> list[Edit]:
    """Put a pair for each hull, or for each two, in the place of one that names a geom."""
    edits = []
    for pair in _pairs(root):
        ends = [pair.attributes.get(end, "") for end in ("geom1", "geom2")]
        if not of_geom.keys().isdisjoint(ends):
            copies = []
            for i, named in enumerate(product(*(of_geom.get(end, [end]) for end in ends))):
                values = dict(zip(("geom1", "geom2"), named, strict=True))
                if i and "name" in pair.attributes:
                    values["name"] = _unused(f"{pair.attributes['name']}_{i:03d}", taken)
                copies.append(pair.with_attributes(values))
            edits.append(pair.replaced(pair.indent.join(copies)))
    return edits


def _hull_geoms(
    geom: _Geom, meshes: Sequence[str], of_geom: Mapping[str, Sequence[str]], taken: set[str]
) -> Iterator[bytes]:
    for index, mesh in enumerate(meshes):
        values = {"mesh": mesh, "mass": "0"}
        if geom.name is not None:
            values["name"] = of_geom[geom.name][index]
        if geom.is_seen:
            values["group"] = HIDDEN
        if geom.is_visual:
            values |= _colliding_too(geom.element, f"{index:03d}", taken)
        if "fluidshape" in geom.attributes and geom.is_kept:
            values["fluidshape"] = "none"
        yield geom.element.with_attributes(values)


def _lacks_volume(mesh: PlacedMesh, inertia: str) -> bool:
    """Tell whether MuJoCo would refuse to find the inertia of the mesh in this way."""
    if inertia == "shell" or not len(mesh.faces):
        return False
    corners = mesh.points.astype(np.float32).astype(float)[mesh.faces]
    corners -= corners.reshape(-1, 3).mean(axis=0)
    volumes = np.linalg.det(corners) / 6
    if inertia == "exact":
        return bool(
            volumes.sum() < LEAST_VOLUME
            or not trimesh.Trimesh(mesh.points, mesh.faces, process=False).is_winding_consistent
        )
    return bool(np.abs(volumes).sum() < LEAST_VOLUME)


def _unused(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _colliding(
    body: Element,
    defaults: Defaults,
    compiler: Compiler,
    paired: Collection[str | None],
    bare: Collection[Element],
) -> Iterator[_Geom]:
    """Yield the geoms of one body that collide as meshes, or are to."""
    geoms, is_bare = _geoms(body, defaults), _owner(body) in bare
    seen = {full.get("mesh") for _, full in geoms if not _collides(full, paired)}
    for geom, full in geoms:
        if full.get("type") == "mesh" and "mesh" in full and (is_bare or _collides(full, paired)):
            is_seen = full.get("group", "0").strip() in SHOWN and full["mesh"] not in seen
            yield _Geom(geom, full, full["mesh"], is_seen, compiler.is_weighed(geom, full), is_bare)


def _colliding_too(geom: Element, suffix: str, taken: set[str]) -> dict[str, str]:
    """What a copy of a geom that only shows says, to collide and not to show; a name gets a suffix."""
    named = {"name": _unused(f"{geom.attributes['name']}_{suffix}", taken)} if "name" in geom.attributes else {}
    return {**named, "contype": "1", "conaffinity": "1", "group": HIDDEN, "mass": "0"}


def _primitives(
    body: Element,
    defaults: Defaults,
    compiler: Compiler,
    paired: Collection[str | None],
    bare: Collection[Element],
) -> Iterator[tuple[Element, Element, Primitive]]:
    """Yield the geoms of one body that collide as primitives, or are to, and the body; not those fitted to meshes."""
    is_bare = _owner(body) in bare
    for geom, full in _geoms(body, defaults):
        kind = full.get("type", "sphere")
        if kind not in PRIMITIVES or "mesh" in full or not (is_bare or _collides(full, paired)):
            continue
        where = f"geom {full.get('name', 'without a name')} of {geom.file.path}"
        sizes = geom_numbers(geom, full, "size", "0")
        if (ends := numbers(full, "fromto", 6, where)) is not None:
            first, last = np.array(ends[:3]), np.array(ends[3:])
            size, middle, along = sizes[:1], (first + last) / 2, first - last
            sizes = size * (PRIMITIVES[kind] - 1) + [float(np.linalg.norm(along)) / 2]
            full = {"pos": _words(middle), "zaxis": _words(along)} if sizes[-1] > 0 else {}
        own = Primitive.read(kind, sizes, compiler.to_body(geom, full))
        yield from [] if own is None else [(geom, _owner(geom), own)]


def _words(vector: FloatArray) -> str:
    return " ".join(map(repr, vector.tolist()))


def _collides(attributes: Mapping[str, str], paired: Collection[str | None]) -> bool:
    flags = (attributes.get(name, "1").strip() for name in ("contype", "conaffinity"))
    return attributes.get("name", "") in paired or any(flag != "0" for flag in flags)


def _unplaced(asset: Element, full: Mapping[str, str], compiler: Compiler, files: Files) -> PlacedMesh:
    """Read the file of an asset; its coordinates are taken from ``refpos`` and ``refquat``, then scaled."""
    where = f"mesh {full.get('name', full['file'])} of {asset.file.path}"
    folder = compiler.root.file.folder / compiler.mesh_folder
    file = files.mesh(compiler.relocated(asset).get("file", full["file"]), folder)
    turned = Angles().pose({"pos": full.get("refpos", "0 0 0"), "quat": full.get("refquat", "1 0 0 0")}, where)
    return PlacedMesh(file, read_scale(full.get("scale"), where), np.eye(4), inverse(turned))


def _mesh_name(mesh: Element, defaults: Defaults) -> str:
    return mesh.attributes.get("name") or Path(defaults.full(mesh).get("file", "")).stem


def _caveats(root: Element, geoms: list[_Geom]) -> Iterator[str]:
    for tag in ("model", "attach"):
        if any(element.tag == tag for element in root.walk()):
            yield f"What <{tag}> brings in is left unchanged: rewrite that file too."
    names = {geom.name for geom in geoms} - {None}
    for element in (each for each in root.walk() if each.tag != "pair"):
        for attribute, kind in NAMED_BY.items():
            name = element.attributes.get(attribute)
            if name in names and (kind is None or element.attributes.get(kind) == "geom"):
                yield f"<{element.tag}> names the geom {name}: it now means the first of its hulls only."
