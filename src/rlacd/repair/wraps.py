"""Wraps: space that a ball cannot reach, closed on a grid and projected onto the surface."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from rlacd import _native
from rlacd._native import poll_stop, spread_points
from rlacd.repair.distance import MOST_POINTS, SurfaceQuery, is_tangle, points_covering, tangled_bodies
from rlacd.repair.soup import MOST_UNITED, Soup, boxes_of, face_normals
from rlacd.repair.state import Piece, State
from rlacd.repair.union import hull_of_points, slab_of_faces, unite
from rlacd.repair.voxels import Reach
from rlacd.repair.wanted import DEFAULT_GAP
from rlacd.solid.arrays import Int64Array
from rlacd.solid.component import DENSE, concatenated
from rlacd.solid.frame import HALF_THICKNESS, ROUNDING
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import surface_of

# Least share of the solid's volume of a void of an outer skin that is filled, and greatest of slits: voids in furniture
# have 0.04 and more, crevices at most 0.0023.
_SLIT_VOLUME = 0.01
# Least depth of a slit that is filled, and its greatest width, elsewhere and between caps, as in a fridge whose bodies
# close each other (multiples of the gap): what is shallower needs no cut, and what is wider leaves steps of the grid.
# Filling has to remove the last share of the surface.
_DEEP, _BESIDE, _BETWEEN_CAPS, _BARED = 1.5, 1 / 16, 1 / 4, 0.004
# A union with more tunnels has slits full of bridges: noise leaves them where walls of dense bodies touch.
_TUNNELS = 25
# Where a filled void has twice the triangles, at least 1 - 2 ** -0.05 of the surface has to be gone. Of 30 meshes of
# the corpus with filled voids, those that meet this have 0.73 of the hulls without filling, the others 1.04.
_TRIANGLES = 0.05
# Pairs of faces of different sheets that touch, for each face, above which no two faces are united.
_PAIRS_A_FACE = 4
# More sheets than this are not united one by one: that would take seconds, and cutting the result even longer. Neither
# are fewer sheets that all cross each other: 40 have 780 crossings (a second or two), 80 have 3,160 (ten seconds).
_CROWD, _CROSSINGS = 300, 1000


def keep_apart(state: State, sheets: Soup) -> bool:
    """Make every face of sheets a slab, and unite none, if their union would be cut into many more pieces than faces.

    Returns whether it was done: all has to be sheets, and they have to cross often.
    """
    most, faces = _PAIRS_A_FACE * len(sheets.faces), sheets.faces.astype(np.int32)
    if state.parts or len(faces) > _CROWD or _native.crossings(sheets.vertices, faces, sheets.body, most)[0] <= most:
        return False
    # As one mesh: manifold3d would unite what it composes.
    slabs = concatenated([surface_of(hull_of_points(sheets.vertices[face])) for face in sheets.faces])
    state.parts = [Piece(to_manifold(*slabs), int(sheets.body.min()), is_slab=True)]
    state.is_apart = True
    state.beyond[:] = HALF_THICKNESS
    state.warnings.append("The sheets cross too often to be united: each face is a slab of its own.")
    return True


def wrap_sheets(state: State, sheets: Soup) -> bool:
    """Wrap all bodies with sheets as one if these are too many, such as leaves or feathers, to be united one by one.

    Returns whether it was done.
    """
    is_slab = state.has("slab")
    if is_slab.sum() <= _CROWD and _crossings(sheets, sheets.sides.label[0::2]) <= _CROSSINGS:
        return False
    soup = state.of_bodies(is_slab)
    points, _ = points_covering(soup.vertices, soup.faces, state.reach.pitch / 2)
    wrap = state.reach.wrap(state.reach.around_points(points))
    if wrap.volume() <= 0:
        return False
    state.note(soup.body, "wrapped")
    state.parts = [part for part in state.parts if not is_slab[part.body]]
    state.parts.append(Piece(wrap, int(soup.body.min()), is_slab=True))
    return True


def wrap_all(state: State) -> None:
    """Take what the ball cannot reach from outside all bodies to be solid."""
    state.solid, state.cavity_walls = _wrapped(state, state.soup), None
    state.note(state.soup.body, "wrapped")
    state.parts = [Piece(state.solid, 0)]
    state.warnings.append(
        "The surface crosses itself too often to be united exactly, so the solid is what a ball of radius "
        f"{state.frame.unit.words(state.wanted.gap)} cannot reach from outside."
    )


def rebuild_tangles(state: State) -> None:
    """Build bodies that cross themselves from the place of their faces alone, whatever their windings.

    A few faces become a slab each. Where they are many, what the ball cannot reach from outside the body is solid.
    """
    soup = state.soup
    if state.solid.volume() == 0 or np.bincount(soup.body).min() > DENSE or not is_tangle(state.query()):
        return
    tangled = tangled_bodies(state.query(), soup.vertices, soup.faces, soup.body)
    tangled = tangled[~state.has("slab")[tangled]].tolist()  # slabs are thin enough to be cut
    if not tangled:
        return
    state.is_tangled[tangled] = True
    state.parts = [part for part in state.parts if not state.is_tangled[part.body]]
    for body in tangled:
        poll_stop()
        own = soup.only(soup.body == body)
        count = len(own.faces)
        is_few = count <= _CROWD and _crossings(own, np.arange(count)) <= _CROSSINGS
        solid = slab_of_faces(own.vertices, own.faces) if is_few else _wrapped(state, own)
        state.note(own.body, "slab" if is_few else "wrapped")
        state.parts.append(Piece(solid, body))
    state.unite_parts()
    bodies = "1 body crosses itself" if len(tangled) == 1 else f"{len(tangled)} bodies cross themselves"
    state.warnings.append(f"{bodies} too often to be cut, so whatever the faces enclose is taken to be solid.")


def fill_voids(state: State) -> None:
    """Fill voids with openings too narrow for the ball: all that sheets enclose, large ones in outer skins."""
    is_open = (state.has("slab") | state.by_hidden_caps) & ~state.is_tangled
    walls = state.of_bodies(is_open | (state.has("outer skin") & ~state.is_tangled))
    if not _may_fill(state) or not _is_large(state, walls) or not state.reach.void.any():
        return
    points, on = points_covering(walls.vertices, walls.faces, DEFAULT_GAP)
    reach, void = state.reach, state.reach.voids_near(points)
    voids = np.setdiff1d(void, 0)
    is_large = np.bincount(reach.void.ravel())[voids] * reach.pitch**3 >= _SLIT_VOLUME * state.solid.volume()
    cells = reach.voids_outside(voids[is_large | np.isin(voids, void[is_open[walls.body[on]]])], state.query())
    if len(cells) == 0:
        return
    wrap = reach.wrap(reach.around_cells(cells), state.query())
    filled = unite([state.solid, wrap])
    triangles = filled.num_tri() / state.solid.num_tri()
    bared = filled.surface_area() * triangles**_TRIANGLES
    if filled.volume() <= state.solid.volume() or bared >= state.solid.surface_area():
        return
    around = walls.body[on[np.isin(void, reach.void.ravel()[cells])]]
    wrapped = around[is_open[around]]
    state.note(wrapped, "wrapped")
    state.solid = filled
    state.parts.append(Piece(wrap, int(wrapped.min(initial=state.bodies - 1))))


def fill_slits(state: State) -> None:
    """Fill slits in outer skins and along fillings that nothing can reach: cuts would have to follow them."""
    has = state.has
    has_slits = (has("outer skin") | has("wrapped") | state.by_hidden_caps) & ~state.is_tangled
    may_have_slits = _is_large(state, state.of_bodies(has_slits)) or state.solid.genus() > _TUNNELS
    if not (_may_fill(state) and may_have_slits):
        return
    query, gap = state.query(), state.wanted.gap
    points, on = spread_points(query.vertices, query.faces, DEFAULT_GAP)
    every = -(-len(points) // MOST_POINTS)  # narrow faces have points at all their corners, however few are asked for
    points, on = points[::every], on[::every]
    deep = state.reach.is_deep(points, _DEEP * gap)
    points, across = points[deep], face_normals(query.vertices, query.faces[on[deep]])
    is_on_cap = state.surface.is_beyond(points, 2 * HALF_THICKNESS)
    across *= gap * np.where(is_on_cap, _BETWEEN_CAPS, _BESIDE)[:, None]
    for side in (1, -1):  # the solid lies on both sides of a slit
        beside = points + side * across
        off = np.flatnonzero(query.is_beyond(beside, ROUNDING))  # in a corner, that is on the other wall
        inside = off[query.inside(beside[off])]
        points, across = points[inside], across[inside]
    if len(points) == 0:
        return
    wrap = state.reach.wrap(state.reach.around_points(points), query)
    filled = unite([state.solid, wrap])
    is_little = abs(filled.volume() / state.solid.volume() - 1) < _SLIT_VOLUME
    if is_little and filled.surface_area() < (1 - _BARED) * state.solid.surface_area():
        state.solid = filled
        state.parts.append(Piece(wrap, int(has_slits.argmax())))


def _may_fill(state: State) -> bool:
    """Whether what nothing can reach may become solid."""
    fills = state.wanted.open_bodies != "thin" and not state.wanted.keep_cavities and not state.is_apart
    return fills and state.solid.volume() != 0 and len(state.parts) <= MOST_UNITED  # more of them overlap each other


def _is_large(state: State, walls: Soup) -> bool:
    """Whether faces could enclose a ball."""
    return bool(walls.area.sum() >= 4 * np.pi * state.wanted.gap**2)


def _wrapped(state: State, soup: Soup) -> Manifold:
    """A solid of all that the ball cannot reach from outside some faces."""
    surface = SurfaceQuery(soup.vertices, soup.faces, state.surface.threads)
    reach = Reach(surface, state.wanted.gap, state.wanted.cells)
    return reach.wrap(~reach.reached)


def _crossings(soup: Soup, patch: Int64Array) -> int:
    """Count the pairs of patches of faces whose boxes meet."""
    lower, upper = boxes_of(soup.vertices[soup.faces], patch)
    count = 0
    for i in range(len(lower)):
        poll_stop()
        count += int(((lower[i] <= upper[i + 1 :]) & (lower[i + 1 :] <= upper[i])).all(axis=1).sum())
    return count
