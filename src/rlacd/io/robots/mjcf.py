"""MJCF: each geom that collides as a mesh becomes one geom per hull.

A geom's settings come from its own attributes and from defaults: its class, or the nearest ``childclass`` above it, and
the classes that contain that class (https://mujoco.readthedocs.io, "Default settings").

Hulls weigh nothing. A geom stays, without contacts, if its body's mass follows from it: then mass, centre and inertia
are the original's, however they were given. A geom in a group that MuJoCo shows by default (0, 1, 2) may also be the
only visible one of its body; unless another geom shows the same mesh there, it stays and remains visible.

Files that ``<include>`` names are part of the model. Their paths are relative to the folder of the main file, or if
nothing is there, to that of the file that names them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from rlacd.errors import MeshFileError
from rlacd.io.robots.references import References
from rlacd.io.robots.spans import Edit, Element, expand
from rlacd.io.robots.urdf import HullFiles, MeshUse, Plan, read_scale

SHOWN, HIDDEN = ("0", "1", "2"), "3"
"""Groups that MuJoCo shows by default, and one that it does not."""

BODIES = ("worldbody", "body", "frame", "replicate")
STRIPPED = ("mesh", "texture", "hfield", "skin")
FILES = (*STRIPPED, "include", "model")
NAMED_BY = {"geom1": None, "geom2": None, "objname": "objtype", "refname": "reftype"}
"""Attributes that may name a geom, and those that then say so."""

MOST_STL_FACES = 200_000
"""Triangles of the largest STL file that MuJoCo reads."""

LEAST_VOLUME = 1e-14
"""A mesh with less volume is refused by MuJoCo 4.0, unless its inertia is that of a shell."""


TOP = "main"


@dataclass
class Defaults:
    """Attributes by class and element, with what each class inherits."""

    parents: dict[str, str | None] = field(default_factory=dict)
    own: dict[tuple[str, str], dict[str, str]] = field(default_factory=dict)

    @classmethod
    def of(cls, root: Element) -> Defaults:
        """Collect the ``<default>`` sections of a model; those at the top are one class, whatever its name."""
        defaults = cls({TOP: None})
        for section in root.named("default"):
            defaults._gather(section, TOP, None)
        return defaults

    def _gather(self, section: Element, name: str, parent: str | None) -> None:
        self.parents[name] = parent
        for child in section.children:
            if child.tag == "default":
                self._gather(child, child.attributes.get("class", ""), name)
            else:
                self.own.setdefault((name, child.tag), {}).update(child.attributes)

    def full(self, element: Element, childclass: str | None = None) -> dict[str, str]:
        """Return the element's attributes, completed by those of its classes."""
        name: str | None = element.attributes.get("class", childclass)
        name = name if name in self.parents else TOP
        chain: list[dict[str, str]] = []
        while name is not None and name in self.parents and len(chain) <= len(self.parents):
            chain.append(self.own.get((name, element.tag), {}))
            name = self.parents[name]
        merged: dict[str, str] = {}
        for attributes in (*reversed(chain), element.attributes):
            merged.update(attributes)
        return merged


@dataclass(frozen=True)
class _Geom:
    """A geom that collides as a mesh.

    Attributes
    ----------
    attributes
        Its own, completed by those of its classes.
    is_seen, is_weighed
        Whether it is the only one to show its mesh; whether the mass of its body follows from it.
    """

    element: Element
    attributes: Mapping[str, str]
    mesh: str
    is_seen: bool
    is_weighed: bool

    @property
    def is_kept(self) -> bool:
        """Whether it stays, without contacts; a shape for fluids belongs to the whole, not to its hulls."""
        return self.is_seen or self.is_weighed or self.attributes.get("fluidshape", "none") != "none"


class _Mesh(NamedTuple):
    """A mesh that is replaced: its name, its asset, the asset's attributes with those of its classes, and its use."""

    name: str
    asset: Element
    full: Mapping[str, str]
    use: MeshUse


@dataclass(frozen=True)
class Compiler:
    """What all ``<compiler>`` elements of a model say together: later ones overrule."""

    settings: Mapping[str, str]
    root: Element

    @classmethod
    def of(cls, root: Element) -> Compiler:
        """Collect the settings."""
        settings: dict[str, str] = {}
        for compiler in root.named("compiler"):
            new = dict(compiler.attributes)
            if "assetdir" in new:
                new = {"meshdir": new["assetdir"], "texturedir": new["assetdir"], **new}
            settings.update(new)
        return cls(settings, root)

    @property
    def strips(self) -> bool:
        """Whether only the last part of each name counts. Hulls are in a folder, so the result says otherwise."""
        return self.settings.get("strippath") == "true"

    @property
    def mesh_folder(self) -> str:
        """The folder of meshes, relative to that of the main file."""
        return self.settings.get("meshdir", "")

    def relocated(self, element: Element) -> str | None:
        """The file that an element names, seen from the main file and not stripped, if its text is not that."""
        own, main = element.attributes.get("file", ""), self.root.file.folder
        name = re.split(r"[/\\]", own)[-1] if self.strips and element.tag in STRIPPED else own
        where = {"include": "", "texture": "texturedir"}.get(element.tag, "meshdir")
        folder = main / self.settings.get(where, "")
        inner = element.file.folder
        if name and inner != main and inner.is_relative_to(main) and not (folder / name).exists():
            moved = inner.relative_to(main) / name
            name = moved.as_posix() if (folder / moved).exists() else name
        return None if name == own else name

    def is_weighed(self, geom: Element, full: Mapping[str, str]) -> bool:
        """Tell whether the mass of the geom's body follows from the geom."""
        body = next((element for element in geom.up() if element.tag in ("body", "worldbody")), None)
        when = self.settings.get("inertiafromgeom", "auto")
        if body is None or body.tag == "worldbody" or when == "false":
            return False
        if when != "true" and any(body.named("inertial")):
            return False
        first, last = (*_numbers(geom, self.settings, "inertiagrouprange", "0 5"), 5.0)[:2]
        if not first <= _numbers(geom, full, "group", "0")[0] <= last:
            return False
        return _numbers(geom, full, "mass" if "mass" in full else "density", "1000")[0] != 0


def read_model(root: Element, references: References, read: Callable[[Path], bytes]) -> Compiler:
    """Bring in what the model includes, and return the settings of the whole.

    Raises
    ------
    MeshFileError
        A file cannot be read, may not be, or is included twice.
    """

    def find(name: str, element: Element) -> Path:
        main = root.file.folder
        return references.find(name, main if (main / name).is_file() else element.file.folder)

    expand(root, find, read)
    return Compiler.of(root)


def plan_mjcf(compiler: Compiler, references: References, named: Callable[[str, str], str]) -> Plan:
    """Find the collision meshes of an MJCF model; the rest is as for `rlacd.io.robots.urdf.plan_urdf`."""
    root = compiler.root
    defaults = Defaults.of(root)
    assets = {_mesh_name(mesh, defaults): mesh for section in root.named("asset") for mesh in section.named("mesh")}
    warnings: list[str] = []
    geoms = [geom for body in root.walk() if body.tag in BODIES for geom in _colliding(body, defaults, compiler)]
    meshes = []
    for name in dict.fromkeys(geom.mesh for geom in geoms):
        full = defaults.full(assets[name]) if name in assets else {}
        if "file" in full:
            meshes.append(_Mesh(name, assets[name], full, _use(assets[name], full, references, compiler)))
        else:
            why = "has no file of its own" if name in assets else "is not in the file"
            warnings.append(f"The mesh {name} is left unchanged: it {why}.")
    replaced = {mesh.name for mesh in meshes}
    geoms = [geom for geom in geoms if geom.mesh in replaced]
    warnings += _caveats(root, geoms)
    rewritten = {mesh.asset for mesh in meshes}
    files = [defaults.full(each).get("file") for each in root.walk() if each.tag in FILES and each not in rewritten]
    relative = [file for file in files if file and not Path(file).is_absolute()]

    def edit(hulls: HullFiles, sources: Mapping[MeshUse, trimesh.Trimesh], copies: Mapping[MeshUse, str]) -> list[Edit]:
        taken = {*assets, *(str(e.attributes.get("name")) for e in root.walk() if e.tag == "geom")}
        names: dict[str, list[str]] = {}
        edits, own = [], {*taken}
        for mesh in meshes:
            names[mesh.name] = [_unused(f"{mesh.name}_{i:03d}", own) for i in range(len(hulls[mesh.use]))]
            edits.append(_hull_assets(mesh, named, zip(names[mesh.name], hulls[mesh.use], strict=True)))
            values = {"file": moved} if (moved := compiler.relocated(mesh.asset)) is not None else {}
            if mesh.use in copies:
                values["file"] = named(mesh.full["file"], copies[mesh.use])
            if _lacks_volume(sources[mesh.use], mesh.full.get("inertia", "legacy")):
                values["inertia"] = "shell"
                weighed = any(g.mesh == mesh.name and g.is_weighed and "mass" not in g.attributes for g in geoms)
                said = " Its mass is its area times the density." if weighed else ""
                warnings.append(f'{mesh.use.path.name} has no volume, so its mesh got inertia="shell".{said}')
            edits += [mesh.asset.replaced(mesh.asset.with_attributes(values))] if values else []
        edits += [_geom_edit(geom, names[geom.mesh], taken) for geom in geoms]
        return edits + _relocations(compiler, edits, rewritten)

    return Plan(list(dict.fromkeys(mesh.use for mesh in meshes)), edit, relative, warnings)


def _hull_assets(mesh: _Mesh, named: Callable[[str, str], str], hulls: Iterable[tuple[str, str]]) -> Edit:
    """Add the hulls' assets, by name and file, behind that of their mesh."""
    asset, full = mesh.asset, mesh.full
    shell = {"inertia": "shell"} if "inertia" in full else {}  # hulls weigh nothing, and may be too thin for the others
    copies = [asset.with_attributes({"name": new, "file": named(full["file"], file), **shell}) for new, file in hulls]
    return Edit(asset.file, asset.end, asset.end, b"".join(asset.indent + copy for copy in copies))


def _relocations(compiler: Compiler, edits: Sequence[Edit], done: set[Element]) -> list[Edit]:
    """Correct the paths in included files that are to be written into the main file, where another folder counts."""
    changed = {id(edit.file) for edit in edits}
    includes = [element for element in compiler.root.walk() if element.included is not None]
    for element in reversed(includes):  # what an inner file changes, the outer ones hold
        if element.included is not None and id(element.included.file) in changed:
            changed.add(id(element.file))
    moved = {
        element: {"strippath": "false"}
        for element in compiler.root.named("compiler")
        if compiler.strips and "strippath" in element.attributes
    }
    for element in compiler.root.walk():
        if element.tag in FILES and (compiler.strips or id(element.file) in changed) and element not in done:
            written = element.included is not None and id(element.included.file) in changed
            if not written and (name := compiler.relocated(element)) is not None:
                moved[element] = {"file": name}
    return [element.replaced(element.with_attributes(values)) for element, values in moved.items()]


def _geom_edit(geom: _Geom, meshes: list[str], taken: set[str]) -> Edit:
    element = geom.element
    own = element.attributes.get("name")
    pieces = []
    if geom.is_kept:
        values = {"contype": "0", "conaffinity": "0"}
        if own is not None:
            values["name"] = _unused(f"{own}_visual" if geom.is_seen else f"{own}_mass", taken)
        if not geom.is_seen:
            values["rgba"] = "0 0 0 0"  # neither drawn nor hit by rays
        pieces.append(element.with_attributes(values))
    for index, mesh in enumerate(meshes):
        values = {"mesh": mesh, "mass": "0"}
        if own is not None and index:  # the first keeps the name, since other elements may refer to it
            values["name"] = _unused(f"{own}_{index:03d}", taken)
        if geom.is_seen:
            values["group"] = HIDDEN
        if "fluidshape" in geom.attributes and geom.is_kept:
            values["fluidshape"] = "none"
        pieces.append(element.with_attributes(values))
    return element.replaced(element.indent.join(pieces))


def _numbers(geom: Element, attributes: Mapping[str, str], name: str, default: str) -> list[float]:
    """Read the numbers of an attribute, at least one."""
    text = attributes.get(name, default)
    try:
        return [float(word) for word in text.split()] or [float(text)]
    except ValueError as error:
        where = geom.attributes.get("name", "without a name")
        raise MeshFileError(f"the {name} of the geom {where} is {text!r}, which is no number: correct it.") from error


def _lacks_volume(mesh: trimesh.Trimesh, inertia: str) -> bool:
    """Tell whether MuJoCo would refuse to find the inertia of the mesh in this way."""
    if inertia == "shell" or not len(mesh.faces):
        return False
    corners = mesh.vertices.astype(np.float32).astype(float)[mesh.faces]
    corners -= corners.reshape(-1, 3).mean(axis=0)
    volumes = np.linalg.det(corners) / 6
    if inertia == "exact":
        return bool(volumes.sum() < LEAST_VOLUME or not mesh.is_winding_consistent)
    return bool(np.abs(volumes).sum() < LEAST_VOLUME)


def mujoco_reads(path: Path) -> bool:
    """Tell whether MuJoCo reads a mesh file: OBJ, its own MSH, and binary STL of at most 200,000 triangles."""
    ending = path.suffix.lower()
    if ending != ".stl":
        return ending in (".obj", ".msh")
    with path.open("rb") as file:
        count = int.from_bytes(file.read(84)[80:], "little")
    return count <= MOST_STL_FACES and path.stat().st_size == 84 + 50 * count


def _unused(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _colliding(body: Element, defaults: Defaults, compiler: Compiler) -> Iterator[_Geom]:
    """Yield the geoms of one body that collide as meshes."""
    childclass = next((e.attributes["childclass"] for e in body.up() if "childclass" in e.attributes), None)
    geoms = [(geom, defaults.full(geom, childclass)) for geom in body.named("geom")]
    seen = {full.get("mesh") for _, full in geoms if not _collides(full)}
    for geom, full in geoms:
        if full.get("type") == "mesh" and "mesh" in full and _collides(full):
            is_seen = full.get("group", "0").strip() in SHOWN and full["mesh"] not in seen
            yield _Geom(geom, full, full["mesh"], is_seen, compiler.is_weighed(geom, full))


def _collides(attributes: Mapping[str, str]) -> bool:
    return any(attributes.get(name, "1").strip() != "0" for name in ("contype", "conaffinity"))


def _use(asset: Element, full: Mapping[str, str], references: References, compiler: Compiler) -> MeshUse:
    where = f"mesh {full.get('name', full['file'])} of {asset.file.path}"
    folder = compiler.root.file.folder / compiler.mesh_folder
    place = references.find(compiler.relocated(asset) or full["file"], folder)
    return MeshUse(place, read_scale(full.get("scale"), where))


def _mesh_name(mesh: Element, defaults: Defaults) -> str:
    return mesh.attributes.get("name") or Path(defaults.full(mesh).get("file", "")).stem


def _caveats(root: Element, geoms: list[_Geom]) -> Iterator[str]:
    for tag in ("model", "attach"):
        if any(element.tag == tag for element in root.walk()):
            yield f"What <{tag}> brings in is left unchanged: rewrite that file too."
    names = {geom.element.attributes.get("name") for geom in geoms} - {None}
    for element in root.walk():
        for attribute, kind in NAMED_BY.items():
            name = element.attributes.get(attribute)
            if name in names and (kind is None or element.attributes.get(kind) == "geom"):
                yield f"<{element.tag}> names the geom {name}: it now means the first of its hulls only."
