"""Small FBX files, binary and as text, written without the package's own code."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Tree = tuple[str, Sequence[Any], Sequence[Any]]
"""An element: its name, its values (integers, floats, text, arrays) and the elements in it."""

_LAST = b"\0" * 13

PIVOTED = {"RotationOffset": (1, 0, 0), "RotationPivot": (0, 2, 0), "GeometricTranslation": (0, 0, 5)}
"""A pivot, and a transform of the geometry alone, which the node's children do not inherit."""


@dataclass(frozen=True)
class Model:
    """A node with a mesh of polygons; `below` is the number of its parent, -1 for none."""

    name: str
    points: Any
    polygons: Sequence[Sequence[int]]
    color: Sequence[float] | None = None
    below: int = -1
    properties: Mapping[str, Sequence[float]] = field(default_factory=dict)


def fbx(
    models: Sequence[Model], *, text: bool = False, up: int = 1, unit: float = 1.0, more: Sequence[Tree] = ()
) -> bytes:
    """Write models, with an axis that points up, and centimetres a unit."""
    settings = {"UpAxis": up, "UpAxisSign": 1, "FrontAxis": 2 if up == 1 else 1, "FrontAxisSign": 1 if up == 1 else -1}
    settings |= {"CoordAxis": 0, "CoordAxisSign": 1}
    told = [_property(name, "int", value) for name, value in settings.items()]
    told.append(_property("UnitScaleFactor", "double", unit))
    objects, links = list[Tree](more), list[Tree]()
    for number, model in enumerate(models):
        node, shape, paint = 100 + number, 1000 + number, 10000 + number
        ends = [corner for ring in model.polygons for corner in (*ring[:-1], -1 - ring[-1])]
        objects.append(("Geometry", [shape, f"{model.name}\0\1Geometry", "Mesh"], [
            ("Vertices", [np.asarray(model.points, dtype=np.float64).ravel()], []),
            ("PolygonVertexIndex", [np.array(ends, dtype=np.int32)], []),
        ]))  # fmt: skip
        placed = [_property(name, "Vector3D", *values) for name, values in model.properties.items()]
        objects.append(("Model", [node, f"{model.name}\0\1Model", "Mesh"], [("Properties70", [], placed)]))
        links += [("C", ["OO", shape, node], []), ("C", ["OO", node, 100 + model.below if model.below >= 0 else 0], [])]
        if model.color is not None:
            painted: Tree = ("Properties70", [], [_property("DiffuseColor", "Color", *model.color)])
            objects.append(("Material", [paint, "paint\0\1Material", ""], [painted]))
            links.append(("C", ["OO", paint, node], []))
    tree: list[Tree] = [("FBXHeaderExtension", [], [("FBXVersion", [7400], [])])]
    tree += [("GlobalSettings", [], [("Properties70", [], told)]), ("Objects", [], objects), ("Connections", [], links)]
    if text:
        return ("; FBX 7.4.0 project file\n" + "".join(_text(one, 0) for one in tree)).encode()
    content = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    for one in tree:
        content += _binary(one, len(content))
    return content + _LAST


def _property(name: str, kind: str, *values: float) -> Tree:
    return "P", [name, kind, "", "A", *(float(value) if kind != "int" else value for value in values)], []


def _binary(tree: Tree, start: int) -> bytes:
    name, values, below = tree
    properties = b"".join(map(_packed, values))
    inner, first = b"", start + 13 + len(name) + len(properties)
    for one in below:
        inner += _binary(one, first + len(inner))
    inner += _LAST if below else b""
    head = struct.pack("<IIIB", first + len(inner), len(values), len(properties), len(name))
    return head + name.encode() + properties + inner


def _packed(value: Any) -> bytes:
    if isinstance(value, np.ndarray):
        plain = value.tobytes()
        content = zlib.compress(plain) if len(plain) > 64 else plain
        kind = b"d" if value.dtype == np.float64 else b"i"
        return kind + struct.pack("<III", value.size, len(content) < len(plain), len(content)) + content
    if isinstance(value, str):
        return b"S" + struct.pack("<I", len(value.encode())) + value.encode()
    return b"D" + struct.pack("<d", value) if isinstance(value, float) else b"L" + struct.pack("<q", value)


def _text(tree: Tree, depth: int) -> str:
    name, values, below = tree
    shown = ", ".join(map(_word, values))
    if not below:
        return f"{'  ' * depth}{name}: {shown}\n"
    return f"{'  ' * depth}{name}: {shown} {{\n{''.join(_text(one, depth + 1) for one in below)}{'  ' * depth}}}\n"


def _word(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"*{value.size} {{ a: {','.join(map(str, value.tolist()))} }}"
    if isinstance(value, str):
        name, _, kind = value.partition("\0\1")
        return f'"{kind}::{name}"' if kind else f'"{name}"'
    return str(value)
