"""COLLADA: the triangles of a scene's geometries where its nodes place them, and their materials."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import is_zipfile

import numpy as np
import trimesh
from lxml import etree

from rlacd.errors import MeshFileError
from rlacd.io.read.beside import PICTURES, FolderFiles
from rlacd.io.read.contents import DEEPEST_PART, LONGEST_NAME, Contents, Triangles, check_places
from rlacd.io.read.looks import opened_picture, painted
from rlacd.io.read.polygons import fan_triangles, places_of, strip_triangles
from rlacd.io.read.text import rows_of, whole
from rlacd.io.read.xml import open_archive, parse_xml
from rlacd.options.output import Axis
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.input_mesh import Asset, SourceNode

_UNREAD = {
    "lines": "lines of {} were left out",
    "linestrips": "lines of {} were left out",
    "convex_mesh": "convex meshes of {} were left out",
    "spline": "splines of {} were left out",
    "brep": "boundary representations of {} were left out",
    "instance_controller": "skinned or morphed meshes of {} are read as bound, at their nodes",
}


class _Primitive(NamedTuple):
    """Triangles of one material: the rows of their corners ``[F, 3]`` in each of the arrays, by semantic."""

    material: str
    arrays: dict[str, tuple[FloatArray, Int64Array]]


class _Placed(NamedTuple):
    """An instance of a geometry: the node, its primitives, and what each symbol of a material means here."""

    node: SourceNode
    primitives: list[_Primitive]
    materials: dict[str, str]


class _Document:
    """A file's geometries where they are placed, and a sentence for each kind of content that is not read."""

    def __init__(self, path: Path, content: bytes) -> None:
        self._path = path
        self.root = parse_xml(path, content)
        self.named = {one.get("id"): one for one in self.root.iter("{*}*") if one.get("id")}
        tags = {etree.QName(element).localname for element in self.root.iter("{*}*")}
        self.warnings = [said.format(path.name) for tag, said in _UNREAD.items() if tag in tags]
        self.placed: dict[str, _Placed] = {}
        self._keys: Counter[str | None] = Counter()
        self._geometries: dict[str, list[_Primitive]] = {}
        self._sources: dict[str, FloatArray] = {}
        self._count = 0
        scene = self.at(self.root.find("{*}scene/{*}instance_visual_scene"))
        scene = self.root.find("{*}library_visual_scenes/{*}visual_scene") if scene is None else scene
        if scene is None:
            raise ValueError("it has no scene")
        for node in scene.iterchildren("{*}node"):
            self._place(node, np.eye(4), 0)

    @property
    def axis_and_unit(self) -> tuple[Axis, float | None]:
        """What points up, z if nothing is said, and the unit in metres."""
        up, unit = self.root.findtext("{*}asset/{*}up_axis", ""), self.root.find("{*}asset/{*}unit")
        axes: dict[str, Axis] = {"X_UP": "x", "Y_UP": "y"}
        try:
            metres = 0.0 if unit is None else float(unit.get("meter", 0.0))
        except ValueError:
            metres = 0.0
        return axes.get(up.strip(), "z"), metres if 0 < metres < np.inf else None

    def at(self, element: Any, attribute: str = "url") -> Any:
        """What an element refers to; None if that is not there."""
        return None if element is None else self.named.get(element.get(attribute, "").removeprefix("#"))

    def _source(self, element: Any) -> Any:
        """The source of an input. Raises LookupError if it is missing."""
        if (source := self.at(element, "source")) is None:
            raise LookupError(f"{element.get('source')!r:.80} is missing")
        return source

    def _place(self, node: Any, transform: FloatArray, depth: int) -> None:
        here = transform @ _transform(node)
        for child in node.iterchildren("{*}*"):
            self._count += 1
            check_places(self._path, self._count, depth)
            target = self.at(child)
            match etree.QName(child).localname:
                case "node":
                    self._place(child, here, depth + 1)
                case "instance_node" if target is not None:
                    self._place(target, here, depth + 1)
                case "instance_geometry" | "instance_node":
                    self._add(node, child, target, here)
                case "instance_controller":
                    shape, bound = self._bound(target)
                    self._add(node, child, shape, here @ bound)

    def _bound(self, controller: Any) -> tuple[Any, FloatArray]:
        """The geometry that a controller bends, and the matrix that it applies before."""
        matrix = np.eye(4)
        for _ in range(DEEPEST_PART):
            shape = None if controller is None else next(controller.iterchildren("{*}skin", "{*}morph"), None)
            if shape is None:
                break
            if (given := shape.findtext("{*}bind_shape_matrix")) is not None:
                matrix = matrix @ _numbers(given).reshape(4, 4)
            controller = self.at(shape, "source")
        return controller, matrix

    def _add(self, node: Any, instance: Any, geometry: Any, transform: FloatArray) -> None:
        missing = geometry is None or etree.QName(geometry).localname != "geometry"
        if missing or np.isnan(transform).any():
            why = "is missing" if missing else "is left out: a bad matrix, or a <skew> or <lookat> there is not read"
            self.warnings.append(f"{instance.get('url')!r:.80}, which a node of {self._path.name} places, {why}")
            return
        own = geometry.get("id", "")
        if own not in self._geometries:
            self._geometries[own] = self._read(geometry)
        name = (node.get("name") or node.get("id") or own or "node")[:LONGEST_NAME]
        key = trimesh.util.unique_name(name, self.placed, self._keys)
        meant = {one.get("symbol"): one.get("target", "")[1:] for one in instance.iter("{*}instance_material")}
        self.placed[key] = _Placed(SourceNode(name, key, transform), self._geometries[own], meant)

    def _read(self, geometry: Any) -> list[_Primitive]:
        if geometry.find(".//{*}ph") is not None:
            raise MeshFileError(f"{self._path} has polygons with holes, which are not read: triangulate them")
        found, name = [], geometry.get("name") or geometry.get("id")
        for mesh in geometry.iterchildren("{*}mesh"):
            for primitive in mesh.iterchildren(*(f"{{*}}{tag}" for tag in _RINGS)):
                try:
                    found.append(self._primitive(primitive))
                except (ValueError, LookupError, TypeError, OverflowError) as error:
                    said = f"faces of {name!r:.80} of {self._path.name} were left out: they are damaged"
                    self.warnings.append(f"{said} ({error!s:.100})")
        return found

    def _primitive(self, primitive: Any) -> _Primitive:
        arrays: dict[str, tuple[FloatArray, int]] = {}
        offsets = [0]
        for one in primitive.iterchildren("{*}input"):
            offsets.append(offset := int(one.get("offset", 0)))
            source = self._source(one)
            inputs = source.findall("{*}input") if one.get("semantic") == "VERTEX" else [one]
            for inner in inputs:
                arrays.setdefault(inner.get("semantic"), (self._rows(self._source(inner)), offset))
        points, offset = arrays["POSITION"]
        if points.shape[1] != 3:
            raise ValueError(f"positions of {points.shape[1]} numbers")
        if min(offsets) < 0:
            raise ValueError("an offset below zero")
        corners = _corners(primitive, points, offset, max(offsets) + 1)
        used = {name: (rows, corners[..., at]) for name, (rows, at) in arrays.items()}
        return _Primitive(primitive.get("material", ""), used)

    def _rows(self, source: Any) -> FloatArray:
        """The numbers of an array that its accessor uses, a row for each of its steps."""
        name = source.get("id")
        if name not in self._sources:
            accessor = source.find("{*}technique_common/{*}accessor")
            if accessor is None:
                raise LookupError(f"{name!r:.80} has no accessor")
            values = _numbers(source.findtext("{*}float_array"))
            params = accessor.findall("{*}param")
            used = [at for at, param in enumerate(params) if param.get("name")] or list(range(len(params)))
            offset, stride = int(accessor.get("offset", 0)), int(accessor.get("stride", len(params)))
            count = int(accessor.get("count", (len(values) - offset) // max(stride, 1)))
            end = offset + (count - 1) * stride + len(params)
            if min(offset, count) < 0 or stride < len(params) or end > len(values):
                raise ValueError(f"an accessor of {count} rows leads out of its array")
            self._sources[name] = values[offset + stride * np.arange(count)[:, None] + np.array(used)]
        return self._sources[name]

    def paint(self, material: str, beside: FolderFiles) -> Any:
        """A material by its identifier, as glTF describes it; None if it says nothing."""
        named = self.named.get(material)
        effect = None if named is None else self.at(named.find("{*}instance_effect"))
        if effect is None:
            return None
        color = _first(effect, "diffuse", np.ones(4)).copy()
        color[3] = _first(effect, "transparent", color)[3]
        texture = effect.find(".//{*}diffuse/{*}texture")
        shininess = max(_first(effect, "shininess", np.zeros(1), "float")[0], 0.0)
        return trimesh.visual.material.PBRMaterial(
            baseColorFactor=color,
            baseColorTexture=None if texture is None else self._picture(effect, texture.get("texture"), beside),
            emissiveFactor=_first(effect, "emission", np.zeros(4))[:3],
            metallicFactor=0.0,
            roughnessFactor=float(np.sqrt(2.0 / (2.0 + shininess))),
        )

    def _picture(self, effect: Any, name: str | None, beside: FolderFiles) -> Any:
        """The picture of a texture: its sampler names a surface, and that an image."""
        params = {param.get("sid"): param for param in effect.iter("{*}newparam")}
        while (param := params.pop(name, None)) is not None:
            inner = next(param.iter("{*}source", "{*}init_from", "{*}instance_image"), param)
            name = (inner.get("url") or inner.text or "").strip().removeprefix("#")
        image = self.named.get(name)
        said = [] if image is None else [(one.text or "").strip() for one in image.iter("{*}init_from", "{*}ref")]
        return opened_picture(beside, next(filter(None, said), ""))


def _first(effect: Any, tag: str, otherwise: FloatArray, kind: str = "color") -> FloatArray:
    """The numbers of a property of an effect."""
    text = effect.findtext(f".//{{*}}{tag}/{{*}}{kind}")
    found = otherwise if text is None else _numbers(text)
    return found if len(found) == len(otherwise) else otherwise


_RINGS = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def _corners(primitive: Any, points: FloatArray, offset: int, width: int) -> Int64Array:
    """The rows that a primitive's triangles use of its inputs ``[F, 3, inputs]``."""
    tag = etree.QName(primitive).localname
    rings = [_integers(p.text, width) for p in primitive.iterchildren("{*}p")]
    rows = np.concatenate([np.empty((0, width), dtype=np.int64), *rings])
    counts = np.array([len(ring) for ring in rings], dtype=np.int64)
    corners = rows[:, offset]
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise ValueError(f"a face uses vertex {corners.max()} of {len(points)}, or one below 0")
    match tag:
        case "triangles":
            places = np.arange(len(rows)).reshape(-1, 3)
        case "tristrips" | "trifans":
            turn = strip_triangles if tag == "tristrips" else fan_triangles
            places = np.concatenate([turn(part) for part in np.split(np.arange(len(rows)), np.cumsum(counts)[:-1])])
        case _:
            counts = _integers(primitive.findtext("{*}vcount"), 1)[:, 0] if tag == "polylist" else counts
            if (counts < 0).any() or counts.sum() != len(rows):
                raise ValueError(f"polygons of {counts.sum()} corners, but {len(rows)} are there")
            places = places_of(points, counts, corners)
    return np.asarray(rows[places])


def _numbers(text: str | None) -> FloatArray:
    return rows_of((text or "").encode() + b"\n")[0]


def _integers(text: str | None, width: int) -> Int64Array:
    return whole(_numbers(text)).reshape(-1, width)


def _transform(node: Any) -> FloatArray:
    """The product of all transforms of a node, in their order; NaN where one is not read."""
    matrix = np.eye(4)
    try:
        for one in node.iterchildren(*(f"{{*}}{tag}" for tag in _MOVES)):
            matrix = matrix @ _MOVES[etree.QName(one).localname](_numbers(one.text))
    except (ValueError, LookupError):
        return np.full((4, 4), np.nan)
    return matrix


def _rotation(values: FloatArray) -> FloatArray:
    *axis, angle = values.reshape(4).tolist()
    return np.asarray(trimesh.transformations.rotation_matrix(np.radians(angle), axis)) if any(axis) else np.eye(4)


_MOVES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "matrix": lambda values: values.reshape(4, 4),
    "translate": lambda values: np.asarray(trimesh.transformations.translation_matrix(values.reshape(3))),
    "rotate": _rotation,
    "scale": lambda values: np.diag([*values.reshape(3), 1.0]),
    "skew": lambda values: {0.0: np.eye(4)}[values[0]],
    "lookat": lambda _: np.full((4, 4), np.nan),  # of cameras and lights
}


def read_collada(path: Path, content: bytes) -> Contents:
    """Read the geometries that the scene places.

    Raises
    ------
    MeshFileError, ValueError, LookupError
        The file is damaged, or would multiply to more than is reasonable.
    """
    content = _unpacked(path, content)
    document = _Document(path, content)
    geometry = []
    for one in document.placed.values():
        vertices, faces, count = [], [], 0
        for points, corners in (primitive.arrays["POSITION"] for primitive in one.primitives):
            used, local = np.unique(corners, return_inverse=True)
            vertices.append(points[used][:, :3])
            faces.append(local.reshape(-1, 3) + count)
            count += len(used)
        if count:
            geometry.append((one.node, Triangles(np.concatenate(vertices), np.concatenate(faces))))
    if not geometry and document.warnings:
        raise MeshFileError(f"{path} holds nothing that is read: {document.warnings[-1]}; export it again")
    warnings, asset = list(dict.fromkeys(document.warnings)), Asset(content, path, "dae")
    return Contents(geometry, warnings, *document.axis_and_unit, asset)


def _unpacked(path: Path, content: bytes) -> bytes:
    """The XML of a COLLADA file, unpacked if it is a ``zae``."""
    if path.suffix.lower() == ".zae":
        archive = open_archive(path, content)
        names = [name for name in archive.namelist() if name.lower().endswith(".dae") and "MACOSX" not in name]
        if not names:
            raise MeshFileError(f"{path} holds no .dae file: export it again")
        content = archive.read(names[0])
    if is_zipfile(io.BytesIO(content)):
        raise MeshFileError(f"{path} is an archive, not XML: rename it to .zae, or export it again")
    return content


def scene_of_collada(path: Path, content: bytes) -> trimesh.Scene:
    """The same with all looks: a node for each primitive of an instance, which begins with the node's name."""
    document = _Document(path, content)
    beside, paints = FolderFiles(path.parent, PICTURES), {}
    scene = trimesh.Scene()
    for key, one in document.placed.items():
        for index, primitive in enumerate(one.primitives):
            material = one.materials.get(primitive.material, primitive.material)
            if material not in paints:
                paints[material] = document.paint(material, beside)
            mesh = painted(primitive.arrays, paints[material])
            name = f"{key}\n{index}"
            scene.add_geometry(mesh, node_name=name, geom_name=name, transform=one.node.transform)
    return scene
