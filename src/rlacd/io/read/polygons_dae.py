"""COLLADA files whose concave polygons the parser would turn into fans that fold over."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree

from rlacd.io.read.polygons import FloatArray, IntArray, triangles_within, where_folded


def collada_without_folds(root: Any) -> bool:
    """Replace polygons that fans would fold over by their triangles, in place; whether there were any.

    What cannot be read stays, for the parser to say so.

    Parameters
    ----------
    root
        The document.
    """
    found = False
    for mesh in root.iter("{*}mesh"):
        for primitive in mesh.iter("{*}polylist", "{*}polygons"):
            try:
                points, offset, width = _points_of(mesh, primitive)
                is_list = etree.QName(primitive).localname == "polylist"
                found |= (_replace_in_list if is_list else _replace_polygons)(primitive, points, offset, width)
            except (ValueError, OverflowError, LookupError):
                continue
    return found


def _points_of(mesh: Any, primitive: Any) -> tuple[FloatArray, int, int]:
    """The points of a primitive, the place of their indices among those of a corner, and how many these are.

    Raises ValueError or LookupError where something is missing, or is no number.
    """
    inputs = primitive.findall("{*}input")
    offsets = [int(one.get("offset")) for one in inputs if one.get("offset") is not None]
    (vertex,) = (one for one in inputs if one.get("semantic") == "VERTEX")
    (vertices,) = (one for one in mesh.findall("{*}vertices") if one.get("id") == _name(vertex))
    (position,) = (one for one in vertices.findall("{*}input") if one.get("semantic") == "POSITION")
    (source,) = (one for one in mesh.findall("{*}source") if one.get("id") == _name(position))
    accessor = source.find("{*}technique_common/{*}accessor")
    numbers = source.find("{*}float_array")
    if accessor is None or numbers is None or min(offsets) < 0:
        raise LookupError
    rows = np.array((numbers.text or "").split(), dtype=np.float64).reshape(-1, int(accessor.get("stride", 1)))
    if rows.shape[1] < 3:
        raise ValueError("points have three coordinates")
    return np.ascontiguousarray(rows[:, :3]), int(vertex.get("offset")), max(offsets) + 1


def _name(of: Any) -> str:
    return str(of.get("source", "")).removeprefix("#")


def _replace_in_list(primitive: Any, points: FloatArray, offset: int, width: int) -> bool:
    """Replace polygons of a ``polylist``: the numbers of corners, and the corners, each with `width` indices."""
    vcount, p = primitive.find("{*}vcount"), primitive.find("{*}p")
    counts = _integers(vcount.text if vcount is not None else None)
    corners = _integers(p.text if p is not None else None).reshape(-1, width)
    if (counts < 0).any() or counts.sum() != len(corners) or not _are_within(corners[:, offset], points):
        raise ValueError("corners that are not there")
    rings = np.split(corners, np.cumsum(counts)[:-1])
    numbers = [[count] for count in counts.tolist()]
    for polygon, apart in where_folded(points, counts, np.ascontiguousarray(corners[:, offset])):
        rings[polygon] = rings[polygon][apart].reshape(-1, width)
        numbers[polygon] = [3] * len(apart)
    if all(len(number) == 1 for number in numbers):
        return False
    _write(vcount, np.concatenate(numbers))
    _write(p, np.concatenate(rings).ravel())
    primitive.set("count", str(sum(len(number) for number in numbers)))
    return True


def _replace_polygons(primitive: Any, points: FloatArray, offset: int, width: int) -> bool:
    """Replace elements ``p`` and ``ph`` of ``polygons``, one for each; those that cannot be taken apart stay."""
    found = False
    for element in primitive.findall("{*}p") + primitive.findall("{*}ph"):
        is_plain = etree.QName(element).localname == "p"
        listed = [element] if is_plain else element.iterchildren("{*}p", "{*}h")
        rings = [_integers(one.text).reshape(-1, width) for one in listed]
        if not rings or not all(_are_within(ring[:, offset], points) for ring in rings):
            continue
        corners = np.concatenate(rings)
        if is_plain:
            folded = where_folded(points, np.array([len(corners)]), np.ascontiguousarray(corners[:, offset]))
            apart = next((triangles for _, triangles in folded), None)
        else:
            outline, *holes = (points[ring[:, offset]] for ring in rings)
            apart = triangles_within(outline, holes)
        if apart is None:
            continue
        for face in apart:
            other = etree.Element(etree.QName(etree.QName(element).namespace, "p"))
            _write(other, corners[face].ravel())
            element.addprevious(other)
        primitive.remove(element)
        primitive.set("count", str(int(primitive.get("count", 0)) + len(apart) - 1))
        found = True
    return found


def _are_within(corners: IntArray, points: FloatArray) -> bool:
    return len(corners) > 0 and corners.min() >= 0 and corners.max() < len(points)


def _integers(text: str | None) -> IntArray:
    return np.array((text or "").split(), dtype=np.int64)


def _write(element: Any, numbers: IntArray) -> None:
    element.text = " ".join(map(str, numbers.tolist()))
