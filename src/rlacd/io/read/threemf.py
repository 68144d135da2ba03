"""3MF: the objects of an archive where its build places them, and their colours."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from lxml import etree

from rlacd.errors import MeshFileError
from rlacd.io.read.contents import LONGEST_NAME, Contents, Triangles, check_places
from rlacd.io.read.xml import PARSER, check_prologue, open_archive, parse_xml
from rlacd.solid.arrays import FloatArray
from rlacd.solid.input_mesh import Asset, SourceNode

Color = tuple[float, float, float, float]
"""Red, green, blue in linear light, and opacity."""

METRES = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "meter": 1.0, "inch": 0.0254, "foot": 0.3048}

UNDERSTOOD = re.compile(r".*/(core|material|production|trianglesets|slice)/\d{4}/\d{2}")
"""Namespaces of what leaves the triangles as they are, or is read."""

SUPPORTS = ("support", "solidsupport")
"""Types of objects that a printer adds to hold the others."""

_HEX = re.compile(r"#([0-9a-fA-F]{6})([0-9a-fA-F]{2})?$")


class _Item(NamedTuple):
    """What a build or an object places: a file of the archive, an object in it, and its transform."""

    model: str
    number: str
    transform: FloatArray


class _Object(NamedTuple):
    """An object has one colour here: its own, or the one that most of its triangles name."""

    name: str
    kind: str
    shape: Triangles
    color: Color | None
    parts: list[_Item]


class _Archive:
    """The objects of a file where they are placed; each of its models is read once."""

    def __init__(self, path: Path, content: bytes) -> None:
        self._path, self._archive = path, open_archive(path, content)
        self._models: dict[str, dict[str, _Object]] = {}
        self._keys: Counter[str | None] = Counter()
        self._build: list[_Item] = []
        self.unit, self.supports = "", 0
        self.placed: dict[str, tuple[SourceNode, _Object]] = {}
        self._objects_of(self._main())
        self._place(self._build, np.eye(4))

    def _main(self) -> str:
        """The model that the relationships of the archive name, or the one of the usual name."""
        names = self._archive.namelist()
        told = [name for name in names if "3d/3dmodel.model" in name.lower()]
        if "_rels/.rels" in names and not told:
            rows = parse_xml(self._path, self._archive.read("_rels/.rels")).iter("{*}Relationship")
            targets = [row.get("Target", "").lstrip("/") for row in rows if row.get("Type", "").endswith("/3dmodel")]
            told = [name for name in targets if name in names]
        if not told:
            raise MeshFileError(f"{self._path} holds no model: it is damaged or not a 3MF file; export it again")
        return told[0]

    def _objects_of(self, model: str) -> dict[str, _Object]:
        if model not in self._models:
            self._models[model] = {}
            data = self._archive.read(model)
            check_prologue(self._path, data)
            groups: dict[str, list[Color | None]] = {}
            tags = [f"{{*}}{tag}" for tag in ("basematerials", "colorgroup", "object", "build", "model")]
            for _, element in etree.iterparse(io.BytesIO(data), tag=tags, huge_tree=True, **PARSER):
                match etree.QName(element).localname:
                    case "object":
                        self._models[model][element.get("id", "")] = _object(element, groups, model)
                        element.clear()
                    case "build" if len(self._models) == 1:
                        self._build = _items(element, "item", model)
                    case "model":
                        for prefix in element.get("requiredextensions", "").split():
                            if UNDERSTOOD.fullmatch(name := element.nsmap.get(prefix, prefix)) is None:
                                raise MeshFileError(f"{self._path} requires {name!r:.99}, which is not read: mesh it")
                        self.unit = self.unit or element.get("unit", "millimeter")
                    case _:
                        groups[element.get("id", "")] = [_color(one) for one in element.iter("{*}base", "{*}color")]
        return self._models[model]

    def _place(self, items: Sequence[_Item], transform: FloatArray, depth: int = 0) -> None:
        for item in items:
            check_places(self._path, len(self.placed), depth)
            thing = self._objects_of(item.model)[item.number]
            if thing.kind in SUPPORTS:
                self.supports += 1
                continue
            here = transform @ item.transform
            key = trimesh.util.unique_name(thing.name, self.placed, self._keys)
            if len(thing.shape.vertices) or not thing.parts:
                self.placed[key] = SourceNode(thing.name, key, here), thing
            self._place(thing.parts, here, depth + 1)


def read_3mf(path: Path, content: bytes) -> Contents:
    """Read the objects that the build places.

    Raises
    ------
    MeshFileError, ValueError, LookupError, TypeError
        The archive or its XML is damaged, or would unpack or multiply to more than is reasonable.
    """
    archive = _Archive(path, content)
    geometry = [(node, thing.shape) for node, thing in archive.placed.values()]
    colored = any(thing.color is not None for _, thing in archive.placed.values())
    asset = Asset(content, path, "3mf") if colored or len(geometry) > 1 else None
    said = [f"support structures of {path.name} were left out: {archive.supports}"] if archive.supports else []
    said += [] if geometry else ["its build places no object"]
    return Contents(geometry, said, metres=METRES.get(archive.unit, METRES["millimeter"]), asset=asset)


def scene_of_3mf(path: Path, content: bytes) -> trimesh.Scene:
    """The same as a scene with colours."""
    scene, shared = trimesh.Scene(), dict[int, str]()
    for key, (node, thing) in _Archive(path, content).placed.items():
        if id(thing) in shared:
            scene.graph.update(key, matrix=node.transform, geometry=shared[id(thing)])
            continue
        shared[id(thing)] = key
        mesh = trimesh.Trimesh(*thing.shape, process=False)
        if thing.color is not None:
            how: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.5}
            how["alphaMode"] = "OPAQUE" if thing.color[3] == 1.0 else "BLEND"
            material = trimesh.visual.material.PBRMaterial(baseColorFactor=np.array(thing.color), **how)
            mesh.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(mesh, node_name=key, geom_name=key, transform=node.transform)
    return scene


def _object(element: Any, groups: dict[str, list[Color | None]], model: str) -> _Object:
    points = [[vertex.get(axis) for axis in "xyz"] for vertex in element.iter("{*}vertex")]
    rows = list(element.iter("{*}triangle"))
    faces = [[row.get("v1"), row.get("v2"), row.get("v3")] for row in rows]
    shape = Triangles(np.array(points, np.float64).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))
    own = (element.get("pid", ""), element.get("pindex", "0"))
    used = Counter((row.get("pid", own[0]), row.get("p1", own[1])) for row in rows)
    (group, index), _ = used.most_common(1)[0] if used else (own, 0)
    colors = groups.get(group, [])
    color = colors[int(index)] if index.isdecimal() and int(index) < len(colors) else None
    name = element.get("name", element.get("id", ""))[:LONGEST_NAME]
    return _Object(name, element.get("type", "model"), shape, color, _items(element, "component", model))


def _items(element: Any, tag: str, model: str) -> list[_Item]:
    found = []
    for one in element.iter(f"{{*}}{tag}"):
        transform = np.eye(4)
        if one.get("transform"):
            transform[:3] = np.array(one.get("transform").split(), np.float64).reshape(4, 3).T
        other = next((value.strip("/") for key, value in one.items() if key.endswith("path")), model)
        found.append(_Item(other, one.get("objectid", ""), transform))
    return found


def _color(element: Any) -> Color | None:
    match = _HEX.match(element.get("displaycolor", element.get("color", "")))
    if match is None:
        return None
    srgb = [int(match[1][at : at + 2], 16) / 255 for at in (0, 2, 4)]
    red, green, blue = (value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in srgb)
    return red, green, blue, int(match[2] or "ff", 16) / 255
