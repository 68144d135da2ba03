"""Solids from the faces of bodies: skins of what has an inside, slabs of sheets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery, probes
from rlacd.repair.record import Record
from rlacd.repair.skin import skin
from rlacd.repair.slabs import slab_of_faces
from rlacd.repair.soup import FLAT, Soup, crossed_share, on_repeated_edge
from rlacd.repair.union import one_body, split_labels, to_arrays, volume_of
from rlacd.solid.frame import FloatArray
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Shape
from rlacd.solid.thickness import HALF_THICKNESS
from rlacd.solid.topology import BoolArray, IntArray

# Slabs of more triangles are not united from their faces: that would take seconds.
_MOST_OF_A_SLAB = 1000


def walls_and_sheets(soup: Soup, record: Record, as_sheets: IntArray) -> tuple[Soup, Soup]:
    """The faces that bound something solid, and those that become slabs."""
    sides = soup.sides
    front, back = sides.label[0::2], sides.label[1::2]
    none = FLAT * sides.area
    sheet_area = np.bincount(front, soup.area * sides.sheet, len(none))
    # A component that is mostly sheet yet has negative volume joins the inside with the outside: its body is
    # nowhere solid, so all of it becomes slabs (whose cavities are filled later).
    leaky = soup.body_of_side[(sides.volume < -none) & (4 * sheet_area > sides.area)]
    solid = sides.volume > none
    flat = np.abs(sides.volume) <= none
    leaky = np.union1d(leaky, as_sheets)
    sheet = (sides.sheet & (sides.volume >= -none)[front]) | (flat[front] & flat[back]) | np.isin(soup.body, leaky)
    wall = (solid[front] | solid[back]) & ~sides.sheet & ~sheet
    sheet |= _poking_out(soup, wall, sides.sheet & ~sheet)

    record.note(soup.body[solid[back] & wall], "reoriented")
    record.note(soup.body[~wall & ~sheet], "outer skin")
    record.note(soup.body[soup.at_valence(soup.edges.valence > 2)], "outer skin")
    record.note(soup.body[sheet], "slab")
    poll_stop()
    mixed = np.bincount(soup.body[sheet], minlength=record.bodies) > 0
    return soup.only(~sheet & (wall | ~mixed[soup.body])), soup.only(sheet)


def skins(soup: Soup, record: Record, by_faces: bool = False) -> list[tuple[Shape, int]]:
    """Build the outer side components of a soup; sheets and flat bodies get thickness.

    If it says so, slabs that cross themselves, as where sheets lie closer than they become thick, are united from
    slabs of their faces; the soup has nothing but sheets then.
    """
    if len(soup.faces) == 0:
        return []
    sides = soup.sides
    front = sides.label[0::2]
    none = FLAT * sides.area
    has_sheet, is_front = np.zeros((2, len(none)), dtype=bool)
    has_sheet[front[sides.sheet]] = True
    is_front[front] = True
    # The two side components of a flat closed body mirror each other: build the fronts.
    flat = (np.abs(sides.volume) <= none) & ~has_sheet & is_front
    keep = (sides.volume > none) | (has_sheet & (sides.volume >= -none)) | flat
    if keep.sum() == 1 and not has_sheet.any() and (soup.edges.valence == 2).all():
        simple = _wound_like(soup, keep)
        taken = one_body(*simple)
        if taken is not None and not taken[1]:
            record.faces_out[soup.body[0]] += len(simple[1])
            return [(taken[0], int(soup.body[0]))]
    vertices, faces, label = _skin(soup, keep, flat)
    # Where parts touch along an edge, their common outer skin passes the edge twice. Their insides are simple:
    # build those, turned inside out, and let the union join them.
    pinched = np.zeros(record.bodies, dtype=bool)
    if (soup.edges.valence > 2).any():
        pinched[soup.body_of_side[label[on_repeated_edge(faces, len(vertices))]]] = True
    # Only if the skin is one piece: volumes of crossing pieces do not add up to those of the insides.
    pinched &= np.bincount(soup.body_of_side, sides.volume > 0, record.bodies) == 1
    pinched[soup.body[sides.sheet]] = False
    pinched = pinched[soup.body_of_side]
    if pinched.any():
        rooms = pinched & (sides.volume < -none)
        vertices, faces, label = _skin(soup, (keep & ~pinched) | rooms, flat)
        faces[rooms[label]] = faces[rooms[label]][:, ::-1]
    built, count = np.unique(label, return_counts=True)
    body = soup.body_of_side[built]
    solids: list[Shape] = [to_manifold(v, f) for v, f in split_labels(vertices, faces, label)]
    # Sheets narrower than their intended thickness can cross themselves, and come out inside out.
    for i in np.flatnonzero(has_sheet[built] | flat[built]):
        poll_stop()
        if volume_of(solids[i]) <= 0 or (by_faces and crosses_itself(solids[i])):
            some = (sides.label.reshape(-1, 2) == built[i]).any(axis=1)
            slab = slab_of_faces(soup.vertices, soup.faces[some])
            solids[i], count[i] = slab, slab.num_tri()
    np.add.at(record.faces_out, body, count)
    return list(zip(solids, body.tolist(), strict=True))


def _skin(soup: Soup, keep: BoolArray, flat: BoolArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Build side components, sheets and flat ones with thickness."""
    front = soup.sides.label[0::2]
    thin = keep[front] & (soup.sides.sheet | flat[front])
    return skin(soup.vertices, soup.faces, soup.sides, keep, thin, HALF_THICKNESS)


def _wound_like(soup: Soup, keep: BoolArray) -> tuple[FloatArray, NDArray[np.int32]]:
    """The faces of a closed soup, each showing the side that is kept; vertices in the order in which faces use them."""
    corners = soup.faces.ravel()
    first = np.full(len(soup.vertices), len(corners))
    first[corners[::-1]] = np.arange(len(corners) - 1, -1, -1)
    used = np.argsort(first, kind="stable")[: int((first < len(corners)).sum())]
    number = np.empty(len(soup.vertices), dtype=np.int32)
    number[used] = np.arange(len(used))
    faces = number[soup.faces]
    back = keep[soup.sides.label[1::2]]
    faces[back] = faces[back, ::-1]
    return soup.vertices[used], faces


def crosses_itself(slab: Shape) -> bool:
    """Whether faces of a slab cross that do not meet; False if it has too many to be built in another way."""
    vertices, faces = to_arrays(slab)
    return len(faces) <= _MOST_OF_A_SLAB and crossed_share(vertices, faces) > 0


def _poking_out(soup: Soup, wall: BoolArray, inner: BoolArray) -> BoolArray:
    """Which sheets that begin inside a body, such as a fin that leans inwards, lead out of all bodies: ``[F]``."""
    pokes = np.zeros(len(soup.faces), dtype=bool)
    if not inner.any() or not wall.any():
        return pokes
    points = probes(soup.vertices, soup.faces[inner])
    walls = SurfaceQuery(soup.vertices, soup.faces[wall])
    apart = (walls.distance(points.reshape(-1, 3)) > 2 * HALF_THICKNESS).reshape(points.shape[:2])
    outside = np.zeros_like(apart)
    poll_stop()
    outside[apart] = np.abs(walls.winding(points[apart])) < 0.5
    pokes[inner] = outside.any(axis=1)
    return pokes
