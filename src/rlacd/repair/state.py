"""The state of a repair: the input, and what the steps so far have made of its bodies."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from rlacd import _native
from rlacd._native import poll_stop, signed_tetrahedra
from rlacd.repair.cracks import close_cracks
from rlacd.repair.distance import SurfaceQuery, affordable, points_covering, shared_faces
from rlacd.repair.soup import Soup
from rlacd.repair.union import Walls, cavities_in, emptied, filled, hollowed, to_arrays, unite, united
from rlacd.repair.voxels import Reach
from rlacd.repair.wanted import DEFAULT_GAP, Wanted
from rlacd.report import BodyRepair, Hole
from rlacd.solid.arrays import BoolArray, Int64Array
from rlacd.solid.frame import HALF_THICKNESS, Frame
from rlacd.solid.mass import mass_of
from rlacd.solid.solid import Shape, Solid
from rlacd.solid.topology import Edges, bodies_of, marked

OUTCOMES = ("closed", "reoriented", "outer skin", "welded", "capped", "slab", "wrapped", "hull")
"""The steps that may have changed a body most, from the least change to the most."""

_WELDS = (2e-5, 5e-4)

# A warning names this many holes.
_NAMED = 5

# Filled cavities are reported from this share of the solid's volume on: crevices where walls meet, up to hundreds in a
# mesh, have up to 0.0005, rooms from 0.0024.
_CREVICES = 1e-3


def query_of(solid: Shape, threads: int | None) -> SurfaceQuery:
    """Queries of a solid."""
    return SurfaceQuery(*to_arrays(solid), threads)


class Piece(NamedTuple):
    """A closed solid that a body, or some of its faces, became.

    Attributes
    ----------
    shape : Manifold
    body : int
    is_slab : bool
        Whether it was built of sheets.
    """

    shape: Manifold
    body: int
    is_slab: bool = False


class State:
    """The input in the normalised frame, and what became of its bodies, which are numbered after cracks are welded.

    Attributes
    ----------
    surface : SurfaceQuery
        The input.
    frame : Frame
    wanted : Wanted
    bodies : int
    body_of_input : int64 [F]
        The body of each face of the input.
    is_gone : bool [F]
        Whether a face of the input is narrower than the cracks that were closed, and went with them.
    step : int64 [bodies]
        The step that changed a body most, an index of `OUTCOMES`.
    beyond, lost : float64 [bodies]
        Greatest distance of the repaired surface from the input, and of input outside the solid from the solid.
    soup : Soup
        The faces of the input, with the caps.
    parts : list of Piece
        The solids built so far.
    solid : Manifold
        The union of `parts`, with cavities filled or kept.
    cavity_walls : (vertices, faces), optional
        Walls of filled cavities that windings bound.
    by_hidden_caps, is_tangled : bool [bodies]
        Whether a body was capped only because nothing can reach the caps; whether it was built without its windings.
    is_apart : bool
        Whether the sheets were not united.
    holes : list of Hole
    deepest_cap : float
        How far caps lead away from the surface where something can reach them, if that is more than they may without a
        word; else 0.
    warnings : list of str
    """

    def __init__(self, surface: SurfaceQuery, frame: Frame, wanted: Wanted) -> None:
        self.surface, self.wanted, self.frame = surface, wanted, frame
        faces, origin, edges = close_cracks(surface.vertices, surface.faces, _WELDS)
        self.bodies, body = bodies_of(faces, edges)
        self.body_of_input = np.zeros(len(surface.faces), dtype=np.int64)
        self.body_of_input[origin] = body
        self.is_gone = ~marked(origin, len(surface.faces))
        self.step = np.zeros(self.bodies, dtype=np.int64)
        self.beyond, self.lost = np.zeros((2, self.bodies))
        self.note(body[(faces != surface.faces[origin]).any(axis=1)], "welded")
        self.soup = Soup(surface.vertices, faces, body)
        self.parts: list[Piece] = []
        self.solid = Manifold()
        self.cavity_walls: Walls | None = None
        self.by_hidden_caps, self.is_tangled = np.zeros((2, self.bodies), dtype=bool)
        self.is_apart = False
        self.holes: list[Hole] = []
        self.deepest_cap = 0.0
        self.warnings: list[str] = []
        self._asked: tuple[Manifold, SurfaceQuery] | None = None

    @cached_property
    def reach(self) -> Reach:
        """Where the ball can go."""
        return Reach(self.surface, self.wanted.gap, self.wanted.cells)

    def query(self) -> SurfaceQuery:
        """Queries of the solid as it is now."""
        if self._asked is None or self._asked[0] is not self.solid:
            self._asked = self.solid, query_of(self.solid, self.surface.threads)
        return self._asked[1]

    def note(self, bodies: Int64Array, step: str) -> None:
        """Record a step; a body keeps the one that changes it most."""
        noted = marked(bodies, self.bodies)
        self.step[noted] = np.maximum(self.step[noted], OUTCOMES.index(step))

    def has(self, step: str) -> BoolArray:
        """Return ``[bodies]`` whether this is the step of a body."""
        return np.asarray(self.step == OUTCOMES.index(step))

    def set_apart(self, faces: Int64Array) -> None:
        """Make bodies of their own of faces of the input, which become slabs."""
        corners = self.surface.faces[faces].astype(np.int64)
        count, body = bodies_of(corners, Edges.of(corners, len(self.surface.vertices)))
        self.body_of_input[faces] = self.bodies + body
        self.bodies += count
        self.step = np.append(self.step, np.full(count, OUTCOMES.index("slab")))
        self.beyond, self.lost = (np.append(lengths, np.zeros(count)) for lengths in (self.beyond, self.lost))

    def unite_parts(self) -> None:
        """Unite all parts and fill their cavities, or keep them.

        Sheets and tangles have no windings to go by: what they enclose counts as solid.
        """
        inward = np.bincount(self.soup.body, signed_tetrahedra(self.soup.vertices, self.soup.faces), self.bodies) < 0
        is_wound = [not (part.is_slab or self.is_tangled[part.body]) for part in self.parts]
        wound = [part for part, is_one in zip(self.parts, is_wound, strict=True) if is_one]
        closed = [part.shape for part in wound]
        rest = [part.shape for part, is_one in zip(self.parts, is_wound, strict=True) if not is_one]
        bounded = hollowed(closed, [bool(inward[part.body]) for part in wound])
        if self.wanted.keep_cavities:
            self.solid = unite([*bounded, *rest], keep_cavities=True)
            return
        self.solid, self.cavity_walls = filled(united([part.shape for part in self.parts]))
        if bounded is not closed or (rest and self.cavity_walls):
            bare, self.cavity_walls = filled(united(bounded))
            if bounded is not closed:
                whole = unite(closed) if rest else self.solid
                if whole.volume() - bare.volume() > _CREVICES * whole.volume():
                    self.cavity_walls = emptied(whole, bounded)

    def of_bodies(self, marked: BoolArray) -> Soup:
        """The faces of marked bodies."""
        return self.soup.only(marked[self.soup.body])

    def result(self, warnings: tuple[str, ...]) -> Solid:
        """The solid that is reported, with warnings of the input before those of its repair."""
        self._warn_of_holes()
        self._warn_of_cavities()
        faces_out = np.zeros(self.bodies, dtype=np.int64)
        for part in self.parts:
            faces_out[part.body] += part.shape.num_tri()
        faces_in = np.bincount(self.body_of_input, minlength=self.bodies)
        columns = self.step, faces_in, faces_out, np.maximum(self.beyond, self.lost)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return Solid(
            self.solid,
            (self.surface.vertices, self.surface.faces.astype(np.int32)),
            self.frame,
            tuple(BodyRepair(i, OUTCOMES[step], *row) for i, (step, *row) in enumerate(rows)),
            (*warnings, *self.warnings),
            holes=tuple(self.holes),
            body_of=self.body_of_input,
            is_apart=self.is_apart,
            index=self.surface.index,
            pieces=[part.shape for part in self.parts] if len(self.parts) > 1 and not self.wanted.keep_cavities else [],
            cavity_walls=self.cavity_walls,
        )

    def _warn_of_cavities(self) -> None:
        """Say which cavities were filled, unless that changes nothing but crevices between walls that nearly touch."""
        walls = self.cavity_walls
        if walls is None or -_native.mesh_volume(*walls) < _CREVICES * self.solid.volume():
            return
        volume, count = self.frame.told_in.cubic_words(-mass_of(*walls, self.frame).volume_abs), cavities_in(walls)
        said = "1 closed cavity was" if count == 1 else f"{count} closed cavities were"
        self.warnings.append(
            f"{said} filled, as nothing can get in (volume {volume}, which the mass leaves out); --keep-cavities "
            "(keep_cavities=True) keeps what is closed empty."
        )

    def _warn_of_holes(self) -> None:
        """Say which holes were closed though that is a guess, and where bodies stayed open."""
        if self.deepest_cap > 0:
            self.warnings.append(
                f"Holes were closed although the caps lead up to {self.frame.unit.words(self.deepest_cap)} away from "
                f"the surface, at {self._places([hole for hole in self.holes if hole.closed])}."
            )
        is_thin = self.has("slab")
        is_thin[[part.body for part in self.parts if not part.is_slab]] = False  # only fins of it are
        openings = [hole for hole in self.holes if not hole.closed and is_thin[hole.body]]
        shells = len({hole.body for hole in openings})
        if shells:
            became = "1 open body became a thin shell" if shells == 1 else f"{shells} open bodies became thin shells"
            if self.wanted.open_bodies != "solid":
                became += f"; --openings solid fills {'it' if shells == 1 else 'them'}"
            self.warnings.append(f"{became} (open at {self._places(openings)}).")

    def _places(self, holes: list[Hole]) -> str:
        """Where holes are, the most doubtful first."""
        some = [
            self.frame.place(self.frame.to_frame(hole.at_abs), hole.body if self.bodies > 1 else None)
            for hole in holes[:_NAMED]
        ]
        return "; ".join(some) + (f"; and {len(holes) - _NAMED} more, see `holes`" if len(holes) > _NAMED else "")


def measure(state: State) -> Int64Array:
    """Record how far the solid and changed bodies deviate; returns the input's faces that lead out of the solid."""
    surface, solid = state.surface, state.query()
    if state.step.max() < OUTCOMES.index("outer skin") and not state.is_gone.any():
        return np.empty(0, dtype=np.int64)
    kept, taken_over = shared_faces(solid.vertices, solid.faces, surface.vertices, surface.faces)
    poll_stop()
    own = solid.faces[~kept]
    points, _ = points_covering(solid.vertices, own, affordable(DEFAULT_GAP, solid.vertices, own))
    closest, face = surface.closest(points)
    np.maximum.at(state.beyond, state.body_of_input[face], np.linalg.norm(points - closest, axis=1))

    is_replaced = (state.step[state.body_of_input] >= OUTCOMES.index("outer skin")) & ~taken_over
    replaced = np.flatnonzero(is_replaced | state.is_gone)
    faces = surface.faces[replaced]
    spacing = affordable(DEFAULT_GAP, surface.vertices, faces)
    points, on = points_covering(surface.vertices, faces, spacing)
    # The middle of a slab is half as far from its surface.
    lost = np.flatnonzero(solid.is_beyond(points, 2 * HALF_THICKNESS))
    lost = lost[~solid.inside(points[lost])]
    corners = np.unique(faces[_native.longest_edges(surface.vertices, faces) <= spacing])  # the first of the points
    is_out = marked(corners[lost[lost < len(corners)]], len(surface.vertices))
    leads_out = np.asarray(is_out[faces].any(axis=1))
    leads_out[on[lost]] = True
    state.set_apart(replaced[leads_out & state.is_gone[replaced]])
    np.maximum.at(state.lost, state.body_of_input[replaced[on[lost]]], solid.distance(points[lost]))
    return replaced[leads_out]
