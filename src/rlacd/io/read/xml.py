"""Mesh formats that are XML: 3MF and COLLADA.

Both let a part be instanced any number of times inside other parts, so that forty lines make 2^40 boxes, and XML
entities can expand likewise. Neither is expanded here: documents with a document type are refused, and instances are
counted along the graph of parts.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat
from zipfile import ZipFile, is_zipfile

import numpy as np
from lxml import etree

from rlacd.errors import MeshFileError
from rlacd.io.read.archive import open_archive, unpack
from rlacd.io.read.limits import DEEPEST, LONGEST_NAME, MOST_ITEMS, MOST_PLACES, MOST_TRIANGLES, most_in_memory
from rlacd.io.read.plain_dae import in_plain_terms
from rlacd.io.read.polygons_dae import collada_without_folds

WORLD = ""
"""The root part that all others are placed in; no identifier is empty."""

PARSER: dict[str, Any] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
"""Parser options for lxml."""

PIECE = 1 << 16


@dataclass
class XmlPart:
    """A part of a scene: the number of its own triangles, and the other parts placed in it."""

    triangles: int = 0
    parts: list[str] = field(default_factory=list)


class _RootReached(Exception):
    """Everything before the first element has been read."""


def check_prologue(path: Path, data: bytes) -> None:
    """Refuse a document type, and with it every entity: nothing expands, and no other file is read.

    Raises
    ------
    MeshFileError
        There is one, or the text before the first element is not XML.
    """
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise MeshFileError(
            f"{path} has a document type (<!DOCTYPE>), which is not allowed, as it can refer to anything: remove it"
        )

    def reached(*_: object) -> None:
        raise _RootReached

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = reached
    try:
        for at in range(0, len(data), PIECE):
            parser.Parse(data[at : at + PIECE], False)
        parser.Parse(b"", True)
    except _RootReached:
        return
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, MeshFileError):
            raise
        raise MeshFileError(f"{path} is not valid XML ({error}): it is damaged or cut off; export it again") from error


MODEL_3MF = "3D/3dmodel.model"
"""What the parser calls the model; its name is up to the file, whose relationships tell it."""


def plain_3mf(path: Path, content: bytes) -> bytes:
    """Return a 3MF file whose model has the usual name, checked as by `check_3mf`."""
    archive = open_archive(path, content)
    names = archive.namelist()
    if not any(MODEL_3MF.lower() in name.lower() for name in names) and "_rels/.rels" in names:
        data = unpack(path, archive, "_rels/.rels")
        check_prologue(path, data)
        rows = etree.fromstring(data, etree.XMLParser(**PARSER)).iter("{*}Relationship")
        told = [row.get("Target", "").lstrip("/") for row in rows if row.get("Type", "").endswith("/3dmodel")]
        if told and told[0] in names:
            file = io.BytesIO()
            with ZipFile(file, "w") as renamed:
                for name in names:
                    renamed.writestr(MODEL_3MF if name == told[0] else name, unpack(path, archive, name))
            content = file.getvalue()
    check_3mf(path, content)
    return content


def check_3mf(path: Path, content: bytes) -> None:
    """Refuse a 3MF file that would unpack, expand or multiply to more than is reasonable.

    Raises
    ------
    MeshFileError
        It would.
    """
    archive = open_archive(path, content)
    models = [name for name in archive.namelist() if "3d/3dmodel.model" in name.lower()]
    if not models:
        raise MeshFileError(f"{path} holds no model: it is damaged or not a 3MF file; export it again")
    parts: dict[str, XmlPart] = {}
    reads = _Reads(path, archive)
    for element in reads.elements(models[0]):
        part = parts.setdefault(element.get("id", "?") if _is(element, "object") else WORLD, XmlPart())
        for named in (element, *element.iter("{*}item")):
            _check_names(path, named, ("id", "name", "partnumber"))
        part.triangles += sum(1 for _ in element.iter("{*}triangle"))
        part.parts += [item.get("objectid", "?") for item in element.iter("{*}item", "{*}component")]
        for component in element.iter("{*}component"):
            other = next((value.strip("/") for key, value in component.items() if key.endswith("path")), None)
            if other is not None and other in archive.namelist():
                parts.setdefault(component.get("objectid", "?"), XmlPart()).triangles += reads.triangles_of(other)
        element.clear()
    check_instances(path, parts, MOST_ITEMS)


class _Reads:
    """The XML files of an archive, with a running total: a parser reads one again for every part that names it."""

    def __init__(self, path: Path, archive: ZipFile) -> None:
        self._path = path
        self._archive = archive
        self._most = most_in_memory(sum(member.file_size for member in archive.infolist()))
        self._asked = 0
        self._triangles: dict[str, int] = {}

    def elements(self, name: str) -> Iterator[Any]:
        """Yield the objects of a model and its build items."""
        data = unpack(self._path, self._archive, name)
        check_prologue(self._path, data)
        try:
            for _, element in etree.iterparse(io.BytesIO(data), tag=("{*}object", "{*}build"), **PARSER):
                yield element
        except etree.XMLSyntaxError as error:
            raise MeshFileError(
                f"{self._path} holds XML that is damaged or cut off ({_line_of(error)}); export it again"
            ) from error

    def triangles_of(self, name: str) -> int:
        """Count the triangles of another model in the archive."""
        if name not in self._triangles:
            self._triangles[name] = sum(sum(1 for _ in element.iter("{*}triangle")) for element in self.elements(name))
        self._asked += self._archive.getinfo(name).file_size
        if self._asked > self._most:
            raise MeshFileError(
                f"{self._path} names {name!r:.80} in it so often that it amounts to {self._asked} bytes"
            )
        return self._triangles[name]


def _line_of(error: etree.XMLSyntaxError) -> str:
    """What the parser says, on one line."""
    return " ".join(str(error).split())[:200]


def collada_of(path: Path, content: bytes, extension: str) -> bytes:
    """Return the XML of a COLLADA file, unpacked if it is a ``zae``, checked, in the terms that the parser reads.

    Raises
    ------
    MeshFileError
        It would expand or multiply to more than is reasonable.
    """
    if extension == "zae":
        archive = open_archive(path, content)
        names = [name for name in archive.namelist() if name.lower().endswith(".dae") and "MACOSX" not in name]
        if not names:
            raise MeshFileError(f"{path} holds no .dae file: export it again")
        content = unpack(path, archive, names[0])
    if is_zipfile(io.BytesIO(content)):
        raise MeshFileError(f"{path} is an archive, not XML: rename it to .zae, or export it again")
    check_prologue(path, content)
    try:
        root = etree.fromstring(content, etree.XMLParser(huge_tree=True, **PARSER))
    except etree.XMLSyntaxError as error:
        raise MeshFileError(
            f"{path} holds XML that is damaged or cut off ({_line_of(error)}); export it again"
        ) from error
    changed = in_plain_terms(path, root)
    _check_collada(path, root)
    changed |= collada_without_folds(root)
    return etree.tostring(root, xml_declaration=True, encoding="utf-8") if changed else content


def _check_collada(path: Path, root: Any) -> None:
    """Refuse a document that would expand or multiply to more than is reasonable."""
    parts = {WORLD: XmlPart()}
    for geometry in root.iter("{*}geometry"):
        _check_names(path, geometry, ("id",))
        parts[f"geometry {geometry.get('id')}"] = XmlPart(
            sum(_corners(path, p) for p in geometry.iter(*PRIMITIVES)) // 3
        )
    for scene in root.iter("{*}visual_scene"):
        parts[WORLD].parts += _placed(scene)
    for library in root.iter("{*}library_nodes"):
        for node in library.iter("{*}node"):
            if node.get("id") is not None:
                parts[f"node {node.get('id')}"] = XmlPart(parts=_placed(node))
    check_instances(path, parts)


PRIMITIVES = ("{*}triangles", "{*}polylist", "{*}polygons", "{*}tristrips", "{*}trifans")


def _corners(path: Path, primitive: Any) -> int:
    """Bound the corners of a primitive's polygons by its length: a number takes at least two characters."""
    corners = sum(len(numbers.text or "") // 2 + 1 for numbers in primitive.iter("{*}p"))
    counts = primitive.find("{*}vcount")
    if counts is not None and counts.text:
        promised = _sum(counts.text)
        if promised > corners:
            raise MeshFileError(f"{path} declares polygons with {promised:.0f} corners; export it again")
    return corners


def _sum(text: str) -> float:
    """Add up whole numbers; anything else is left for the parser to report."""
    numbers = [abs(int(word)) for word in re.findall(r"\S+", text) if re.fullmatch(r"[-+]?\d{1,18}", word)]
    return float(np.sum(np.array(numbers, dtype=np.float64)))


def _placed(element: Any) -> list[str]:
    """The names of everything instanced in an element, at any depth."""
    kinds = {"instance_node": "node", "instance_geometry": "geometry"}
    found = element.iter("{*}instance_node", "{*}instance_geometry")
    return [f"{kinds[etree.QName(one).localname]} {one.get('url', '')[1:]}" for one in found]


def _check_names(path: Path, element: Any, attributes: tuple[str, ...]) -> None:
    longest = max(len(element.get(attribute, "")) for attribute in attributes)
    if longest > LONGEST_NAME:
        raise MeshFileError(f"{path} has a name of {longest} characters, more than {LONGEST_NAME}: export it again")


def _is(element: Any, name: str) -> bool:
    return bool(etree.QName(element).localname == name)


def check_instances(path: Path, parts: dict[str, XmlPart], most_places: int = MOST_PLACES) -> None:
    """Refuse parts that contain themselves, nest too deep, or expand to too many instances or triangles.

    Raises
    ------
    MeshFileError
        They do.
    """
    done: dict[str, tuple[int, int]] = {}
    open_parts: set[str] = set()

    def count(name: str, depth: int) -> tuple[int, int]:
        """Instances and triangles of a part and everything in it."""
        if name in done:
            return done[name]
        if name in open_parts:
            raise MeshFileError(f"{path} places the part {name!r:.80} inside itself: export it again")
        if depth > DEEPEST:
            raise MeshFileError(f"{path} places parts inside parts more than {DEEPEST} deep: export it again")
        part = parts.get(name, XmlPart())
        open_parts.add(name)
        inner = [count(other, depth + 1) for other in part.parts]
        open_parts.discard(name)
        places = 1 + sum(places for places, _ in inner)
        triangles = part.triangles + sum(triangles for _, triangles in inner)
        for number, most, what in ((triangles, MOST_TRIANGLES, "triangles"), (places, most_places, "places")):
            if number > most:
                raise MeshFileError(f"{path} has {number} {what} for its parts, more than {most}: simplify it first")
        done[name] = places, triangles
        return done[name]

    count(WORLD, 0)
