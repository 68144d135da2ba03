"""What files other than glTF say of the looks of their triangles: normals, texture coordinates, colours, materials.

They are read only for a file that keeps them, a second time and after the checks that reading the triangles makes.
Pictures are decoded here, by Pillow where it is installed; those that are missing or damaged are left out.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.errors import MeshFileError
from rlacd.io.read.beside import PICTURES, FolderFiles
from rlacd.io.read.colors_3mf import Color, colors_3mf, has_colors
from rlacd.io.read.polygons import obj_without_folds
from rlacd.io.read.polygons_ply import STRIPS
from rlacd.io.read.text import check_text, spaced_obj
from rlacd.io.read.xml import collada_of

_COLORED = re.compile(rb"^v(?:[ \t]+[^\s#]+){6,}", re.MULTILINE)
_DESCRIBED = re.compile(rb"^property\s+\S+\s+(?:red|nx|s|u|texture_u)\s|TextureFile", re.MULTILINE)

MOST_IN_TABLES = 200_000_000
"""Vertices times materials of an OBJ file: the parser makes a table of all vertices for every material."""

MOST_PIXELS = 2**26
"""Of one picture: 8,192 by 8,192."""


def has_looks(path: Path, content: bytes, extension: str, nodes: int) -> bool:
    """Whether a file says more than where its triangles are: looks, or several nodes."""
    match extension:
        case "obj":
            return (
                any(word in content for word in (b"\nusemtl ", b"\nvt ", b"\nvn "))
                or _COLORED.search(content) is not None
            )
        case "ply":
            header = content[: max(content.find(b"end_header"), 0)]
            return _DESCRIBED.search(header) is not None and STRIPS.encode() not in header
        case "dae":
            return True
        case _:
            return extension == "3mf" and (nodes > 1 or has_colors(path, content))


def looks_of(path: Path, content: bytes, extension: str) -> trimesh.Scene | None:
    """Parse a file again, with everything that its parser reads; None where that fails or would take too much.

    Parameters
    ----------
    path : Path
        Of the file, whose folder may hold its materials and pictures.
    content : bytes
        Its content, whose triangles have been read.
    extension : str
        ``obj``, ``ply``, ``dae`` or ``3mf``.
    """
    try:
        plain = _checked(path, content, extension)
        scene = trimesh.load_scene(
            io.BytesIO(plain),
            file_type=extension,
            resolver=FolderFiles(path.parent, PICTURES),
            allow_remote=False,
            process=False,
        )
        if extension == "3mf":
            _paint(scene, colors_3mf(path, content))
        for material in _materials(scene):
            _drop_bad_pictures(material)
    except Exception:  # parsers may raise anything on damaged files; the triangles have been read without looks
        return None
    return scene


def _checked(path: Path, content: bytes, extension: str) -> bytes:
    if extension == "dae":
        return collada_of(path, content, extension)
    if extension == "obj":
        check_text(path, content)
        names = {line.split(None, 1)[-1] for line in content.splitlines() if line.startswith(b"usemtl")}
        if len(names) * content.count(b"\nv ") > MOST_IN_TABLES:
            raise MeshFileError(f"{path} has too many materials")
        return obj_without_folds(spaced_obj(content))
    return content


def _paint(scene: trimesh.Scene, colors: dict[str, Color]) -> None:
    """Give each geometry the colour of its name, which is that of its object."""
    for name, color in colors.items():
        if name in scene.geometry:
            material = trimesh.visual.material.PBRMaterial(
                baseColorFactor=np.array(color),
                metallicFactor=0.0,
                roughnessFactor=0.5,
                alphaMode="OPAQUE" if color[3] == 1.0 else "BLEND",
            )
            scene.geometry[name].visual = trimesh.visual.TextureVisuals(material=material)


def _materials(scene: trimesh.Scene) -> Iterator[Any]:
    for geometry in scene.geometry.values():
        material = getattr(getattr(geometry, "visual", None), "material", None)
        if material is not None:
            yield material


def _drop_bad_pictures(material: Any) -> None:
    """Decode pictures now, when one that cannot be decoded may still be left out."""
    for name in ("image", "baseColorTexture", "emissiveTexture", "normalTexture"):
        picture = getattr(material, name, None)
        if picture is None:
            continue
        try:
            if picture.format is None or picture.width * picture.height > MOST_PIXELS:
                raise ValueError("the picture is made up by the parser, or too large")
            picture.load()
        except Exception:
            setattr(material, name, None)
