"""COLLADA documents in the terms that the parser reads: it skips skews, controllers, and the layout of accessors."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from rlacd.errors import MeshFileError
from rlacd.io.read.limits import DEEPEST
from rlacd.solid.arrays import FloatArray


def in_plain_terms(path: Path, root: Any) -> bool:
    """Rewrite a document in place; whether anything was to be rewritten.

    A skew becomes a matrix, and accessors that leave out numbers get arrays without these. Beside each instance of a
    skin or a morph stands its geometry in its bind shape, as a node.

    Raises
    ------
    MeshFileError
        An accessor leads out of its array.
    """
    changed = [_as_matrix(skew) for skew in list(root.iter("{*}skew"))]
    changed += [_close_together(path, source) for mesh in root.iter("{*}mesh") for source in mesh.findall("{*}source")]
    instances, shapes = list(root.iter("{*}instance_controller")), _bind_shapes(root)
    changed += [_as_geometry(instance, shapes) for instance in instances]
    return any(changed)


def _as_matrix(skew: Any) -> bool:
    """By RenderMan, to which COLLADA refers: turn one axis to the other, along which all points move."""
    try:
        angle, *axes = map(float, (skew.text or "").split())
        turned, along = (axis / (np.linalg.norm(axis) or np.nan) for axis in np.array(axes).reshape(2, 3))
    except ValueError:
        return False
    between, angle = np.arccos(np.clip(turned @ along, -1, 1)), np.radians(angle)
    if not between - np.pi < angle < between:  # no such skew, or no numbers
        return False
    across = (turned - turned @ along * along) / np.sin(between)
    matrix = np.eye(4)
    matrix[:3, :3] += (1 / np.tan(between - angle) - 1 / np.tan(between)) * np.outer(along, across)
    skew.tag = _beside(skew, "matrix")
    skew.text = _written(matrix)
    return True


def _close_together(path: Path, source: Any) -> bool:
    """Leave only the numbers of an array that its accessor uses."""
    accessor, numbers = source.find("{*}technique_common/{*}accessor"), source.find("{*}float_array")
    if accessor is None or numbers is None:
        return False
    params = accessor.findall("{*}param")
    words = (numbers.text or "").split()
    try:
        offset, stride = int(accessor.get("offset", 0)), int(accessor.get("stride", len(params)))
        count = int(accessor.get("count", (len(words) - offset) // max(stride, 1)))
    except ValueError:
        return False
    named = [place for place, param in enumerate(params) if param.get("name")] or list(range(len(params)))
    if not params or (offset == 0 and stride <= len(params) and len(named) == len(params)):
        return False
    end = offset + (count - 1) * stride + len(params)
    if min(offset, count) < 0 or stride < len(params) or (count and end > len(words)):
        raise MeshFileError(f"{path} has an accessor of {count} rows that leads out of its array; export it again")
    numbers.text = " ".join(words[offset + row * stride + place] for row in range(count) for place in named)
    numbers.set("count", str(count * len(named)))
    accessor.set("offset", "0")
    accessor.set("stride", str(len(named)))
    for place, param in enumerate(params):
        if place not in named:
            accessor.remove(param)
    return True


def _bind_shapes(root: Any) -> dict[str, tuple[str, FloatArray]]:
    """What each controller bends, a geometry or another controller, and the matrix that it applies before."""
    found = {}
    for controller in root.iter("{*}controller"):
        for shape in controller.iterchildren("{*}skin", "{*}morph"):
            words = shape.findtext("{*}bind_shape_matrix", _written(np.eye(4))).split()
            try:
                matrix = np.array(words, np.float64).reshape(4, 4)
            except ValueError:
                continue
            found[f"#{controller.get('id')}"] = shape.get("source", ""), matrix
    return found


def _as_geometry(instance: Any, shapes: dict[str, tuple[str, FloatArray]]) -> bool:
    """Put the geometry of a controller beside its instance, in its bind shape."""
    url, matrix = instance.get("url", ""), np.eye(4)
    for _ in range(DEEPEST):
        if url in shapes:
            url, own = shapes[url]
            matrix = matrix @ own
    node = etree.Element(_beside(instance, "node"))
    etree.SubElement(node, _beside(instance, "matrix")).text = _written(matrix)
    geometry = etree.SubElement(node, _beside(instance, "instance_geometry"), url=url)
    geometry.extend(copy.deepcopy(instance.findall("{*}bind_material")))
    instance.addnext(node)
    return True


def _beside(element: Any, name: str) -> str:
    """A tag in the namespace of another."""
    return str(etree.QName(etree.QName(element).namespace, name))


def _written(matrix: FloatArray) -> str:
    return " ".join(map(repr, matrix.ravel().tolist()))
