"""Solids from the faces of bodies: skins of what has an inside, slabs of sheets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rlacd._native import poll_stop
from rlacd.repair.distance import SurfaceQuery, points_covering
from rlacd.repair.record import Record
from rlacd.repair.skin import skin
from rlacd.repair.soup import FLAT, Soup, on_repeated_edge
from rlacd.repair.union import one_body, slab_of_faces, split_labels, to_arrays, volume_of
from rlacd.repair.voxels import DEFAULT_GAP
from rlacd.repair.work import Piece, Work
from rlacd.solid.arrays import FloatArray
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Shape
from rlacd.solid.topology import BoolArray, IntArray, marked


def are_unbuilt(work: Work) -> bool:
    """Whether any faces are still to be built."""
    return not work.parts and len(work.soup.faces) > 0


def build_walls(work: Work) -> None:
    """Build what bounds something solid; the rest are sheets."""
    walls, sheets = walls_and_sheets(work.soup, work.record, ())
    work.parts = skins(walls)
    # Where faces of one body cross each other, they may be joined into a wrong skin: then all of them are sheets.
    is_skin = work.record.has("outer skin")
    wrong = [part.body for part in work.parts if is_skin[part.body] and _leads_away(part.shape, work.surface)]
    if wrong:
        walls, sheets = walls_and_sheets(work.soup, work.record, wrong)
        work.parts = skins(walls)
    work.sheets = sheets.in_patches()


def _leads_away(shape: Shape, surface: SurfaceQuery) -> bool:
    """Whether a skin leads farther away from the input than caps may."""
    vertices, faces = to_arrays(shape)
    points, _ = points_covering(vertices, faces, DEFAULT_GAP)
    return bool((surface.distance(points) > DEFAULT_GAP).any())


def has_sheets(work: Work) -> bool:
    """Whether sheets are still to be built."""
    return len(work.sheets.faces) > 0


def build_slabs(work: Work) -> None:
    """Give sheets thickness."""
    work.parts += [part._replace(is_slab=True) for part in skins(work.sheets)]


def walls_and_sheets(soup: Soup, record: Record, as_sheets: Sequence[int]) -> tuple[Soup, Soup]:
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
    leaky = np.union1d(leaky, np.array(as_sheets, dtype=np.int64))
    sheet = (sides.sheet & (sides.volume >= -none)[front]) | (flat[front] & flat[back]) | np.isin(soup.body, leaky)
    wall = (solid[front] | solid[back]) & ~sides.sheet & ~sheet

    record.note(soup.body[solid[back] & wall], "reoriented")
    record.note(soup.body[~wall & ~sheet], "outer skin")
    record.note(soup.body[soup.at_valence(soup.edges.valence > 2)], "outer skin")
    record.note(soup.body[sheet], "slab")
    poll_stop()
    mixed = np.bincount(soup.body[sheet], minlength=record.bodies) > 0
    return soup.only(~sheet & (wall | ~mixed[soup.body])), soup.only(sheet)


def skins(soup: Soup) -> list[Piece]:
    """Build the outer side components of a soup; sheets and flat bodies get thickness."""
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
        taken = one_body(*_wound_like(soup, keep))
        if taken is not None and not taken[1]:
            return [Piece(taken[0], int(soup.body[0]))]
    vertices, faces, label = _untwisted(soup, keep, flat)
    shapes = split_labels(vertices, faces, label)
    return [
        Piece(_solid(soup, shape, one, bool(has_sheet[one] | flat[one])), int(soup.body_of_side[one]))
        for one, shape in zip(np.unique(label), shapes, strict=True)
    ]


def _untwisted(soup: Soup, keep: BoolArray, flat: BoolArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Build side components; those that pass an edge twice from their insides.

    Where parts touch along an edge, their common outer skin passes the edge twice. Their insides are simple: those are
    built, turned inside out, and the union joins them.
    """
    vertices, faces, label = _skin(soup, keep, flat)
    if not (soup.edges.valence > 2).any():
        return vertices, faces, label
    sides, bodies = soup.sides, int(soup.body.max()) + 1
    pinched = marked(soup.body_of_side[label[on_repeated_edge(faces, len(vertices))]], bodies)
    # Only if the skin is one piece: volumes of crossing pieces do not add up to those of the insides.
    pinched &= np.bincount(soup.body_of_side, sides.volume > 0, bodies) == 1
    pinched[soup.body[sides.sheet]] = False
    if not pinched.any():
        return vertices, faces, label
    at = pinched[soup.body_of_side]
    rooms = at & (sides.volume < -FLAT * sides.area)
    vertices, faces, label = _skin(soup, (keep & ~at) | rooms, flat)
    faces[rooms[label]] = faces[rooms[label]][:, ::-1]
    return vertices, faces, label


def _solid(soup: Soup, mesh: tuple[FloatArray, IntArray], side: int, is_thin: bool) -> Shape:
    """A side component as a solid; sheets narrower than they become thick can cross themselves and be inside out."""
    solid = to_manifold(*mesh)
    if is_thin and volume_of(solid) <= 0:
        some = (soup.sides.label.reshape(-1, 2) == side).any(axis=1)
        return slab_of_faces(soup.vertices, soup.faces[some])
    return solid


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
