"""What an MJCF model says before its geoms: settings of the compiler, defaults by class, included files, poses.

Files that ``<include>`` names are part of the model. Their paths are relative to the folder of the main file, or if
nothing is there, to that of the file that names them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.io.read.open_file import read_named
from rlacd.io.robots.poses import Angles
from rlacd.io.robots.references import References, seen_from
from rlacd.io.robots.spans import LARGEST_DESCRIPTION, Element, expand
from rlacd.solid.arrays import FloatArray
from rlacd.solid.poses import product

FOLDERS = {"include": "", "model": "", "texture": "texturedir"} | dict.fromkeys(
    ("mesh", "hfield", "skin", "flexcomp"), "meshdir"
)
"""Elements that name files, and the setting with the folder of these; without one it is that of the main file."""

NAMES = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))
"""Attributes that name files; a texture may be six pictures."""

MOST_STL_FACES = 200_000
"""Triangles of the largest STL file that MuJoCo reads."""

TURNED = frozenset(("quat", "axisangle", "xyaxes", "zaxis", "euler"))
"""Ways to say how an element is turned: its own, or that of the innermost class that has one, replaces all others."""

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
            kept = () if TURNED.isdisjoint(attributes) else TURNED
            merged = {name: value for name, value in merged.items() if name not in kept} | attributes
        return merged


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

    def pose(self, elements: Iterable[Element]) -> FloatArray:
        """The pose of the innermost of nested elements, where bodies and frames put it.

        Of a ``<replicate>``, that is the first copy.
        """
        held = [each for each in elements if each.tag in ("body", "frame")]
        return product(*(self._pose(each, each.attributes) for each in reversed(held)))

    def to_body(self, geom: Element, full: Mapping[str, str]) -> FloatArray:
        """The pose of a geom in the frame of its body."""
        frames = takewhile(lambda each: each.tag not in ("body", "worldbody"), geom.up())
        return product(self.pose(frames), self._pose(geom, full))

    def _pose(self, element: Element, attributes: Mapping[str, str]) -> FloatArray:
        where = f"{element.tag} {element.attributes.get('name', 'without a name')} of {element.file.path}"
        angles = Angles(self.settings.get("angle") != "radian", self.settings.get("eulerseq", "xyz"))
        return angles.pose(attributes, where)

    def relocated(self, element: Element, place: Path | None = None) -> dict[str, str]:
        """The files that an element names, seen from a main file in a folder and not stripped, if its text is not that.

        By default, the main file is where it is.
        """
        main, inner = self.root.file.folder, element.file.folder
        setting = FOLDERS[element.tag]
        folder, there = (at / self.settings.get(setting, "") for at in (main, place or main))
        names = {}
        for attribute in (each for each in NAMES if element.attributes.get(each)):
            name = own = element.attributes[attribute]
            if self.strips and setting:
                name = re.split(r"[/\\]", own)[-1]
            if inner != main and not (folder / name).exists() and (inner / name).exists():
                name = seen_from(folder, inner / name)
            if there != folder:
                name = seen_from(there, folder / name) if not Path(name).is_absolute() else name
            if name != own:
                names[attribute] = name
        return names

    def is_weighed(self, geom: Element, full: Mapping[str, str]) -> bool:
        """Tell whether the mass of the geom's body follows from the geom."""
        body = next((element for element in geom.up() if element.tag in ("body", "worldbody")), None)
        when = self.settings.get("inertiafromgeom", "auto")
        if body is None or body.tag == "worldbody" or when == "false":
            return False
        if when != "true" and any(body.named("inertial")):
            return False
        first, last = (*geom_numbers(geom, self.settings, "inertiagrouprange", "0 5"), 5.0)[:2]
        if not first <= geom_numbers(geom, full, "group", "0")[0] <= last:
            return False
        return geom_numbers(geom, full, "mass" if "mass" in full else "density", "1000")[0] != 0


def read_model(root: Element, references: References) -> Compiler:
    """Bring in what the model includes, and return the settings of the whole.

    Raises
    ------
    MeshFileError
        A file cannot be read, may not be, or is included twice.
    """

    def find(name: str, element: Element) -> Path:
        main = root.file.folder
        return references.find(name, main if (main / name).is_file() else element.file.folder)

    expand(root, find, lambda path: read_named(path, LARGEST_DESCRIPTION))
    return Compiler.of(root)


def geom_numbers(geom: Element, attributes: Mapping[str, str], name: str, default: str) -> list[float]:
    """Read the numbers of an attribute, at least one."""
    text = attributes.get(name, default)
    try:
        return [float(word) for word in text.split()] or [float(text)]
    except ValueError as error:
        where = geom.attributes.get("name", "without a name")
        raise MeshFileError(f"the {name} of the geom {where} is {text!r}, which is no number: correct it.") from error


def mujoco_reads(path: Path) -> bool:
    """Tell whether MuJoCo reads a mesh file: OBJ, its own MSH, and binary STL of at most 200,000 triangles."""
    ending = path.suffix.lower()
    if ending != ".stl":
        return ending in (".obj", ".msh")
    with path.open("rb") as file:
        count = int.from_bytes(file.read(84)[80:], "little")
    return count <= MOST_STL_FACES and path.stat().st_size == 84 + 50 * count
