"""The colours of the objects of a 3MF file, which trimesh does not read: base materials and colour groups.

An object has one colour here: its own, or the one that most of its triangles name.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from pathlib import Path

from lxml import etree

from rlacd.io.read.archive import open_archive, unpack
from rlacd.io.read.xml import PARSER, check_prologue

Color = tuple[float, float, float, float]
"""Red, green, blue in linear light, and opacity."""

_HEX = re.compile(r"#([0-9a-fA-F]{6})([0-9a-fA-F]{2})?$")


def has_colors(path: Path, content: bytes) -> bool:
    """Whether a 3MF file names any colour."""
    model = _model(path, content)
    return b"displaycolor=" in model or b"colorgroup" in model


def colors_3mf(path: Path, content: bytes) -> dict[str, Color]:
    """Return the colour of each object by its name, or its number if it has none.

    Objects of the same name, and those in other files of the archive, are left out.

    Raises
    ------
    MeshFileError
        The archive or its XML is damaged.
    """
    model = _model(path, content)
    check_prologue(path, model)
    groups: dict[str, list[Color | None]] = {}
    found: dict[str, Color] = {}
    names: Counter[str] = Counter()
    tags = ("{*}basematerials", "{*}colorgroup", "{*}object")
    for _, element in etree.iterparse(io.BytesIO(model), tag=tags, **PARSER):
        if etree.QName(element).localname != "object":
            groups[element.get("id", "")] = [_color(one) for one in element.iter("{*}base", "{*}color")]
            continue
        name = element.get("name", element.get("id", ""))
        names[name] += 1
        own = (element.get("pid", ""), element.get("pindex", "0"))
        used = Counter(
            (triangle.get("pid", own[0]), triangle.get("p1", own[1])) for triangle in element.iter("{*}triangle")
        )
        (group, index), _ = used.most_common(1)[0] if used else (own, 0)
        colors = groups.get(group, [])
        if index.isdecimal() and int(index) < len(colors) and (color := colors[int(index)]) is not None:
            found[name] = color
        element.clear()
    return {name: color for name, color in found.items() if names[name] == 1}


def _model(path: Path, content: bytes) -> bytes:
    archive = open_archive(path, content)
    return unpack(path, archive, next(name for name in archive.namelist() if "3d/3dmodel.model" in name.lower()))


def _color(element: etree._Element) -> Color | None:
    match = _HEX.match(element.get("displaycolor", element.get("color", "")))
    if match is None:
        return None
    red, green, blue = (_linear(int(match[1][at : at + 2], 16) / 255) for at in (0, 2, 4))
    return red, green, blue, int(match[2] or "ff", 16) / 255


def _linear(value: float) -> float:
    """A channel of sRGB as light."""
    return float(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4)
