"""Solids from the faces of bodies: exact skins of what has an inside, slabs of sheets.

Every fan of corners that meets at a vertex within one region of space becomes a separate vertex, so surfaces that
merely touch at a vertex or an edge come apart. Fans on a sheet move away from it; free edges of sheets get a rim.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import Manifold

from rlacd._native import angles, components, poll_stop
from rlacd.repair.distance import SurfaceQuery, points_covering
from rlacd.repair.soup import FLAT, Soup, face_normals
from rlacd.repair.state import Piece, State
from rlacd.repair.union import slab_of_faces, to_arrays
from rlacd.repair.wanted import DEFAULT_GAP
from rlacd.repair.wraps import keep_apart, wrap_sheets
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, dots
from rlacd.solid.frame import HALF_THICKNESS
from rlacd.solid.manifold import to_manifold
from rlacd.solid.topology import marked, nondegenerate


def build_walls(state: State) -> None:
    """Build what bounds something solid, and give the rest, which are sheets, thickness."""
    walls, sheets = walls_and_sheets(state, ())
    state.parts = skins(walls)
    # Where faces of one body cross each other, they may be joined into a wrong skin: then all of them are sheets.
    is_skin = state.has("outer skin")
    wrong = [part.body for part in state.parts if is_skin[part.body] and _leads_away(part.shape, state.surface)]
    if wrong:
        walls, sheets = walls_and_sheets(state, wrong)
        state.parts = skins(walls)
    sheets = sheets.in_patches()
    if not (len(sheets.faces) and (keep_apart(state, sheets) or wrap_sheets(state, sheets))):
        state.parts += skins(sheets, are_slabs=True)


def _leads_away(shape: Manifold, surface: SurfaceQuery) -> bool:
    """Whether a skin leads farther away from the input than caps may."""
    vertices, faces = to_arrays(shape)
    points, _ = points_covering(vertices, faces, DEFAULT_GAP)
    return bool(surface.is_beyond(points, DEFAULT_GAP).any())


def walls_and_sheets(state: State, as_sheets: Sequence[int]) -> tuple[Soup, Soup]:
    """The faces that bound something solid, and those that become slabs."""
    soup, sides = state.soup, state.soup.sides
    front, back = sides.label[0::2], sides.label[1::2]
    none = FLAT * sides.area
    solid = sides.volume > none
    flat = np.abs(sides.volume) <= none
    sheet = (sides.sheet & (sides.volume >= -none)[front]) | (flat[front] & flat[back]) | np.isin(soup.body, as_sheets)
    wall = (solid[front] | solid[back]) & ~sides.sheet & ~sheet

    state.note(soup.body[solid[back] & wall], "reoriented")
    state.note(soup.body[~wall & ~sheet], "outer skin")
    state.note(soup.body[soup.at_edges(soup.edges.face_count > 2)], "outer skin")
    state.note(soup.body[sheet], "slab")
    poll_stop()
    return soup.only(~sheet), soup.only(sheet)


def skins(soup: Soup, *, are_slabs: bool = False) -> list[Piece]:
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
    vertices, faces, label = _untwisted(soup, keep, flat)
    order, pieces = np.argsort(label, kind="stable"), []
    for some in np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(order) else ():
        poll_stop()
        used, corners = np.unique(faces[some], return_inverse=True)
        side, solid = label[some[0]], to_manifold(vertices[used], corners.reshape(-1, 3))
        # A sheet narrower than thick may come out inside out: it is built face by face.
        if (has_sheet[side] or flat[side]) and solid.volume() <= 0:
            solid = slab_of_faces(soup.vertices, soup.faces[(sides.label.reshape(-1, 2) == side).any(axis=1)])
        if not solid.is_empty():
            pieces.append(Piece(solid, int(soup.body_of_side[side]), are_slabs))
    return pieces


def _untwisted(soup: Soup, keep: BoolArray, flat: BoolArray) -> tuple[FloatArray, Int64Array, Int64Array]:
    """Build side components; a skin that passes an edge twice is built from its insides.

    Where parts touch along an edge, their common outer skin passes the edge twice. The skins of their insides do not:
    these are built, turned around, and joined by the union.
    """
    vertices, faces, label = _skin(soup, keep, flat)
    if not (soup.edges.face_count > 2).any():
        return vertices, faces, label
    sides, bodies = soup.sides, int(soup.body.max()) + 1
    edge = (faces * len(vertices) + np.roll(faces, -1, axis=1)).ravel()
    order = np.argsort(edge, kind="stable")
    repeated = order[1:][np.diff(edge[order]) == 0] // 3
    pinched = marked(soup.body_of_side[label[repeated]], bodies)
    # Only if the skin is one piece: volumes of crossing pieces do not add up to those of the insides.
    pinched &= np.bincount(soup.body_of_side, sides.volume > 0, bodies) == 1
    pinched[soup.body[sides.sheet]] = False
    if not pinched.any():
        return vertices, faces, label
    at = pinched[soup.body_of_side]
    insides = at & (sides.volume < -FLAT * sides.area)
    vertices, faces, label = _skin(soup, (keep & ~at) | insides, flat)
    faces[insides[label]] = faces[insides[label]][:, ::-1]
    return vertices, faces, label


# A sharp fold would push its vertex far out to keep the distance to both flanks; stop at this multiple.
_LONGEST_MITER = 2.0


def _skin(soup: Soup, keep: BoolArray, flat: BoolArray) -> tuple[FloatArray, Int64Array, Int64Array]:
    """Build the surfaces of chosen side components ``[C]``; sheets and flat ones get thickness: sides move outward.

    Returns
    -------
    tuple
        New vertices ``[N, 3]``, faces ``[M, 3]`` and the side component ``[M]`` of each new face.
    """
    vertices, faces, sides = soup.vertices, soup.faces, soup.sides
    front = sides.label[0::2]
    thin = keep[front] & (sides.sheet | flat[front])
    kept = np.flatnonzero(keep[sides.label])  # sides
    used = keep[sides.label[sides.facing[:, 0]]]
    wedges, facing = sides.wedges[used], sides.facing[used]
    is_rim = wedges[:, 0] == wedges[:, 1]
    poll_stop()
    # Corners of the first and of the second side of a wedge, at the smaller and at the larger end of its edge.
    slot = np.full(2 * len(faces), -1, dtype=np.int64)
    slot[kept] = 3 * np.arange(len(kept))
    ends = [_corners_at(faces, halfedge, slot[side]) for halfedge, side in zip(wedges.T, facing.T, strict=True)]
    low, high = (np.stack(some) for some in zip(*ends, strict=True))
    poll_stop()
    inner = ~is_rim
    number, fan = components(
        3 * len(kept), np.concatenate([low[0, inner], high[0, inner]]), np.concatenate([low[1, inner], high[1, inner]])
    )
    face, back = kept // 2, kept % 2 == 1
    base = np.empty(number, dtype=np.int64)
    base[fan] = faces[face].ravel()
    positions = vertices[base]
    poll_stop()
    if thin.any():
        positions += HALF_THICKNESS * _fan_offsets(vertices, faces[face], back, thin[face], fan, number)
    triangles = fan.reshape(-1, 3).copy()
    triangles[back] = triangles[back][:, ::-1]
    rim_label = sides.label[facing[is_rim, 0]]
    rim_faces, rim_faces_label, centers = _rims(fan[low[:, is_rim]], fan[high[:, is_rim]], rim_label, number)
    return (
        np.concatenate([positions, vertices[base[centers]]]),
        np.concatenate([triangles, rim_faces]),
        np.concatenate([sides.label[kept], rim_faces_label]),
    )


def _corners_at(faces: Int64Array, halfedge: Int64Array, slot: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Slots of the corners at the smaller and the larger end of halfedges; `slot` is the first of each side."""
    face, here = np.divmod(halfedge, 3)
    there = (here + 1) % 3
    forward = faces[face, here] < faces[face, there]
    return slot + np.where(forward, here, there), slot + np.where(forward, there, here)


def _rims(
    low: Int64Array, high: Int64Array, label: Int64Array, number: int
) -> tuple[Int64Array, Int64Array, Int64Array]:
    """Close rims: the faces ``[M, 3]``, their labels, and for every new vertex (from `number` on) a fan at its place.

    A rim edge runs from low to high; one side of its face is at the wedge's beginning (fans ``[0]``), one at its end.

    Each rim quad leaves a link between two fans at both of its ends. Two links between the same two fans match each
    other; where three or more free edges meet in a vertex, longer cycles bound a small polygon, closed here with a fan
    of triangles around a new central vertex.
    """
    quads = [np.stack([high[0], low[0], low[1]], axis=1), np.stack([high[0], low[1], high[1]], axis=1)]
    tail, head = np.concatenate([low[1], high[0]]), np.concatenate([low[0], high[1]])
    cycle = components(number, tail, head)[1][tail]
    # Matched pairs need no cap: link (a, b) with (b, a).
    unmatched = np.flatnonzero(~np.isin(tail * number + head, head * number + tail))
    tail, head, twice = tail[unmatched], head[unmatched], np.tile(label, 2)
    _, first, center = np.unique(cycle[unmatched], return_index=True, return_inverse=True)
    poll_stop()
    rim_faces = np.concatenate([*quads, np.stack([tail, head, number + center.reshape(-1)], axis=1)])
    real = nondegenerate(rim_faces)
    return rim_faces[real], np.append(twice, twice[unmatched])[real], tail[first]


def _fan_offsets(
    vertices: FloatArray, corners: Int64Array, back: BoolArray, thin: BoolArray, fan: Int64Array, number: int
) -> FloatArray:
    """Return the way ``[number, 3]`` of each fan that leads 1 off all its faces; zero for fans without a sheet."""
    normal = np.repeat(face_normals(vertices, corners) * np.where(back, -1, 1)[:, None], 3, axis=0)
    points = vertices[corners]
    along, away = (np.roll(points, -k, axis=1) - points for k in (1, 2))
    angle = angles(np.linalg.norm(np.cross(along, away), axis=2).ravel(), dots(along, away).ravel())
    poll_stop()
    total = np.stack([np.bincount(fan, angle * normal[:, k], number) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean = np.where(length > 1e-6, total / np.maximum(length, np.finfo(float).tiny), 0.0)
    # The miter: far enough along the mean normal to be at distance 1 from the steepest face that has a direction.
    steepest = np.ones(number)
    np.minimum.at(steepest, fan, np.where(angle > 0, dots(normal, mean[fan]), 1.0))
    sees_sheet = np.bincount(fan, np.repeat(thin, 3), number) > 0
    far = np.where(sees_sheet, 1 / np.maximum(steepest, 1 / _LONGEST_MITER), 0.0)
    return np.asarray(mean * far[:, None])
