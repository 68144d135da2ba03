"""MJCF: each geom that collides as a mesh becomes one geom per hull.

A geom's settings come from its own attributes and from defaults: its class, or the nearest ``childclass`` above it, and
the classes that contain that class (https://mujoco.readthedocs.io, "Default settings").

A geom in a group that MuJoCo shows by default (0, 1, 2) may be the only visible one of its body. Unless another geom
shows the same mesh there, it stays, without contacts and mass, and the hulls go to group 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.io.robots.plan import Edits, HullFile, HullFiles, MeshUse, Plan
from rlacd.io.robots.references import References
from rlacd.io.robots.spans import Document, Element
from rlacd.io.robots.urdf import read_scale

HIDDEN_GROUP = "3"
BODIES = ("worldbody", "body", "frame", "replicate")
NAMED_BY = {"geom1": None, "geom2": None, "objname": "objtype", "refname": "reftype"}
"""Attributes that may name a geom, and those that then say so."""


@dataclass
class Defaults:
    """Attributes by class and element, with what each class inherits."""

    parents: dict[str, str | None] = field(default_factory=dict)
    own: dict[tuple[str, str], dict[str, str]] = field(default_factory=dict)
    top: str = "main"

    @classmethod
    def of(cls, root: Element) -> Defaults:
        """Collect the ``<default>`` sections of a file."""
        defaults = cls({"main": None})
        for section in root.named("default"):
            defaults.top = section.attributes.get("class", defaults.top)
            defaults._gather(section, section.attributes.get("class", "main"), None)
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
        name: str | None = element.attributes.get("class", childclass or self.top)
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
    element: Element
    attributes: Mapping[str, str]
    mesh: str
    stays: bool


def plan_mjcf(document: Document, references: References, named: Callable[[str, str], str]) -> Plan:
    """Find the collision meshes of an MJCF file; parameters and errors as for `rlacd.io.robots.urdf.plan_urdf`."""
    root = document.root
    defaults = Defaults.of(root)
    folder = mesh_folder(document)
    assets = {_mesh_name(mesh, defaults): mesh for mesh in _assets(root)}
    warnings = [
        f"What <{kind}> brings in is left unchanged: rewrite that file too."
        for kind in ("include", "model", "attach")
        if any(element.tag == kind for element in root.walk())
    ]
    geoms = []
    for body in (element for element in root.walk() if element.tag in BODIES):
        geoms += [geom for geom in _colliding(body, defaults) if _is_file(assets, geom, defaults, warnings)]
    for geom in geoms:
        _mass(geom.attributes)  # fail before any work
    uses = {
        name: _use(assets[name], defaults, references, folder, document)
        for name in dict.fromkeys(geom.mesh for geom in geoms)
    }
    warnings += _caveats(root, geoms)
    rewritten = {assets[name] for name in uses}
    relative = [
        str(full["file"])
        for element in root.walk()
        if element.tag in ("mesh", "texture", "hfield", "skin", "include", "model")
        and (full := defaults.full(element)).get("file")
        and not Path(full["file"]).is_absolute()
        and element not in rewritten
    ]

    def edit(hulls: HullFiles) -> Edits:
        taken = {*assets, *(str(e.attributes.get("name")) for e in root.walk() if e.tag == "geom")}
        names = {name: _fresh(name, len(hulls[use]), taken) for name, use in uses.items()}
        edits: Edits = []
        for name, use in uses.items():
            asset = assets[name]
            file = defaults.full(asset)["file"]
            copies = [
                document.with_attributes(asset, {"name": new, "file": named(file, hull.name)})
                for new, hull in zip(names[name], hulls[use], strict=True)
            ]
            gap = document.indent(asset)
            edits.append((asset.end, asset.end, b"".join(gap + copy for copy in copies)))
        for geom in geoms:
            edits.append(_geom_edit(document, geom, names[geom.mesh], list(hulls[uses[geom.mesh]])))
        return edits

    return Plan(list(dict.fromkeys(uses.values())), edit, relative, warnings)


def mesh_folder(document: Document) -> Path:
    """Return the folder that mesh file names are relative to.

    Raises
    ------
    MeshFileError
        The file asks for paths to be stripped from the names of its meshes.
    """
    settings: dict[str, str] = {}
    for compiler in document.root.named("compiler"):
        settings.update(compiler.attributes)
    if settings.get("strippath") == "true":
        raise MeshFileError(
            f'{document.path} has strippath="true", with which meshes cannot be in a folder of their own: '
            "remove it, and write the paths out."
        )
    named = settings.get("meshdir", settings.get("assetdir", ""))
    return document.path.absolute().parent / named


def _geom_edit(document: Document, geom: _Geom, names: list[str], hulls: list[HullFile]) -> tuple[int, int, bytes]:
    element = geom.element
    own = element.attributes.get("name")
    pieces = []
    if geom.stays:
        seen = {"contype": "0", "conaffinity": "0", "mass": "0"}
        pieces.append(document.with_attributes(element, seen if own is None else {**seen, "name": f"{own}_visual"}))
    for index, (mesh, hull) in enumerate(zip(names, hulls, strict=True)):
        values = {"mesh": mesh}
        if own is not None and index:  # the first keeps the name, since other elements may refer to it
            values["name"] = f"{own}_{index:03d}"
        if geom.stays:
            values["group"] = HIDDEN_GROUP
        if "mass" in geom.attributes:
            values["mass"] = repr(_mass(geom.attributes) * hull.share)
        pieces.append(document.with_attributes(element, values))
    return element.start, element.end, document.indent(element).join(pieces)


def _mass(attributes: Mapping[str, str]) -> float:
    try:
        return float(attributes.get("mass", "0"))
    except ValueError as error:
        name, mass = attributes.get("name", "without a name"), attributes["mass"]
        raise MeshFileError(f"the mass of the geom {name} is {mass!r}, which is not a number: correct it.") from error


def _colliding(body: Element, defaults: Defaults) -> Iterator[_Geom]:
    """Yield the geoms of one body that collide as meshes."""
    childclass = _childclass(body)
    geoms = [(geom, defaults.full(geom, childclass)) for geom in body.named("geom")]
    seen = {full.get("mesh") for _, full in geoms if not _collides(full)}
    for geom, full in geoms:
        if full.get("type") == "mesh" and "mesh" in full and _collides(full):
            shown = full.get("group", "0").strip() in ("0", "1", "2")
            yield _Geom(geom, full, full["mesh"], shown and full["mesh"] not in seen)


def _collides(attributes: Mapping[str, str]) -> bool:
    return any(attributes.get(name, "1").strip() != "0" for name in ("contype", "conaffinity"))


def _childclass(body: Element) -> str | None:
    element: Element | None = body
    while element is not None:
        if "childclass" in element.attributes:
            return element.attributes["childclass"]
        element = element.parent
    return None


def _is_file(assets: Mapping[str, Element], geom: _Geom, defaults: Defaults, warnings: list[str]) -> bool:
    asset = assets.get(geom.mesh)
    if asset is not None and "file" in defaults.full(asset):
        return True
    why = "is not in this file" if asset is None else "has no file of its own"
    sentence = f"The mesh {geom.mesh} is left unchanged: it {why}."
    if sentence not in warnings:
        warnings.append(sentence)
    return False


def _use(asset: Element, defaults: Defaults, references: References, folder: Path, document: Document) -> MeshUse:
    full = defaults.full(asset)
    where = f"mesh {_mesh_name(asset, defaults)} of {document.path}"
    return MeshUse(references.find(full["file"], folder), read_scale(full.get("scale"), where))


def _assets(root: Element) -> Iterator[Element]:
    for section in root.named("asset"):
        yield from section.named("mesh")


def _mesh_name(mesh: Element, defaults: Defaults) -> str:
    return mesh.attributes.get("name") or Path(defaults.full(mesh).get("file", "")).stem


def _fresh(name: str, count: int, taken: set[str]) -> list[str]:
    """Derive names from that of the mesh which nothing in the file uses."""
    stem = name
    while any(f"{stem}_{index:03d}" in taken for index in range(count)):
        stem += "_hull"
    return [f"{stem}_{index:03d}" for index in range(count)]


def _caveats(root: Element, geoms: list[_Geom]) -> Iterator[str]:
    names = {geom.element.attributes.get("name") for geom in geoms} - {None}
    for element in root.walk():
        for attribute, kind in NAMED_BY.items():
            name = element.attributes.get(attribute)
            if name in names and (kind is None or element.attributes.get(kind) == "geom"):
                yield f"<{element.tag}> names the geom {name}: it now means the first of its hulls only."
    bodies = {
        geom.element.parent for geom in geoms if geom.element.parent is not None and "mass" not in geom.attributes
    }
    unsaid = [body for body in bodies if body.tag == "body" and not any(body.named("inertial"))]
    if unsaid:
        listed = ", ".join(sorted(body.attributes.get("name", "without a name") for body in unsaid))
        yield f"The mass of some bodies follows from their geoms, so it is now that of the hulls: {listed}."
