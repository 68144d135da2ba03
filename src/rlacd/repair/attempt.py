"""One attempt to turn the bodies of an input into a solid, each by the least change that works."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from numpy.typing import ArrayLike

from rlacd._native import poll_stop
from rlacd.repair.build import skins
from rlacd.repair.caps import close_holes
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.holes import MOST_FREE_EDGES, close_cracks
from rlacd.repair.measure import faces_outside, measure
from rlacd.repair.record import STEPS, Record
from rlacd.repair.slabs import hull_of_points
from rlacd.repair.soup import FLAPS, FLAT, Soup, hidden_faces, trust_windings
from rlacd.repair.union import (
    CrossingsError,
    as_manifold,
    split_labels,
    unite,
    unite_around_cavities,
    volume_of,
)
from rlacd.repair.voxels import GAP
from rlacd.repair.wraps import Built, Wraps
from rlacd.solid.frame import FloatArray, Frame
from rlacd.solid.manifold import to_manifold
from rlacd.solid.solid import Hole
from rlacd.solid.thickness import HALF_THICKNESS
from rlacd.solid.topology import BoolArray, Edges, IntArray, bodies_of, signed_tetrahedra

_WELDS = (2e-5, 5e-4)

# Where more pieces than this are lost, as of a plant's leaves, they stay lost: cuts would take too long.
_MOST_KEPT = 100

# A warning names this many holes.
_NAMED = 5


class Attempt:
    """The steps on one input.

    Bodies are numbered after cracks are welded.

    Parameters
    ----------
    surface : SurfaceQuery
        The input in the normalised frame.
    frame : Frame
        From the input's unit.
    resolution, gap, keep_cavities, open_bodies
        As for `rlacd.repair.repair.repair`.
    tangled : int64 [N]
        Bodies whose solids would cross themselves: they are built another way.
    as_sheets : int64 [N], optional
        Bodies all of whose faces become slabs.
    bend : float
        How much caps may bend; see `rlacd.repair.caps.close_holes`.
    by_faces : bool
        Unite slabs that cross themselves from their faces.

    Attributes
    ----------
    solid : Manifold or (vertices, faces)
    pieces : list of Manifold or (vertices, faces)
        Closed solids whose union the solid is, but for cavities; none if that is not known.
    record : Record
        What was done to each body.
    lost : float
        How far what a capped body lost lies from the solid, or a wrapped one beyond what wraps may lose.
    lost_at : str
        Where.
    is_crossed : bool
        Whether the bodies cross each other too often to be united, so that all of them were wrapped at once.
    warnings : list of str
    holes : list of Hole
        The most doubtful first.
    """

    def __init__(
        self,
        surface: SurfaceQuery,
        frame: Frame,
        resolution: int,
        gap: float,
        keep_cavities: bool,
        open_bodies: str,
        tangled: IntArray,
        as_sheets: IntArray | None = None,
        bend: float = 1.0,
        by_faces: bool = False,
    ) -> None:
        self._input = surface
        self._frame = frame
        self._gap = gap
        self._keep_cavities = keep_cavities
        self._open_bodies = open_bodies
        self._bend = bend
        self.warnings: list[str] = []
        self.holes: list[Hole] = []

        edges = Edges.of(surface.faces, len(surface.vertices))
        faces, origin = close_cracks(surface.vertices, surface.faces, edges, _WELDS)
        if faces is not surface.faces:
            edges = Edges.of(faces, len(surface.vertices))
        count, body = bodies_of(faces, edges)
        body_of_input = np.zeros(len(surface.faces), dtype=np.int64)
        body_of_input[origin] = body
        self.record = Record(count, body_of_input)
        self.record.note(body[(faces != surface.faces[origin]).any(axis=1)], "welded")
        self._by_room = np.zeros(count, dtype=bool)  # capped only because nothing can reach the cap
        self._hidden, self._across = np.empty((2, 0, 3))  # points of such caps, and the normals there
        sheets = np.empty(0, dtype=np.int64) if as_sheets is None else as_sheets
        self._tangled = tangled
        self._wraps = Wraps(surface, self.record, gap, resolution, sheets, tangled, by_faces)

        poll_stop()
        soup = Soup(surface.vertices, faces, body, known_edges=edges)
        try:
            self.solid, self.pieces = self._built(soup)
            self.is_crossed = False
        except CrossingsError:
            self.solid, self.pieces = self._wraps.all_wrapped(soup), []
            self.is_crossed = True
            self.warnings.append(
                "The surface crosses itself too often to be united exactly, so the solid is what a ball of radius "
                f"{gap:g} (longest side = 2) cannot reach from outside."
            )
        if volume_of(self.solid) == 0:
            self.warnings.append("The surface could not be closed, so the convex hull of its points is used instead.")
            self.record.step[:] = STEPS.index("hull")
            self.solid, self.pieces = hull_of_points(surface.vertices), []
        self._warn_of_holes()
        self._measured = measure(self.record, surface, self._wraps.query(self.solid))
        self.lost = self._measured.depth
        self.lost_at = self._place(self._measured.at, self._measured.body)

    def keep_lost(self) -> None:
        """Add slabs of the faces that the solid leaves outside: a skin that crosses itself, or a wrap, loses some."""
        faces = faces_outside(self._measured, self._input, self._wraps.query(self.solid))
        body = self.record.body_of_input[faces]
        soup = Soup(self._input.vertices, self._input.faces[faces], body).in_patches()
        if not 0 < bodies_of(soup.faces, soup.edges)[0] <= _MOST_KEPT:
            return
        slabs = [slab for slab, _ in skins(soup, self.record)]
        try:
            self.solid = unite([as_manifold(self.solid), *slabs], keep_cavities=self._keep_cavities)
        except CrossingsError:  # they stay lost
            return
        self.pieces = [*self.pieces, *slabs] if self.pieces else []
        self.record.lost[body] = HALF_THICKNESS

    def doubted(self) -> IntArray:
        """Bodies whose skin was chosen among crossing faces and leads away from them."""
        return np.flatnonzero(self.record.has("outer skin") & (self.record.deviation > GAP))

    @property
    def torn(self) -> float:
        """How far slabs lead away from the input: beyond their thickness if booleans of them went wrong."""
        return float(self.record.deviation.max(initial=0.0, where=self.record.has("slab")))

    def has_crossing_slabs(self) -> bool:
        """Whether a slab crosses itself, so that booleans of it may go wrong."""
        return self._wraps.has_crossing_slabs()

    def _built(self, soup: Soup) -> Built:
        if len(self._tangled) == 0 and self._is_oriented(soup):
            parts = self._as_they_are(soup)
        else:
            is_tangled = np.isin(soup.body, self._tangled)
            tangles = self._cap(soup.only(is_tangled))
            soup = self._cap(self._drop_hidden(trust_windings(soup.only(~is_tangled), self.record.bodies)))
            parts = self._wraps.build_or_wrap(soup) if len(soup.faces) else []
            parts += self._wraps.untangled(tangles)
        pieces = [part for part, _ in parts]
        if self._keep_cavities:
            inward = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces), self.record.bodies) < 0
            return Built(unite_around_cavities(pieces, [bool(inward[body]) for _, body in parts]), [])
        built = Built(unite(pieces), pieces)
        if self._open_bodies == "thin":
            return built
        built = self._wraps.with_rooms(built, soup, parts, self._by_room)
        built = self._wraps.with_deep_slits(built, soup)
        built = self._wraps.with_slits(built, self._hidden, self._across, self._by_room)
        return self._wraps.with_noisy_slits(built)

    def _is_oriented(self, soup: Soup) -> bool:
        """Whether every edge joins two faces that run along it in opposite directions, and no body is flat."""
        if (soup.edges.valence != 2).any():
            return False
        forward = (soup.faces < np.roll(soup.faces, -1, axis=1)).ravel()
        if (np.bincount(soup.edges.of_halfedge, forward) != 1).any():
            return False
        volume = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces))
        return bool((np.abs(volume) > 2 * FLAT * np.bincount(soup.body, soup.area)).all())

    def _as_they_are(self, soup: Soup) -> list[tuple[Manifold, int]]:
        """Take closed, oriented bodies as they are: the result of `build_or_wrap` without sorting all sides."""
        volume = np.bincount(soup.body, signed_tetrahedra(soup.vertices, soup.faces))
        inward = volume < 0
        faces = np.where(inward[soup.body, None], soup.faces[:, ::-1], soup.faces)
        self.record.note(np.flatnonzero(inward), "reoriented")
        self.record.faces_out = np.bincount(soup.body)
        solids = [to_manifold(v, f) for v, f in split_labels(soup.vertices, faces, soup.body)]
        return list(zip(solids, range(self.record.bodies), strict=True))

    def _drop_hidden(self, soup: Soup) -> Soup:
        """Drop faces that lie inside their own body, if they are what keeps the body from having an inside.

        Where parts meet in faces that overlap without matching, the order of faces around an edge is undecided, and one
        wrong guess joins the inside with the outside. The winding number is not affected.
        """
        crowded = np.zeros(self.record.bodies, dtype=bool)
        crowded[soup.body[soup.at_valence(soup.edges.valence > 2)]] = True
        if not crowded.any():
            return soup
        share = soup.sheet_share(self.record.bodies)
        hidden = np.zeros(len(soup.faces), dtype=bool)
        for body in np.flatnonzero(crowded & (share > FLAPS)):
            poll_stop()
            some = np.flatnonzero(soup.body == body)
            hidden[some] = hidden_faces(soup.vertices, soup.faces[some])
        if not hidden.any():
            return soup
        better = soup.only(~hidden).sheet_share(self.record.bodies) < share / 2
        self.record.note(soup.body[hidden & better[soup.body]], "outer skin")
        return soup.only(~hidden | ~better[soup.body])

    def _cap(self, soup: Soup) -> Soup:
        """Cap the bodies all of whose holes may be capped."""
        free = int((soup.edges.valence == 1).sum())
        if free == 0 or free > MOST_FREE_EDGES or self._open_bodies == "thin":
            return soup
        soup, holes = self._close(soup)
        if not all(hole.is_closed for hole in holes):
            # What hangs on a rim is rather a side than a fin, unless its body would be hollow.
            soup, others = self._close(soup, fins=True)
            holes = [hole for hole in holes if hole.is_closed] + others if others else holes
        self.holes += holes
        return soup

    def _close(self, soup: Soup, fins: bool = False) -> tuple[Soup, list[Hole]]:
        fill = self._open_bodies == "solid"
        closed = close_holes(
            soup, self.record.bodies, self._input, self._covers, self._gap, HALF_THICKNESS / 2, fill, self._bend, fins
        )
        if closed is None:
            return soup, []
        self.record.note(closed.bodies, "capped")
        self._by_room |= closed.by_room
        self._hidden = np.concatenate([self._hidden, closed.hidden])
        self._across = np.concatenate([self._across, closed.across])
        return closed.soup, closed.holes

    def _covers(self, points: FloatArray) -> BoolArray:
        """Whether a ball can reach points; if cavities are kept, everything connected to them is open."""
        return np.ones(len(points), dtype=bool) if self._keep_cavities else self._wraps.reach.covers(points)

    def _warn_of_holes(self) -> None:
        self.holes.sort(key=lambda hole: hole.doubt, reverse=True)
        if any(hole.depth for hole in self.holes):
            depth = max(hole.depth for hole in self.holes)
            self.warnings.append(
                f"Holes were closed although the caps lead up to {depth:.3f} (longest side = 2) away from the surface,"
                f" at {self._places([hole for hole in self.holes if hole.is_closed])}."
            )
        is_slab = self.record.has("slab")
        openings = [hole for hole in self.holes if not hole.is_closed and is_slab[hole.body]]
        shells = len({hole.body for hole in openings})
        if shells:
            became = "1 open body became a thin shell; --open solid fills it"
            if shells > 1:
                became = f"{shells} open bodies became thin shells; --open solid fills them"
            self.warnings.append(f"{became} (open at {self._places(openings)}).")

    def _places(self, holes: list[Hole]) -> str:
        """Where holes are, the most doubtful first."""
        named = "; ".join(self._place(hole.at, hole.body) for hole in holes[:_NAMED])
        return named + (f"; and {len(holes) - _NAMED} more, see `holes`" if len(holes) > _NAMED else "")

    def _place(self, point: ArrayLike, body: int) -> str:
        return self._frame.place(point, body if self.record.bodies > 1 else None)
