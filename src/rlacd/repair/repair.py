"""From any soup of triangles to one closed, oriented solid, by the least change that works.

Input: an `InputMesh`. Output: a `Solid`, with the step that every body needed. In order:

1. equal vertices are merged; degenerate and doubled faces dropped;
2. free edges that nearly coincide are welded, T-junctions included;
3. the sides of the faces are joined around the edges (`topology`): a body whose faces all have an inside and an outside
   is solid and keeps its faces exactly, whatever their windings were; faces it encloses are dropped;
4. holes are capped if every point of the cap stays near the input's surface, or if nothing can reach it;
5. whatever is still open consists of sheets: each is thickened into a slab, face by face, without remeshing;
6. all solids are united and their cavities filled;
7. any remaining room that no ball can enter is closed by a voxel wrap projected onto the surface.

The watertight-manifold algorithm of Huang et al. (2018) could replace step 5, but it grows every sheet by a voxel and
turns a dozen exact faces into tens of thousands of approximate ones; steps 3 to 5 keep the faces of the input.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from manifold3d import Manifold

from rlacd import _native
from rlacd._native import PointTree, poll_stop
from rlacd.errors import EmptyMeshError
from rlacd.memory import BYTES_REPAIRED, require_memory
from rlacd.repair.caps import FLAPS, close_holes
from rlacd.repair.distance import SurfaceQuery, points_covering, shared_faces, spread_points
from rlacd.repair.holes import MOST_FREE_EDGES, close_cracks
from rlacd.repair.skin import skin
from rlacd.repair.soup import NO_AREA, Soup, hidden_faces, on_repeated_edge
from rlacd.repair.union import (
    MOST_UNITED,
    Shape,
    as_manifold,
    hull_of_points,
    slab_of_faces,
    split_labels,
    to_arrays,
    unite,
    unite_around_cavities,
    volume_of,
)
from rlacd.repair.voxels import Reach
from rlacd.solid.arrays import IntArray as Indices
from rlacd.solid.frame import FloatArray, Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import BodyRepair, Solid
from rlacd.solid.topology import (
    BoolArray,
    Edges,
    IntArray,
    bodies_of,
    detach_films,
    face_areas,
    is_balanced,
    signed_tetrahedra,
)

STEPS = ("closed", "reoriented", "outer skin", "welded", "capped", "slab", "wrapped", "hull")
"""The possible steps for a body, from the least change to the most."""

HALF_THICKNESS = 1e-3
"""Half the thickness of the slab a sheet becomes, in frame units."""

GAP = 0.03
"""Greatest distance of a cap from the input's surface, and the radius of the ball a gap must stop, in frame units, by
default."""

CELLS_ACROSS = 1.5
"""Least radius of a ball, in cells of the grid that it rolls on."""

# Widest slit between caps that is filled, as a share of the gap, and the distance up to which a cap is part of the
# solid's surface.
_SLIT, _ON_SURFACE = 1 / 4, 1e-6

_WELDS = (2e-5, 5e-4)
_WRAP_ERROR = 4e-3
# What a capped body may lose before its caps are made another way.
_LOST = 5e-3
# More sheets than this are not united one by one: that would take seconds, and cutting the result even longer. Neither
# are fewer sheets that all cross each other: 40 have 780 crossings (a second or two), 80 have 3,160 (ten seconds).
_CROWD, _CROSSINGS = 300, 1000
# A closed body with less volume per area is flat: there is nothing to cut.
_FLAT = 1e-6
# Points of a triangle at which it is looked whether it sticks out of a body: near its corners, its edges, its middle.
_PROBES = np.array([(18, 1, 1), (1, 18, 1), (1, 1, 18), (9, 9, 2), (9, 2, 9), (2, 9, 9), (7, 7, 6)]) / 20
# manifold3d collapses edges shorter than 1e-12, and swaps those of faces that are no higher, or folded back onto a
# neighbour in a plane within 1e-12.
_THIN = 1e-11


def repair(
    mesh: InputMesh,
    *,
    resolution: int = 100,
    open_bodies: str = "auto",
    gap: float = GAP,
    threads: int | None = None,
    keep_cavities: bool = False,
) -> Solid:
    """Turn a mesh into one closed, oriented solid.

    Parameters
    ----------
    mesh
        The loaded mesh.
    resolution
        Cells along the longest side of the grid on which enclosed rooms are searched.
    open_bodies
        ``auto``: a body with openings is solid if nothing can get inside, or if the openings look like damage; else it
        is a shell as thin as its faces. ``solid``: every body is filled that has an inside once its openings are
        closed. ``thin``: open bodies stay shells.
    gap
        Radius of a ball, where the longest side is 2: what it cannot get through is closed. Small balls roll on a finer
        grid than `resolution` asks for.
    threads
        Number of threads that measure distances; all cores by default. The result does not depend on it.
    keep_cavities
        Keep sealed rooms empty: those that a union encloses, and closed bodies wound opposite to the body around them.
        A closed sheet without thickness still becomes a solid.

    Returns
    -------
    Solid
        Never empty.

    Raises
    ------
    EmptyMeshError
        There are no points.
    Stopped
        There is no time left: `rlacd.solid.cover` needs next to none.
    """
    poll_stop()
    warnings = list(mesh.warnings)
    points, corners = _used(mesh)
    if len(points) == 0:
        raise EmptyMeshError("the mesh has no points, so there is nothing to decompose: check the file or its export")
    poll_stop()
    frame = Frame.of(points)
    points = frame.to_frame(points)
    poll_stop()
    welded_vertices, welded_faces, is_film = _native.weld(points, corners)
    taken = _taken_as_it_is(welded_vertices, welded_faces)
    if taken is not None:
        return Solid(taken[0], (welded_vertices, welded_faces), frame, (taken[1],), tuple(warnings), is_as_given=True)
    require_memory(len(welded_faces), BYTES_REPAIRED, mesh.name)
    vertices, faces = detach_films(welded_vertices, welded_faces.astype(np.int64), is_film)
    detached = np.asarray(faces[:, 0] >= len(welded_vertices))
    faces = faces[~_is_inside(vertices, faces, detached, threads)]
    surface = (vertices, faces.astype(np.int32))

    if len(faces) == 0 or face_areas(vertices, faces).max() < NO_AREA:
        warnings.append("no face has an area: the hull of the points stands in for the solid")
        solid = hull_of_points(points, HALF_THICKNESS)
        body = BodyRepair(0, "hull", len(mesh.faces), solid.num_tri(), 0.0)
        return Solid(solid, surface, frame, (body,), tuple(warnings))

    query = SurfaceQuery(vertices, faces, threads)
    cells = max(resolution, math.ceil(2 * CELLS_ACROSS / gap)) if gap < GAP else resolution
    work = _Repair(query, frame, cells, gap, keep_cavities, open_bodies)
    bend = 1.0
    if work.lost > _LOST:
        # A cap that bends little can cross the body's own faces, which turns some of it inside out: try small caps.
        other = _Repair(query, frame, cells, gap, keep_cavities, open_bodies, bend=0.0)
        if other.lost < work.lost:
            work, bend = other, 0.0
    doubted = work.doubted()
    if len(doubted):
        # If faces of one body cross each other, they may be joined into a wrong skin: try them as sheets.
        other = _Repair(query, frame, cells, gap, keep_cavities, open_bodies, doubted, bend)
        if other.deviation.max() < work.deviation.max():
            work = other
    return Solid(work.solid, surface, frame, work.report(), tuple(warnings + work.warnings), body_of=work.body_of_input)


def _used(mesh: InputMesh) -> tuple[FloatArray, IntArray]:
    """The points that faces use and the faces by these; all points if there are no faces."""
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    if used.all() or len(mesh.faces) == 0:
        return mesh.vertices, mesh.faces
    return mesh.vertices[used], (np.cumsum(used) - 1)[mesh.faces]


def _taken_as_it_is(vertices: FloatArray, faces: Indices) -> tuple[tuple[FloatArray, Indices], BodyRepair] | None:
    """One closed and oriented body, as it is; None for anything else.

    The vertices and faces are those that manifold3d would make of it, in its order, as long as it would leave all edges
    alone; it takes twenty times as long.
    """
    found = _native.closed_bodies(vertices, faces)
    if found is None or len(found[1]) > 1:
        return None
    _, (volume,), (area,), _, has_no_pinch, least_height, least_fold = found
    if abs(volume) <= 2 * _FLAT * area or least_height * min(least_fold, 1.0) <= _THIN:
        return None
    outward = faces if volume > 0 else np.ascontiguousarray(faces[:, ::-1])
    separate = (vertices, outward) if has_no_pinch else _native.separate_fans(vertices, outward)
    step = "closed" if volume > 0 else "reoriented"
    return _native.along_a_curve(*separate), BodyRepair(0, step, len(faces), len(faces), 0.0)


def _is_inside(vertices: FloatArray, faces: IntArray, film: BoolArray, threads: int | None) -> BoolArray:
    """Return ``[F]`` which films lie inside the other faces: where two bodies touch."""
    inside = film.copy()
    if film.any():
        middle = vertices[faces[film]].mean(axis=1)
        inside[film] = np.abs(SurfaceQuery(vertices, faces[~film], threads).winding(middle)) > 0.75
    return inside


class _Repair:
    """The steps on one input; `solid`, `report()` and `warnings` are the result.

    Bodies are numbered after cracks are welded; `step`, `deviation` and `faces_out` are per body.
    """

    def __init__(
        self,
        surface: SurfaceQuery,
        frame: Frame,
        resolution: int,
        gap: float,
        keep_cavities: bool,
        open_bodies: str,
        as_sheets: IntArray | None = None,
        bend: float = 1.0,
    ) -> None:
        self.input = surface
        self.frame = frame
        self.resolution = resolution
        self.gap = gap
        self.keep_cavities = keep_cavities
        self.open_bodies = open_bodies
        self.mouths: dict[int, FloatArray] = {}  # of hollow bodies, the centre of their widest opening
        self.bend = bend
        self.lost = 0.0  # how far what a capped body lost lies from the solid
        self.as_sheets = np.empty(0, dtype=np.int64) if as_sheets is None else as_sheets
        self.warnings: list[str] = []

        faces, origin = close_cracks(surface.vertices, surface.faces, _WELDS)
        self.bodies, body = bodies_of(faces, Edges.of(faces, len(surface.vertices)))
        self.body_of_input = np.zeros(len(surface.faces), dtype=np.int64)
        self.body_of_input[origin] = body
        self.step = np.zeros(self.bodies, dtype=np.int64)
        self.deviation = np.zeros(self.bodies)
        self.faces_out = np.zeros(self.bodies, dtype=np.int64)
        self.by_room = np.zeros(self.bodies, dtype=bool)  # capped only because nothing can reach the cap
        self.hidden, self.across = np.empty((2, 0, 3))  # points of such caps, and the normals there
        self._note(body[(faces != surface.faces[origin]).any(axis=1)], "welded")

        soup = Soup(surface.vertices, faces, body)
        poll_stop()
        if self._is_oriented(soup):
            parts = self._as_they_are(soup)
        else:
            soup = self._cap(self._drop_hidden(self._trust_windings(soup)))
            parts = self._build_or_wrap(soup)
        if keep_cavities:
            inward = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces), self.bodies) < 0
            self.solid: Shape = unite_around_cavities(
                [part for part, _ in parts], [bool(inward[body]) for _, body in parts]
            )
        else:
            self.solid = unite([part for part, _ in parts])
            if open_bodies != "thin":
                self._wrap_rooms(soup, parts)
                self._fill_slits()
        if volume_of(self.solid) == 0:
            self.warnings.append("the surface could not be closed: the hull of its points stands in for the solid")
            self.step[:] = STEPS.index("hull")
            self.solid = hull_of_points(surface.vertices, HALF_THICKNESS)
        self._warn_of_shells()
        self._measure()

    def _warn_of_shells(self) -> None:
        shells = [body for body in self.mouths if self.step[body] == STEPS.index("slab")]
        if not shells:
            return
        place = self.frame.place(self.mouths[shells[0]])
        if len(shells) == 1:
            sentence = f"1 open body became a thin shell; --open solid fills it (its widest opening is at {place})."
        else:
            sentence = f"{len(shells)} open bodies became thin shells; --open solid fills them (one opens at {place})."
        self.warnings.append(sentence)

    def report(self) -> tuple[BodyRepair, ...]:
        """One record per body."""
        faces_in = np.bincount(self.body_of_input, minlength=self.bodies)
        rows = zip(self.step.tolist(), faces_in.tolist(), self.faces_out.tolist(), self.deviation.tolist(), strict=True)
        return tuple(BodyRepair(i, STEPS[s], a, b, d) for i, (s, a, b, d) in enumerate(rows))

    def doubted(self) -> IntArray:
        """Bodies whose skin was chosen among crossing faces and leads away from them."""
        return np.flatnonzero((self.step == STEPS.index("outer skin")) & (self.deviation > GAP))

    def _note(self, bodies: IntArray, step: str) -> None:
        """Record a step; a body keeps the one that changes it most."""
        bodies = np.unique(bodies)
        self.step[bodies] = np.maximum(self.step[bodies], STEPS.index(step))

    @cached_property
    def reach(self) -> Reach:
        """Where a ball of radius `gap` can go around the input."""
        return Reach.of(self.input.vertices, self.input.faces, radius=self.gap, resolution=self.resolution)

    def _is_oriented(self, soup: Soup) -> bool:
        """Whether every edge joins two faces that run along it in opposite directions, and no body is flat."""
        if (soup.edges.valence != 2).any():
            return False
        forward = (soup.faces < np.roll(soup.faces, -1, axis=1)).ravel()
        if (np.bincount(soup.edges.of_halfedge, forward) != 1).any():
            return False
        volume = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces))
        return bool((np.abs(volume) > 2 * _FLAT * np.bincount(soup.body, soup.area)).all())

    def _as_they_are(self, soup: Soup) -> list[tuple[Manifold, int]]:
        """Take closed, oriented bodies as they are: the result of `_build` without sorting all sides."""
        volume = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces))
        inward = volume < 0
        faces = np.where(inward[soup.body, None], soup.faces[:, ::-1], soup.faces)
        self._note(np.flatnonzero(inward), "reoriented")
        self.faces_out = np.bincount(soup.body)
        solids = [to_manifold(v, f) for v, f in split_labels(soup.vertices, faces, soup.body)]
        return list(zip(solids, range(self.bodies), strict=True))

    def _trust_windings(self, soup: Soup) -> Soup:
        """Trust the windings of closed bodies if the angles between their faces join the inside with the outside.

        Where corners were rounded, slivers fold over and angles around an edge with four faces are wrong.
        """
        uneven, crowded = np.zeros((2, self.bodies), dtype=bool)
        uneven[soup.body[soup.at_valence(~is_balanced(soup.faces, soup.edges))]] = True
        crowded[soup.body[soup.at_valence(soup.edges.valence > 2)]] = True
        if not (crowded & ~uneven).any():
            return soup
        share = soup.sheet_share(self.bodies)
        doubted = crowded & ~uneven & (share > FLAPS)
        if not doubted.any():
            return soup
        trusting = Soup(soup.vertices, soup.faces, soup.body, doubted[soup.body])
        better = doubted & (trusting.sheet_share(self.bodies) < share / 2)
        return Soup(soup.vertices, soup.faces, soup.body, better[soup.body]) if better.any() else soup

    def _drop_hidden(self, soup: Soup) -> Soup:
        """Drop faces that lie inside their own body, if they are what keeps the body from having an inside.

        Where parts meet in faces that overlap without matching, the order of faces around an edge is undecided, and one
        wrong guess joins the inside with the outside. The winding number is not affected.
        """
        crowded = np.zeros(self.bodies, dtype=bool)
        crowded[soup.body[soup.at_valence(soup.edges.valence > 2)]] = True
        if not crowded.any():
            return soup
        share = soup.sheet_share(self.bodies)
        hidden = np.zeros(len(soup.faces), dtype=bool)
        for body in np.flatnonzero(crowded & (share > FLAPS)):
            poll_stop()
            some = np.flatnonzero(soup.body == body)
            hidden[some] = hidden_faces(soup.vertices, soup.faces[some])
        if not hidden.any():
            return soup
        better = soup.only(~hidden).sheet_share(self.bodies) < share / 2
        self._note(soup.body[hidden & better[soup.body]], "outer skin")
        return soup.only(~hidden | ~better[soup.body])

    def _cap(self, soup: Soup) -> Soup:
        """Cap the bodies all of whose holes may be capped."""
        free = int((soup.edges.valence == 1).sum())
        if free == 0 or free > MOST_FREE_EDGES or self.open_bodies == "thin":
            return soup
        soup = self._close(soup)
        # What hangs on a rim is rather a side than a fin, unless its body would be hollow.
        return self._close(soup, fins=True) if self.mouths else soup

    def _close(self, soup: Soup, fins: bool = False) -> Soup:
        fill = self.open_bodies == "solid"
        closed = close_holes(
            soup, self.bodies, self.input, self._covers, self.gap, HALF_THICKNESS / 2, fill, self.bend, fins
        )
        if closed is None:
            return soup
        self.mouths = dict(zip(closed.hollow.tolist(), closed.mouths, strict=True))
        self._note(closed.bodies, "capped")
        self.by_room |= closed.by_room
        self.hidden = np.concatenate([self.hidden, closed.hidden])
        self.across = np.concatenate([self.across, closed.across])
        if len(closed.far):
            place = self.frame.place(closed.where[closed.far.argmax()])
            self.warnings.append(
                f"Holes were closed although the caps lead up to {closed.far.max():.3f} (longest side = 2) away from "
                f"the surface: the widest is at {place}."
            )
        return closed.soup

    def _covers(self, points: FloatArray) -> BoolArray:
        """Whether a ball can reach points; if cavities are kept, everything connected to them is open."""
        return np.ones(len(points), dtype=bool) if self.keep_cavities else self.reach.covers(points)

    def _build(self, soup: Soup) -> list[tuple[Manifold, int]]:
        """Turn every body into closed solids; returns them, and the body each belongs to."""
        walls, sheets = self._walls_and_sheets(soup)
        return self._skins(walls) + self._skins(sheets.in_patches())

    def _walls_and_sheets(self, soup: Soup) -> tuple[Soup, Soup]:
        """The faces that bound something solid, and those that become slabs."""
        sides = soup.sides
        front, back = sides.label[0::2], sides.label[1::2]
        none = _FLAT * sides.area
        sheet_area = np.bincount(front, soup.area * sides.sheet, len(none))
        # A component that is mostly sheet yet has negative volume joins the inside with the outside: its body is
        # nowhere solid, so all of it becomes slabs (whose cavities are filled later).
        leaky = soup.body_of_side()[(sides.volume < -none) & (4 * sheet_area > sides.area)]
        solid = sides.volume > none
        flat = np.abs(sides.volume) <= none
        leaky = np.union1d(leaky, self.as_sheets)
        sheet = (sides.sheet & (sides.volume >= -none)[front]) | (flat[front] & flat[back]) | np.isin(soup.body, leaky)
        wall = (solid[front] | solid[back]) & ~sides.sheet & ~sheet
        sheet |= _poking_out(soup, wall, sides.sheet & ~sheet)

        self._note(soup.body[solid[back] & wall], "reoriented")
        self._note(soup.body[~wall & ~sheet], "outer skin")
        self._note(soup.body[soup.at_valence(soup.edges.valence > 2)], "outer skin")
        self._note(soup.body[sheet], "slab")
        poll_stop()
        mixed = np.bincount(soup.body[sheet], minlength=self.bodies) > 0
        return soup.only(~sheet & (wall | ~mixed[soup.body])), soup.only(sheet)

    def _skins(self, soup: Soup) -> list[tuple[Manifold, int]]:
        """Build the outer side components of a soup; sheets and flat bodies get thickness."""
        if len(soup.faces) == 0:
            return []
        sides = soup.sides
        front = sides.label[0::2]
        none = _FLAT * sides.area
        has_sheet, is_front = np.zeros((2, len(none)), dtype=bool)
        has_sheet[front[sides.sheet]] = True
        is_front[front] = True
        # The two side components of a flat closed body mirror each other: build the fronts.
        flat = (np.abs(sides.volume) <= none) & ~has_sheet & is_front
        keep = (sides.volume > none) | (has_sheet & (sides.volume >= -none)) | flat
        vertices, faces, label = self._skin(soup, keep, flat)
        # Where parts touch along an edge, their common outer skin passes the edge twice. Their insides are simple:
        # build those, turned inside out, and let the union join them.
        pinched = np.zeros(self.bodies, dtype=bool)
        pinched[soup.body_of_side()[label[on_repeated_edge(faces, len(vertices))]]] = True
        # Only if the skin is one piece: volumes of crossing pieces do not add up to those of the insides.
        pinched &= np.bincount(soup.body_of_side(), sides.volume > 0, self.bodies) == 1
        pinched[soup.body[sides.sheet]] = False
        pinched = pinched[soup.body_of_side()]
        if pinched.any():
            rooms = pinched & (sides.volume < -none)
            vertices, faces, label = self._skin(soup, (keep & ~pinched) | rooms, flat)
            faces[rooms[label]] = faces[rooms[label]][:, ::-1]
        built, count = np.unique(label, return_counts=True)
        body = soup.body_of_side()[built]
        solids = [to_manifold(v, f) for v, f in split_labels(vertices, faces, label)]
        # Sheets narrower than their intended thickness can cross themselves, and come out inside out.
        for i in np.flatnonzero(has_sheet[built] | flat[built]):
            poll_stop()
            if solids[i].volume() <= 0:
                some = (sides.label.reshape(-1, 2) == built[i]).any(axis=1)
                solids[i] = slab_of_faces(soup.vertices, soup.faces[some], HALF_THICKNESS)
                count[i] = solids[i].num_tri()
        np.add.at(self.faces_out, body, count)
        return list(zip(solids, body.tolist(), strict=True))

    @staticmethod
    def _skin(soup: Soup, keep: BoolArray, flat: BoolArray) -> tuple[FloatArray, IntArray, IntArray]:
        """Build side components, sheets and flat ones with thickness."""
        front = soup.sides.label[0::2]
        thin = keep[front] & (soup.sides.sheet | flat[front])
        return skin(soup.vertices, soup.faces, soup.sides, keep, thin, HALF_THICKNESS)

    def _wrap(self, cells: BoolArray, error: float) -> Manifold:
        """Return a solid of grid cells, projected onto the input and simplified."""
        return to_manifold(*self.reach.wrap(cells, self.input, HALF_THICKNESS)).simplify(error)

    def _build_or_wrap(self, soup: Soup) -> list[tuple[Manifold, int]]:
        """Build every body, but wrap crowds of sheets (leaves, feathers) as one, as a ball of radius `gap` sees it."""
        walls, sheets = self._walls_and_sheets(soup)
        is_slab = self.step == STEPS.index("slab")
        crowded = is_slab.sum() > _CROWD
        if crowded:  # slabs of single faces are most of the work, and not needed
            parts = self._skins(walls.only(~is_slab[walls.body]))
        else:
            parts = self._skins(walls) + self._skins(sheets.in_patches())
            boxes = np.array([part.bounding_box() for part, body in parts if is_slab[body]]).reshape(-1, 2, 3)
            if _crossings(boxes) <= _CROSSINGS:
                return parts
        slabs = soup.only(is_slab[soup.body])
        points, _ = points_covering(slabs.vertices, slabs.faces, self.reach.pitch / 2)
        wrap = self._wrap(self.reach.around_points(points), HALF_THICKNESS / 2)
        if wrap.volume() <= 0:
            slabs_too = (walls.only(is_slab[walls.body]), sheets.in_patches()) if crowded else ()
            return parts + [part for some in slabs_too for part in self._skins(some)]
        first = int(slabs.body.min())
        self._note(slabs.body, "wrapped")
        self.faces_out[is_slab] = 0
        self.faces_out[first] = wrap.num_tri()
        return [*((part, body) for part, body in parts if not is_slab[body]), (wrap, first)]

    def _wrap_rooms(self, soup: Soup, parts: list[tuple[Manifold, int]]) -> None:
        """Close rooms that sheets enclose except for gaps too narrow for a ball of radius `gap`."""
        is_slab = self.step == STEPS.index("slab")
        slabs = soup.only(is_slab[soup.body])
        around = soup.only((is_slab | self.by_room)[soup.body])
        if around.area.sum() < 4 * np.pi * self.gap**2 or volume_of(self.solid) == 0:
            return
        rooms = self.reach.rooms_outside(SurfaceQuery(*to_arrays(self.solid)))
        if len(rooms) == 0:
            return
        rooms = np.intersect1d(rooms, self.reach.rooms_near(spread_points(around.vertices, around.faces, GAP)[0]))
        if len(rooms) == 0:
            return
        wrap = self._wrap(self.reach.around_rooms(rooms), _WRAP_ERROR)
        # The wrap replaces the sheets that are only walls of the rooms; the others stay slabs.
        points, on = spread_points(slabs.vertices, slabs.faces, GAP)
        wall = np.bincount(on, ~np.isin(self.reach.rooms_near(points), rooms), len(slabs.faces)) == 0
        before = self.faces_out.copy()
        if wall.any() or len(parts) > MOST_UNITED:  # that many overlap in what was made of them
            self.faces_out[is_slab] = 0
            others = [part for part, body in parts if not is_slab[body]]
            united = unite([*others, *(part for part, _ in self._build(slabs.only(~wall))), wrap])
        else:
            united = unite([as_manifold(self.solid), wrap])
        if volume_of(united) <= volume_of(self.solid):
            self.faces_out = before
            return
        self.solid = united
        wrapped = np.concatenate([slabs.body[wall], np.flatnonzero(self.by_room)])
        self._note(wrapped, "wrapped")
        self.faces_out[wrapped.min(initial=self.bodies - 1)] += wrap.num_tri()

    def _fill_slits(self) -> None:
        """Fill the slits between the caps of bodies that close each other, such as a pot and its lid.

        Nothing can reach such caps; where they should coincide, noise leaves slits that would have to be cut around.
        """
        if len(self.hidden) == 0 or volume_of(self.solid) == 0:
            return
        solid = SurfaceQuery(*to_arrays(self.solid), self.input.threads)
        bare = solid.distance(self.hidden) < _ON_SURFACE
        points, step = self.hidden[bare], _SLIT * self.gap * self.across[bare]
        points = points[solid.inside(points + step) & solid.inside(points - step)]
        if len(points) == 0:
            return
        wrap = self._wrap(self.reach.around_points(points), _WRAP_ERROR)
        united = unite([as_manifold(self.solid), wrap])
        if volume_of(united) > volume_of(self.solid):
            self.solid = united
            self._note(np.flatnonzero(self.by_room), "wrapped")
            self.faces_out[self.by_room.argmax()] += wrap.num_tri()

    def _measure(self) -> None:
        """Record, for the changed bodies, how far the solid and the input deviate from each other."""
        if self.step.max() < STEPS.index("outer skin"):
            return
        solid = SurfaceQuery(*to_arrays(self.solid), self.input.threads)
        kept, taken_over = shared_faces(solid.vertices, solid.faces, self.input.vertices, self.input.faces)
        poll_stop()
        points, _ = points_covering(solid.vertices, solid.faces[~kept], GAP)
        closest, face = self.input.closest(points)
        np.maximum.at(self.deviation, self.body_of_input[face], np.linalg.norm(points - closest, axis=1))

        changed = np.flatnonzero((self.step[self.body_of_input] >= STEPS.index("outer skin")) & ~taken_over)
        points, on = points_covering(self.input.vertices, self.input.faces[changed], GAP)
        distance = solid.distance(points)
        lost = np.flatnonzero(distance > 2 * HALF_THICKNESS)
        lost = lost[~_inside_by_balls(solid, points[lost], distance[lost])]
        body = self.body_of_input[changed[on[lost]]]
        np.maximum.at(self.deviation, body, distance[lost])
        self.lost = float(distance[lost].max(initial=0.0, where=self.step[body] == STEPS.index("capped")))


def _poking_out(soup: Soup, wall: BoolArray, inner: BoolArray) -> BoolArray:
    """Which sheets that begin inside a body, such as a fin that leans inwards, lead out of all bodies: ``[F]``."""
    pokes = np.zeros(len(soup.faces), dtype=bool)
    if not inner.any() or not wall.any():
        return pokes
    triangles = soup.vertices[soup.faces[inner]]
    points = np.einsum("pk,fkd->fpd", _PROBES, triangles)
    walls = SurfaceQuery(soup.vertices, soup.faces[wall])
    apart = (walls.distance(points.reshape(-1, 3)) > 2 * HALF_THICKNESS).reshape(points.shape[:2])
    outside = np.zeros_like(apart)
    poll_stop()
    outside[apart] = np.abs(walls.winding(points[apart])) < 0.5
    pokes[inner] = outside.any(axis=1)
    return pokes


def _inside_by_balls(solid: SurfaceQuery, points: FloatArray, distance: FloatArray) -> BoolArray:
    """Return ``[N]`` whether a closed surface winds around points at known distances from it.

    A ball around a point up to the surface lies on one side of it, with all points in it.
    """
    ball = np.full(len(points), -1, dtype=np.int64)
    centers: list[int] = []
    tree = PointTree(points)
    for i in np.argsort(-distance, kind="stable").tolist():
        if ball[i] < 0:
            _, near = tree.within(points[i : i + 1], 0.99 * distance[i : i + 1])
            ball[near] = len(centers)
            centers.append(i)
    return solid.inside(points[centers])[ball]


def _crossings(boxes: FloatArray) -> int:
    """Count the pairs of boxes [N, 2, 3] that meet."""
    lower, upper = boxes[:, 0], boxes[:, 1]
    count = 0
    for i in range(len(boxes)):
        poll_stop()
        count += int(((lower[i] <= upper[i + 1 :]) & (lower[i + 1 :] <= upper[i])).all(axis=1).sum())
    return count
