"""Triangles of polygons: fans, as parsers make them, except where a fan would fold over as the polygon is concave."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from manifold3d import triangulate

IntArray = npt.NDArray[np.int64]
FloatArray = npt.NDArray[np.float64]

FOLDED = 1e-9
"""A triangle of a fan is folded over if it is turned against its polygon by more than this share of its area."""

MOST_CORNERS = 10_000
"""Of a polygon that is taken apart without a fan, which may take time quadratic in its corners."""

_OBJ_COMMENT = re.compile(rb"#[^\n]*")
_OBJ_POLYGON = re.compile(rb"^[ \t]*f(?:[ \t]+[^\s#]+){4}|\\\r?$", re.MULTILINE)


def triangles_of(points: FloatArray, counts: IntArray, corners: IntArray) -> IntArray:
    """Take polygons apart into triangles, in their order.

    Parameters
    ----------
    points
        ``[V, 3]``.
    counts
        ``[P]``, the number of corners of each polygon; none has triangles if it is below 3.
    corners
        ``[sum of counts]``, their points, polygon by polygon; all within ``points``.

    Returns
    -------
    IntArray
        ``[F, 3]``: of each polygon a fan around its first corner, or, where that folds over, as many triangles that do
        not overlap.
    """
    fans, owner = _fans(counts, corners)
    begins = np.searchsorted(owner, np.arange(len(counts) + 1))
    first = np.cumsum(counts) - counts
    for polygon, apart in where_folded(points, counts, corners):
        fans[begins[polygon] : begins[polygon + 1]] = corners[first[polygon] + apart]
    return fans


def where_folded(points: FloatArray, counts: IntArray, corners: IntArray) -> Iterator[tuple[int, IntArray]]:
    """Each polygon whose fan folds over, in order, and its triangles ``[N - 2, 3]`` as places in its ring of corners.

    Those that cannot be taken apart are left out. Arguments as for `triangles_of`.
    """
    first = np.cumsum(counts) - counts
    for polygon in _folded(points, *_fans(counts, corners), len(counts)).tolist():
        apart = triangles_within(points[corners[first[polygon] : first[polygon] + counts[polygon]]])
        if apart is not None:
            yield polygon, apart


def _fans(counts: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """A fan for each polygon, ``[F, 3]``, and the polygon of each triangle."""
    pieces = np.maximum(counts - 2, 0)
    owner = np.repeat(np.arange(len(counts)), pieces)
    first = (np.cumsum(counts) - counts)[owner]
    step = np.arange(len(first)) - (np.cumsum(pieces) - pieces)[owner]
    return np.asarray(corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]), owner


def _folded(points: FloatArray, fans: IntArray, owner: IntArray, polygons: int) -> IntArray:
    """The polygons of four and more corners some of whose triangles are turned against the whole."""
    with np.errstate(all="ignore"):
        a, b, c = points[fans[:, 0]], points[fans[:, 1]], points[fans[:, 2]]
        areas = np.cross(b - a, c - a)
        whole = np.stack([np.bincount(owner, areas[:, axis], polygons) for axis in range(3)], axis=1)
        along = (areas * whole[owner]).sum(axis=1)
        turned = along < -FOLDED * (whole * whole).sum(axis=1)[owner]
    return np.unique(owner[turned])


def triangles_within(ring: FloatArray, holes: Sequence[FloatArray] = ()) -> IntArray | None:
    """Triangles of one polygon ``[N, 3]`` that do not fold over; None if there are none.

    ``[N - 2, 3]`` without holes; each hole gives two more than it has corners, which count on after those of the ring.
    """
    total = len(ring) + sum(map(len, holes))
    middle = ring.mean(axis=0)
    rings = [one - middle for one in (ring, *holes)]
    if total > MOST_CORNERS or not all(np.isfinite(one).all() for one in rings):
        return None
    normal = _normal(rings[0])
    length = float(np.linalg.norm(normal))
    if not length > 0:
        return None
    normal /= length
    across = np.eye(3)[np.abs(normal).argmin()]
    right = np.cross(across, normal)
    right /= np.linalg.norm(right)
    flat = [np.ascontiguousarray(np.stack([one @ right, one @ np.cross(normal, right)], axis=1)) for one in rings]
    places = np.split(np.arange(total), np.cumsum([len(one) for one in rings])[:-1])
    for hole, one in enumerate(rings[1:], 1):
        if _normal(one) @ normal > 0:  # holes run the other way
            flat[hole], places[hole] = np.ascontiguousarray(flat[hole][::-1]), places[hole][::-1]
    found = np.asarray(triangulate(flat), dtype=np.int64)
    if found.shape != (total - 2 + 2 * len(holes), 3):
        return None
    points = np.concatenate(flat)
    a, b, c = points[found[:, 0]], points[found[:, 1]], points[found[:, 2]]
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.concatenate(places)[found] if areas.min() >= -FOLDED * length else None


def _normal(ring: FloatArray) -> FloatArray:
    return np.asarray(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0))


def strip_triangles(corners: IntArray) -> IntArray:
    """The triangles of a strip of corners: every other one is turned."""
    first = np.arange(max(len(corners) - 2, 0))
    odd = first % 2
    return np.asarray(corners[np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)])


def folds(points: FloatArray, counts: IntArray, corners: IntArray) -> bool:
    """Whether the fan of any polygon folds over (arguments as for `triangles_of`)."""
    return len(_folded(points, *_fans(counts, corners), len(counts))) > 0


def obj_without_folds(content: bytes) -> bytes:
    """Replace the faces of an OBJ file that fans would fold over by their triangles; all other lines stay.

    What cannot be read stays too, for the parser to say so.
    """
    if _OBJ_POLYGON.search(content) is None:
        return content
    text = content.replace(b"\r\n", b"\n").replace(b"\\\n", b" ")
    try:
        points, lines, counts, corners = obj_faces(text)
    except (ValueError, OverflowError):
        return content
    polygons = counts > 3
    lines, corners, counts = lines[polygons], corners[np.repeat(polygons, counts)], counts[polygons]
    if not len(corners) or corners.min() < 0 or corners.max() >= len(points):
        return content
    kept, done = [], 0
    for polygon, apart in where_folded(points, counts, corners):
        begin, end = lines[polygon].tolist()
        words = text[begin:end].split()[1:]
        faces = b"\n".join(b"f " + b" ".join(words[corner] for corner in face) for face in apart)
        kept += [text[done:begin], faces]
        done = end
    return b"".join([*kept, text[done:]]) if kept else content


def obj_faces(text: bytes) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """All points of an OBJ file; of each face where its line begins and ends, the number of corners, and the corners.

    Faces and points begin with their letter and a space. Raises ValueError where numbers are none, or the points have
    different numbers of them. Works on arrays of characters, without a loop over lines: most programs write quads, so
    most files come here.
    """
    letters = np.frombuffer(text + b"\n\n", np.uint8)
    ends = np.flatnonzero(letters == ord("\n"))[:-1]
    begins = np.concatenate([[0], ends[:-1] + 1])
    vertex, face = ((letters[begins] == ord(kind)) & (letters[begins + 1] == ord(" ")) for kind in "vf")
    points = _rows(_lines_of(letters, begins, ends, vertex).replace(b"v", b" "))

    own = _lines_of(letters, begins, ends, face).replace(b"f", b" ")
    letters = np.frombuffer(_OBJ_COMMENT.sub(b"", own) if b"#" in own else own, np.uint8)
    blank = letters <= ord(" ")
    words = np.flatnonzero(~blank[1:] & blank[:-1])
    counts = np.diff(np.searchsorted(words, np.flatnonzero(letters == ord("\n"))), prepend=0)
    place = np.arange(len(letters), dtype=np.int32)
    slash = np.maximum.accumulate(np.where(letters == ord("/"), place, -1))
    gap = np.maximum.accumulate(np.where(blank, place, 0))
    named = _numbers(np.where(slash > gap, np.uint8(ord(" ")), letters).tobytes(), np.int64)  # of 1/2/3, the point 1
    if len(named) != counts.sum():
        raise ValueError("corners that are not numbers")
    corners = np.where(named > 0, named - 1, np.repeat(np.cumsum(vertex)[face], counts) + named)
    return points, np.stack([begins[face], ends[face]], axis=1), counts, corners


def _lines_of(letters: npt.NDArray[np.uint8], begins: IntArray, ends: IntArray, kept: npt.NDArray[np.bool_]) -> bytes:
    return letters[: ends[-1] + 1][np.repeat(kept, ends - begins + 1)].tobytes()


def _rows(text: bytes) -> FloatArray:
    """The first three numbers of each line; all lines have equally many."""
    width = len(text[: text.find(b"\n")].split())
    numbers = _numbers(text, np.float64)
    return np.ascontiguousarray(numbers.reshape(text.count(b"\n"), width)[:, :3])


def _numbers(text: bytes, kind: type) -> npt.NDArray[Any]:
    """The numbers in a text, up to the first word that is none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of text that ends in something else than numbers
        return np.fromstring(text.decode("latin-1"), kind, sep=" ")
