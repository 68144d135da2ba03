"""From any soup of triangles to one closed, oriented solid, by the least change that works.

Input: an `InputMesh`. Output: a `Solid`, with the step every body needed. In order:

1. equal vertices are merged; degenerate and doubled faces dropped;
2. free edges that nearly coincide are welded, T-junctions included;
3. the sides of the faces are joined around the edges (`topology`): a body whose faces all have an inside and an outside
   is solid and keeps its faces exactly, whatever their windings were; faces it encloses are dropped;
4. holes are capped where every point of the cap stays near the input's surface, or where nothing can reach it;
5. what is still open is made of sheets: each is thickened into a slab, face by face, without remeshing;
6. all solids are united and their cavities filled;
7. a room that remains and that no ball can enter is closed by a wrap of voxels drawn onto the surface.

The watertight-manifold algorithm of Huang et al. (2018) would serve for 5 too, but it grows every sheet by a voxel and
turns a dozen exact faces into tens of thousands of approximate ones; steps 3 to 5 keep the faces of the input.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from manifold3d import Manifold

from rlacd.errors import EmptyMeshError
from rlacd.solid.frame import FloatArray, Frame
from rlacd.solid.load import InputMesh
from rlacd.solid.repair_distance import SurfaceQuery, spread_points
from rlacd.solid.repair_holes import cap, free_edges, free_loops, split_at_free_vertices, weld_free_vertices
from rlacd.solid.repair_skin import skin
from rlacd.solid.repair_union import hull_of_points, split_labels, to_arrays, to_manifold, unite
from rlacd.solid.repair_voxels import Reach
from rlacd.solid.solid import BodyRepair, Solid
from rlacd.solid.topology import (
    BoolArray,
    Edges,
    IntArray,
    Sides,
    bodies_of,
    face_areas,
    first_of_doubled,
    merge_equal_vertices,
    nondegenerate,
    sides_of,
)

STEPS = ("closed", "reoriented", "outer skin", "welded", "capped", "slab", "wrapped", "hull", "dropped")
"""What can be done to a body, from the least change to the most."""

HALF_THICKNESS = 1e-3
"""Half the thickness of the slab a sheet becomes, in frame units."""

GAP = 0.03
"""Farthest a cap may lead from the input's surface, and the radius of the ball a gap must stop, in frame units."""

HOLE, HOLE_SHARE = 0.1, 0.02
"""A body nearly closed, its holes no more than this share of its area, is closed with caps up to this far away: a scan
with a few holes is meant as a solid, a cup is not. The caps are reported."""

_WELDS = (2e-5, 5e-4)
_WRAP_ERROR = 4e-3
_NO_AREA = 1e-14
# A closed body with less volume per area is flat: nothing could be cut from it.
_FLAT = 1e-6
# Tracing hole loops is the one step that walks edge by edge.
_MOST_FREE_EDGES = 500_000


@dataclass
class _Soup:
    """Faces on their way through the steps, with their edges and bodies."""

    vertices: FloatArray
    faces: IntArray
    edges: Edges = field(init=False)
    bodies: int = field(init=False)
    body: IntArray = field(init=False)

    def __post_init__(self) -> None:
        self.edges = Edges.of(self.faces, len(self.vertices))
        self.bodies, self.body = bodies_of(self.faces, self.edges)

    def using_valence(self, marked: BoolArray) -> BoolArray:
        """Return ``[F]`` whether a face has an edge of marked valence, given ``[E]`` marks."""
        result: BoolArray = marked[self.edges.of_halfedge].reshape(-1, 3).any(axis=1)
        return result

    @property
    def free(self) -> BoolArray:
        """``[E]``, the edges of one face only."""
        return self.edges.valence == 1


def repair(mesh: InputMesh, *, resolution: int = 100, threads: int | None = None) -> Solid:
    """Make a mesh into one closed, oriented solid.

    Parameters
    ----------
    mesh
        What was loaded.
    resolution
        Cells along the longest side of the grid on which enclosed rooms are looked for.
    threads
        For symmetry with the other stages; the result does not depend on it.

    Returns
    -------
    Solid
        Never empty.

    Raises
    ------
    EmptyMeshError
        There is no finite point.
    """
    del threads
    warnings = list(mesh.warnings)
    points = mesh.vertices[np.unique(mesh.faces)] if len(mesh.faces) else mesh.vertices
    if len(points) == 0:
        raise EmptyMeshError("the mesh has no points, so there is nothing to decompose: check the file or its export")
    frame = Frame.of(points)
    points = frame.to_frame(points)
    vertices, index = merge_equal_vertices(frame.to_frame(mesh.vertices))
    faces = index[mesh.faces.astype(np.int64)].reshape(-1, 3)
    faces = faces[nondegenerate(faces)]
    faces = faces[first_of_doubled(faces, len(vertices))]
    surface = (vertices, np.ascontiguousarray(faces, dtype=np.int32))

    if len(faces) == 0 or face_areas(vertices, faces).max() < _NO_AREA:
        warnings.append("no face has an area: the hull of the points stands in for the solid")
        solid = hull_of_points(points, HALF_THICKNESS)
        body = BodyRepair(0, "hull", len(mesh.faces), solid.num_tri(), 0.0)
        return Solid(solid, surface, frame, (body,), tuple(warnings))

    work = _Repair(vertices, faces, resolution)
    return Solid(work.solid, surface, frame, work.report(), tuple(warnings + work.warnings))


class _Repair:
    """The steps on one input; `solid`, `report()` and `warnings` are the result.

    Bodies are numbered after cracks are welded; every array named ``of_body`` or by a quantity alone is per body.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, resolution: int) -> None:
        self.input = SurfaceQuery(vertices, faces)
        self.resolution = resolution
        self.warnings: list[str] = []

        soup, origin = self._weld(vertices, faces)
        self.soup = soup
        self.body_of_input = np.zeros(len(faces), dtype=np.int64)
        self.body_of_input[origin] = soup.body
        self.step = np.zeros(soup.bodies, dtype=np.int64)
        self.deviation = np.zeros(soup.bodies)
        self.faces_out = np.zeros(soup.bodies, dtype=np.int64)
        self._note(soup.body[(soup.faces != faces[origin]).any(axis=1)], "welded")

        closed, body = self._cap(soup)
        self.parts, self.part_body = self._build(closed, body)
        self.solid = unite(self.parts)
        self._wrap_rooms()
        if self.solid.is_empty():
            self.warnings.append("the surface could not be closed: the hull of its points stands in for the solid")
            self.step[:] = STEPS.index("hull")
            self.solid = hull_of_points(vertices[np.unique(faces)], HALF_THICKNESS)
        self._measure()

    def report(self) -> tuple[BodyRepair, ...]:
        """One record a body."""
        faces_in = np.bincount(self.soup.body, minlength=self.soup.bodies)
        rows = zip(self.step.tolist(), faces_in.tolist(), self.faces_out.tolist(), self.deviation.tolist(), strict=True)
        return tuple(BodyRepair(i, STEPS[s], a, b, d) for i, (s, a, b, d) in enumerate(rows))

    def _note(self, bodies: IntArray, step: str) -> None:
        """Record a step; a body keeps the one that changes it most."""
        bodies = np.unique(bodies)
        self.step[bodies] = np.maximum(self.step[bodies], STEPS.index(step))

    @cached_property
    def reach(self) -> Reach:
        """Where a ball of radius `GAP` can go around the input."""
        return Reach.of(self.input.vertices, self.input.faces, radius=GAP, resolution=self.resolution)

    def _weld(self, vertices: FloatArray, faces: IntArray) -> tuple[_Soup, IntArray]:
        """Close cracks; returns the new soup, and the face of the input each of its faces comes from."""
        soup, origin = _Soup(vertices, faces), np.arange(len(faces))
        for tolerance in _WELDS:
            free = int(soup.free.sum())
            if free == 0 or free > _MOST_FREE_EDGES:
                break
            welded = weld_free_vertices(vertices, soup.faces, tolerance)
            split, parent = split_at_free_vertices(vertices, welded, tolerance)
            keep = nondegenerate(split)
            keep[keep] = first_of_doubled(split[keep], len(vertices))
            trial = _Soup(vertices, split[keep])
            if int(trial.free.sum()) < free:
                soup, origin = trial, origin[parent[keep]]
        return soup, origin

    def _cap(self, soup: _Soup) -> tuple[_Soup, IntArray]:
        """Cap the bodies all of whose holes can honestly be capped; returns the soup and the body of every face."""
        edges = free_edges(soup.faces, len(soup.vertices))
        loops = free_loops(edges) if len(edges) <= _MOST_FREE_EDGES else []
        if not loops:
            return soup, soup.body
        at_hole = soup.using_valence(soup.free)
        body_of_vertex = np.zeros(len(soup.vertices), dtype=np.int64)
        body_of_vertex[soup.faces[at_hole]] = soup.body[at_hole, None]
        caps = np.concatenate([loop[cap(soup.vertices[loop])] for loop in loops])
        owner = np.repeat([body_of_vertex[loop[0]] for loop in loops], [len(loop) - 2 for loop in loops])

        points, on = spread_points(soup.vertices, caps, GAP / 2)
        distance = self.input.distance(points)
        far = distance > GAP
        if far.any():
            far[far] = self.reach.covers(points[far])
        chosen = np.zeros(soup.bodies, dtype=bool)
        chosen[soup.body[at_hole]] = True
        cap_area = np.bincount(owner, face_areas(soup.vertices, caps), soup.bodies)
        body_area = np.bincount(soup.body, face_areas(soup.vertices, soup.faces), soup.bodies)
        nearly_closed = cap_area <= HOLE_SHARE * body_area
        chosen[owner[on[far & ~nearly_closed[owner[on]]]]] = False
        chosen[owner[on[far & (distance > HOLE)]]] = False

        def with_caps() -> tuple[_Soup, IntArray]:
            some = chosen[owner]
            faces = np.concatenate([soup.faces, caps[some]])
            keep = first_of_doubled(faces, len(soup.vertices))
            return _Soup(soup.vertices, faces[keep]), np.concatenate([soup.body, owner[some]])[keep]

        # A cap is worth having only where it gives the body an inside: a strip whose cap lies on itself stays a sheet.
        capped, body = with_caps()
        sides = sides_of(capped.vertices, capped.faces, capped.edges)
        volume = np.bincount(_component_body(sides, body), np.maximum(sides.volume, 0), soup.bodies)
        area = np.bincount(body, face_areas(capped.vertices, capped.faces), soup.bodies)
        chosen &= volume > HALF_THICKNESS * area / 2
        chosen[body[sides.sheet]] = False
        if not chosen.any():
            return soup, soup.body
        self._note(np.flatnonzero(chosen), "capped")
        wide = far & chosen[owner[on]]
        if wide.any():
            self.warnings.append(
                f"{len(np.unique(owner[on[wide]]))} nearly closed bodies had holes that were closed although the caps lead "
                f"up to {distance[wide].max():.3f} away from the surface"
            )
        return with_caps()

    def _build(self, soup: _Soup, body: IntArray) -> tuple[list[Manifold], IntArray]:
        """Turn every body into closed solids; returns them, and the body each belongs to."""
        vertices, faces = soup.vertices, soup.faces
        sides = sides_of(vertices, faces, soup.edges)
        front, back = sides.label[0::2], sides.label[1::2]
        has_sheet = np.zeros(len(sides.volume), dtype=bool)
        has_sheet[front[sides.sheet]] = True
        flat = (np.abs(sides.volume) <= _FLAT * sides.area) & ~has_sheet
        # The two side components of a flat closed body are each other's mirror: build the fronts.
        fronts = np.zeros_like(flat)
        fronts[front] = True
        keep = (sides.volume > _FLAT * sides.area) | (has_sheet & (sides.volume >= -_FLAT * sides.area)) | (flat & fronts)
        thin = (sides.sheet & keep[front]) | (flat[front] & keep[front])

        new_vertices, new_faces, label = skin(vertices, faces, sides, keep, thin, HALF_THICKNESS)
        parts = [to_manifold(v, f) for v, f in split_labels(new_vertices, new_faces, label)]
        built, count = np.unique(label, return_counts=True)
        part_body = _component_body(sides, body)[built]
        np.add.at(self.faces_out, part_body, count)

        self._note(body[keep[back] & ~keep[front]], "reoriented")
        self._note(body[~keep[front] & ~keep[back]], "outer skin")
        self._note(body[soup.using_valence(soup.edges.valence > 2)], "outer skin")
        self._note(body[thin], "slab")
        return parts, part_body

    def _measure(self) -> None:
        """Record, for the bodies that were changed, how far the solid's surface leads from the input's."""
        if self.step.max() < STEPS.index("welded"):
            return
        vertices, faces = to_arrays(self.solid)
        points, _ = spread_points(vertices, faces, GAP)
        closest, face = self.input.closest(points)
        distance = np.linalg.norm(points - closest, axis=1)
        np.maximum.at(self.deviation, self.body_of_input[face], distance)
        missing = np.isin(self.body_of_input, np.flatnonzero(self.step >= STEPS.index("wrapped")))
        if missing.any():
            solid = SurfaceQuery(vertices, faces)
            points, on = spread_points(self.input.vertices, self.input.faces[missing], GAP)
            outside = ~solid.inside(points)
            np.maximum.at(self.deviation, self.body_of_input[missing][on[outside]], solid.distance(points[outside]))

    def _wrap_rooms(self) -> None:
        """Close rooms that sheets enclose but for gaps no ball of radius `GAP` passes."""
        slabs = np.flatnonzero(self.step == STEPS.index("slab"))
        of_slab = np.isin(self.soup.body, slabs)
        area = face_areas(self.soup.vertices, self.soup.faces[of_slab]).sum()
        if area < 4 * np.pi * GAP**2 or self.solid.is_empty():
            return
        rooms = self.reach.rooms_outside(SurfaceQuery(*to_arrays(self.solid)))
        if len(rooms) == 0:
            return
        points, on = spread_points(self.soup.vertices, self.soup.faces[of_slab], GAP)
        near = np.isin(self.reach.rooms_near(points), rooms)
        owner = self.soup.body[of_slab][on]
        share = np.bincount(owner, near, self.soup.bodies) / np.maximum(np.bincount(owner, minlength=self.soup.bodies), 1)
        walls = share > 0.5
        rooms = np.intersect1d(rooms, self.reach.rooms_near(points[walls[owner]]))
        if len(rooms) == 0:
            return
        wrap_vertices, wrap_faces = self.reach.wrap(rooms, self.input)
        wrap = to_manifold(wrap_vertices, wrap_faces).simplify(_WRAP_ERROR)
        if wrap.is_empty() or wrap.volume() <= 0:
            return
        rest = [part for part, body in zip(self.parts, self.part_body, strict=True) if not walls[body]]
        united = unite([*rest, wrap])
        if united.volume() <= self.solid.volume():
            return
        self.solid = united
        self._note(np.flatnonzero(walls), "wrapped")
        first = np.flatnonzero(walls)[0]
        self.faces_out[walls] = 0
        self.faces_out[first] = wrap.num_tri()


def _component_body(sides: Sides, body: IntArray) -> IntArray:
    """Return ``[C]`` the body of each side component, given the body ``[F]`` of each face."""
    result = np.zeros(len(sides.volume), dtype=np.int64)
    result[sides.label[0::2]] = body
    result[sides.label[1::2]] = body
    return result
