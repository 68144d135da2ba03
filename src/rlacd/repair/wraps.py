"""Wraps: what only a ball can tell from a solid is closed on a grid and projected onto the surface."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from rlacd._native import poll_stop
from rlacd.repair.build import crosses_itself, skins, walls_and_sheets
from rlacd.repair.distance import SurfaceQuery, once_in_each_place, points_covering, spread_points
from rlacd.repair.record import Record
from rlacd.repair.slabs import slab_of_faces
from rlacd.repair.soup import Soup, face_normals, no_faces
from rlacd.repair.union import MOST_UNITED, area_of, as_manifold, size_of, to_arrays, tunnels_in, unite, volume_of
from rlacd.repair.voxels import GAP, Reach
from rlacd.solid.frame import FloatArray
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Shape
from rlacd.solid.thickness import HALF_THICKNESS
from rlacd.solid.topology import BoolArray, IntArray, face_areas

_WRAP_ERROR = 4e-3
# Widest slit between caps that is filled, as a share of the gap, and the distance up to which a cap is part of the
# solid's surface.
_SLIT, _ON_SURFACE = 1 / 4, 1e-6
# A room of an outer skin is filled from this share of the solid's volume on: rooms in furniture have 0.04 and more,
# crevices at most 0.0023.
_ROOM = 0.01
# A slit in an outer skin or along a filling is filled from this depth on, up to this width (multiples of the gap), if
# all of them hold no more than this share of the volume: what is shallower needs no cut, and what is wider leaves steps
# of the grid.
_DEEP, _HAIR, _LITTLE = 2.0, 1 / 16, 1e-3
# Such slits may be too thin to have a volume that is told from rounding: this share of the surface has to go with them.
_ROUNDING, _BARED = 1e-5, 0.004
# Noise leaves slits between walls of dense bodies that touch, full of bridges: a union of so many triangles, with so
# many tunnels, is looked at, and its slits are filled if they make up this share of its surface, nearer to their mouths
# than others, since they are no doors.
_DENSE, _TUNNELS, _SLITTED = 10_000, 25, 0.01
_DEEP_IN_NOISE, _LITTLE_NOISE = 1.25, 3e-3
# How many points tell how much a wrap would add, which is sooner than uniting it.
_TRIED = 20_000
# More sheets than this are not united one by one: that would take seconds, and cutting the result even longer. Neither
# are fewer sheets that all cross each other: 40 have 780 crossings (a second or two), 80 have 3,160 (ten seconds).
_CROWD, _CROSSINGS = 300, 1000


class Built(NamedTuple):
    """What was built of an input.

    Attributes
    ----------
    solid : Manifold or (vertices, faces)
    pieces : list of Manifold or (vertices, faces)
        Closed solids whose union it is, but for cavities; none if that is not known.
    """

    solid: Shape
    pieces: list[Shape]

    @property
    def volume(self) -> float:
        """Volume of the solid."""
        return volume_of(self.solid)

    def filled(self, wrap: Manifold) -> Built:
        """Unite the solid with a wrap."""
        return Built(unite([as_manifold(self.solid), wrap]), [*self.pieces, wrap])


class Wraps:
    """Wraps of an input, as a ball rolls around it.

    Parameters
    ----------
    surface : SurfaceQuery
        The input.
    record : Record
        Where steps are recorded.
    gap : float
        Radius of the ball.
    resolution : int
        Cells along the longest side.
    as_sheets : int64 [N]
        Bodies all of whose faces become slabs.
    tangled : int64 [N]
        Bodies that `untangled` builds.
    by_faces : bool
        Unite slabs that cross themselves from their faces.
    """

    def __init__(
        self,
        surface: SurfaceQuery,
        record: Record,
        gap: float,
        resolution: int,
        as_sheets: IntArray,
        tangled: IntArray,
        by_faces: bool,
    ) -> None:
        self._input = surface
        self._record = record
        self._gap = gap
        self._resolution = resolution
        self._as_sheets = as_sheets
        self._by_faces = by_faces
        self._sheets = no_faces(surface.vertices)  # what the slabs were built from
        self._slabs: list[tuple[Shape, int]] = []
        self._is_tangled = np.zeros(record.bodies, dtype=bool)
        self._is_tangled[tangled] = True
        self._asked: tuple[Shape, SurfaceQuery] | None = None

    def query(self, solid: Shape) -> SurfaceQuery:
        """Queries of a solid; those of the last one asked for are kept."""
        if self._asked is None or self._asked[0] is not solid:
            self._asked = solid, SurfaceQuery(*to_arrays(solid), self._input.threads)
        return self._asked[1]

    @cached_property
    def reach(self) -> Reach:
        """Where the ball can go."""
        return Reach.of(self._input.vertices, self._input.faces, radius=self._gap, resolution=self._resolution)

    def build_or_wrap(self, soup: Soup) -> list[tuple[Shape, int]]:
        """Build every body, but wrap crowds of sheets (leaves, feathers) as one; returns solids and their bodies."""
        record = self._record
        walls, sheets = walls_and_sheets(soup, record, self._as_sheets)
        is_slab = record.has("slab")
        crowded = is_slab.sum() > _CROWD
        if crowded:  # slabs of single faces are most of the work, and not needed
            parts = skins(walls.only(~is_slab[walls.body]), record)
        else:
            parts = skins(walls, record)
            parts += self._built_slabs(sheets)
            boxes = [as_manifold(part).bounding_box() for part, body in parts if is_slab[body]]
            if _crossings(np.reshape(boxes, (-1, 2, 3))) <= _CROSSINGS:
                return parts
        slabs = soup.only(is_slab[soup.body])
        points, _ = points_covering(slabs.vertices, slabs.faces, self.reach.pitch / 2)
        wrap = self._wrap(self.reach.around_points(points), HALF_THICKNESS / 2)
        if wrap.volume() <= 0:
            if crowded:
                parts += skins(walls.only(is_slab[walls.body]), record) + self._built_slabs(sheets)
            return parts
        self._sheets, self._slabs = no_faces(soup.vertices), []
        first = int(slabs.body.min())
        record.note(slabs.body, "wrapped")
        record.faces_out[is_slab] = 0
        record.faces_out[first] = wrap.num_tri()
        return [*((part, body) for part, body in parts if not is_slab[body]), (wrap, first)]

    def _built_slabs(self, sheets: Soup) -> list[tuple[Shape, int]]:
        self._sheets, self._slabs = sheets, skins(sheets.in_patches(), self._record, self._by_faces)
        return self._slabs

    def has_crossing_slabs(self) -> bool:
        """Whether a slab that was built crosses itself."""
        return any(crosses_itself(slab) for slab, _ in self._slabs)

    def untangled(self, soup: Soup) -> list[tuple[Shape, int]]:
        """Build bodies that cross themselves from the place of their faces alone; returns solids and their bodies.

        A few faces become a slab each. Where they are many, what the ball cannot reach from outside the body is solid.
        Both enclose what the faces enclose, whatever their windings.
        """
        parts = []
        for body in np.unique(soup.body).tolist():
            poll_stop()
            own = soup.only(soup.body == body)
            corners = own.vertices[own.faces]
            is_few = len(corners) <= _CROWD and _crossings(np.stack([corners.min(1), corners.max(1)], 1)) <= _CROSSINGS
            solid = slab_of_faces(own.vertices, own.faces) if is_few else self._wrapped(own)
            self._record.note(own.body, "slab" if is_few else "wrapped")
            self._record.faces_out[body] = solid.num_tri()
            parts.append((solid, body))
        return parts

    def all_wrapped(self, soup: Soup) -> Manifold:
        """Take what the ball cannot reach from outside all bodies to be solid."""
        solid = self._wrapped(soup)
        self._sheets, self._slabs = no_faces(soup.vertices), []
        self._record.note(soup.body, "wrapped")
        self._record.faces_out[:] = 0
        self._record.faces_out[0] = solid.num_tri()
        return solid

    def with_rooms(self, built: Built, soup: Soup, parts: list[tuple[Shape, int]], by_room: BoolArray) -> Built:
        """Fill rooms with openings too narrow for the ball: all rooms that sheets enclose, large ones in outer skins.

        Parameters
        ----------
        built
            The union of the parts.
        soup
            The faces that the parts were built from.
        parts
            Solids and their bodies.
        by_room : bool [bodies]
            Bodies that were capped only because nothing can reach the caps.
        """
        record = self._record
        is_slab = record.has("slab") & ~self._is_tangled
        is_skin = record.has("outer skin") & ~self._is_tangled
        sheets = soup.only((is_slab | by_room)[soup.body])
        shells = soup.only(is_skin[soup.body])
        if built.volume == 0 or not (self._is_large(sheets) or self._is_large(shells)):
            return built
        query = self.query(built.solid)
        rooms = self.reach.rooms_outside(query)
        in_shells = self._rooms_in(shells, rooms[self.reach.volumes(rooms) >= _ROOM * built.volume])
        rooms = np.union1d(self._rooms_in(sheets, rooms), in_shells)
        if len(rooms) == 0:
            return built
        wrap = self._wrap(self.reach.around_rooms(rooms), _WRAP_ERROR, query if len(in_shells) else None)
        if wrap.is_empty():
            return built
        before = record.faces_out.copy()
        left, walled = self._sheets_but_walls(rooms, wrap)
        # More parts than can be united overlap in what was made of them.
        if len(left.faces) < len(self._sheets.faces) or len(parts) > MOST_UNITED:
            slabs = {id(slab) for slab, _ in self._slabs}
            np.subtract.at(record.faces_out, [b for _, b in self._slabs], [size_of(slab) for slab, _ in self._slabs])
            pieces = [part for part, _ in parts if id(part) not in slabs]
            pieces += [*(slab for slab, _ in skins(left.in_patches(), record, self._by_faces)), wrap]
            filled = Built(unite(pieces), pieces)
        else:
            filled = built.filled(wrap)
        if filled.volume <= built.volume:
            record.faces_out = before
            return built
        wrapped = np.concatenate([walled, np.flatnonzero(by_room)])
        record.note(wrapped, "wrapped")
        skins_too = np.flatnonzero(is_skin) if len(in_shells) else wrapped[:0]
        record.faces_out[np.concatenate([wrapped, skins_too]).min(initial=record.bodies - 1)] += wrap.num_tri()
        return filled

    def _sheets_but_walls(self, rooms: IntArray, wrap: Manifold) -> tuple[Soup, IntArray]:
        """The sheets that the wrap of some rooms does not replace, and the bodies with walls of the rooms.

        It replaces those that are only walls, unless it leaves some of their body's outside, as noise does.
        """
        sheets = self._sheets
        points, on = spread_points(sheets.vertices, sheets.faces, GAP)
        is_elsewhere = once_in_each_place(lambda some: ~np.isin(self.reach.rooms_near(some), rooms), points)
        is_wall = np.bincount(on, is_elsewhere, len(sheets.faces)) == 0
        bodies = np.unique(sheets.body[is_wall])
        points, on = points[is_wall[on]], on[is_wall[on]]
        wrapped = SurfaceQuery(*to_arrays(wrap), self._input.threads)

        def is_left_out(points: FloatArray) -> BoolArray:
            away = wrapped.distance(points) > HALF_THICKNESS
            away[away] = ~wrapped.inside(points[away])
            return away

        left_out = on[once_in_each_place(is_left_out, points)]
        is_wall &= ~np.isin(sheets.body, sheets.body[left_out])
        return sheets.only(~is_wall), bodies

    def _is_large(self, walls: Soup) -> bool:
        """Whether faces could enclose a ball."""
        return bool(walls.area.sum() >= 4 * np.pi * self._gap**2)

    def _rooms_in(self, walls: Soup, rooms: IntArray) -> IntArray:
        """Those of some rooms that faces may be walls of."""
        if len(rooms) == 0 or not self._is_large(walls):
            return rooms[:0]
        return np.intersect1d(rooms, self.reach.rooms_near(points_covering(walls.vertices, walls.faces, GAP)[0]))

    def with_deep_slits(self, built: Built, soup: Soup) -> Built:
        """Fill slits in outer skins and around fillings that nothing can reach: cuts would have to follow them.

        Parameters
        ----------
        built
            The solid so far.
        soup
            The faces that it was built from.
        """
        may_have = (self._record.has("outer skin") | self._record.has("wrapped")) & ~self._is_tangled
        if not self._is_large(soup.only(may_have[soup.body])) or built.volume == 0:
            return built
        query = self.query(built.solid)
        points = _in_slits(query, *self._deep(query, _DEEP), _HAIR * self._gap)
        if len(points) == 0:
            return built
        wrap = self._wrap(self.reach.around_points(points), _WRAP_ERROR, query)
        filled = built.filled(wrap)
        adds = filled.volume / built.volume - 1
        is_little = -_ROUNDING < adds < _LITTLE
        return filled if is_little and area_of(filled.solid) < (1 - _BARED) * area_of(built.solid) else built

    def with_noisy_slits(self, built: Built) -> Built:
        """Fill slits between the walls of dense bodies that touch: noise leaves slits there, full of bridges.

        Parameters
        ----------
        built
            The solid so far.
        """
        solid, volume = built.solid, built.volume
        if len(built.pieces) < 2 or size_of(solid) < _DENSE or tunnels_in(solid) < _TUNNELS or volume <= 0:
            return built
        query = self.query(solid)
        points, on = self._deep(query, _DEEP_IN_NOISE)
        first = self.reach.one_in_each_place(points)
        least = _SLITTED * face_areas(query.vertices, query.faces).sum() / self.reach.place**2
        if len(first) < least:
            return built
        points = _in_slits(query, points[first], on[first], _HAIR * self._gap)
        if len(points) < least:
            return built
        cells = self.reach.around_points(points)
        wrap = self._wrap(cells, _WRAP_ERROR, query)
        if self._volume_beyond(query, wrap, cells) > _LITTLE_NOISE * volume:
            return built
        filled = built.filled(wrap)
        return filled if volume < filled.volume < (1 + _LITTLE_NOISE) * volume else built

    def _deep(self, solid: SurfaceQuery, depth: float) -> tuple[FloatArray, IntArray]:
        """Points ``[N, 3]`` of a solid at least so many radii from where the ball can reach, and the face of each."""
        points, on = spread_points(solid.vertices, solid.faces, GAP)
        deep = self.reach.is_deep(points, depth * self._gap)
        return points[deep], on[deep]

    def _volume_beyond(self, solid: SurfaceQuery, wrap: Manifold, cells: BoolArray) -> float:
        """Estimate how much of a wrap of cells lies outside a solid."""
        points = self.reach.points_in(cells, _TRIED)
        wrapped = points[SurfaceQuery(*to_arrays(wrap), self._input.threads).inside(points)]
        share = np.count_nonzero(~solid.inside(wrapped)) / len(points)
        return float(share * np.count_nonzero(cells) * self.reach.pitch**3)

    def with_slits(self, built: Built, hidden: FloatArray, across: FloatArray, by_room: BoolArray) -> Built:
        """Fill what is left between the caps of bodies that close each other, such as a pot and its lid.

        Nothing can reach such caps, so nothing can reach what they leave of a room; and where they should coincide,
        noise leaves slits that would have to be cut around.

        Parameters
        ----------
        built
            The solid so far.
        hidden, across : float64 [N, 3]
            Points of such caps, and the normals there.
        by_room : bool [bodies]
            Their bodies.
        """
        if len(hidden) == 0 or built.volume == 0:
            return built
        query = self.query(built.solid)
        bare = query.distance(hidden) < _ON_SURFACE
        points, step = hidden[bare], _SLIT * self._gap * across[bare]
        beside = np.stack([points + step, points - step])
        inside = query.inside(beside.reshape(-1, 3)).reshape(beside.shape[:2])
        cells = self.reach.around_points(points[inside.all(axis=0)])
        cells |= self.reach.around_rest(beside[~inside], query)
        if not cells.any():
            return built
        wrap = self._wrap(cells, _WRAP_ERROR)
        filled = built.filled(wrap)
        if filled.volume <= built.volume:
            return built
        self._record.note(np.flatnonzero(by_room), "wrapped")
        self._record.faces_out[by_room.argmax()] += wrap.num_tri()
        return filled

    def _wrapped(self, soup: Soup) -> Manifold:
        """What the ball cannot reach from outside some faces."""
        reach = Reach.of(soup.vertices, soup.faces, radius=self._gap, resolution=self._resolution)
        faces = SurfaceQuery(soup.vertices, soup.faces, self._input.threads)
        return to_manifold(*reach.wrap(~reach.reached, faces, HALF_THICKNESS)).simplify(HALF_THICKNESS / 2)

    def _wrap(self, cells: BoolArray, error: float, solid: SurfaceQuery | None = None) -> Manifold:
        """Return a solid of grid cells, projected onto the input where it does not overlap `solid`, and simplified."""
        return to_manifold(*self.reach.wrap(cells, self._input, HALF_THICKNESS, solid)).simplify(error)


def _in_slits(solid: SurfaceQuery, points: FloatArray, on: IntArray, width: float) -> FloatArray:
    """Those of some points on faces of a solid that have it on both sides, so far away."""
    step = width * face_normals(solid.vertices, solid.faces[on])
    before = solid.inside(points + step)
    points, step = points[before], step[before]
    return points[solid.inside(points - step)]


def _crossings(boxes: FloatArray) -> int:
    """Count the pairs of boxes [N, 2, 3] that meet."""
    lower, upper = boxes[:, 0], boxes[:, 1]
    count = 0
    for i in range(len(boxes)):
        poll_stop()
        count += int(((lower[i] <= upper[i + 1 :]) & (lower[i + 1 :] <= upper[i])).all(axis=1).sum())
    return count
