"""From any soup of triangles to one closed, oriented solid, by the least change that works.

Input: an `InputMesh`. Output: a `Solid`, with the step that every body needed. In order:

1. equal vertices are merged; degenerate and doubled faces dropped;
2. free edges that nearly coincide are welded, T-junctions included;
3. the sides of the faces are joined around the edges (`topology`): a body whose faces all have an inside and an outside
   is solid and keeps its faces exactly, whatever their windings were; faces it encloses are dropped;
4. holes are capped if every point of the cap stays near the input's surface, or if nothing can reach it;
5. whatever is still open consists of sheets: each is thickened into a slab, face by face, without remeshing;
6. all solids are united and their cavities filled;
7. any remaining room that no ball can enter is closed by a voxel wrap projected onto the surface;
8. faces that still lie outside, such as those of a skin that crosses itself, become slabs too.

The watertight-manifold algorithm of Huang et al. (2018) could replace step 5, but it grows every sheet by a voxel and
turns a dozen exact faces into tens of thousands of approximate ones; steps 3 to 5 keep the faces of the input.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rlacd import _native
from rlacd._native import poll_stop
from rlacd.errors import EmptyMeshError
from rlacd.memory import BYTES_REPAIRED, require_memory
from rlacd.repair.attempt import Attempt
from rlacd.repair.distance import SurfaceQuery, probes
from rlacd.repair.slabs import hull_of_points
from rlacd.repair.soup import NO_AREA
from rlacd.repair.union import one_body, volume_of
from rlacd.repair.voxels import GAP
from rlacd.solid.frame import FloatArray, Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import BodyRepair, Solid
from rlacd.solid.topology import BoolArray, IntArray, detach_films, face_areas

CELLS_ACROSS = 1.5
"""Least radius of a ball, in cells of the grid that it rolls on."""

# What a capped body may lose before its caps are made another way, or none.
_LOST = 5e-3
# How far slabs may lead away from the input before those that cross themselves are made another way.
_TORN = 1e-2
# Of that, what may be left if making them another way is worth its many small faces.
_MENDED = 0.5
# Share of the volume that is left where no hole is closed, below which bodies were emptied.
_FILLED = 0.4


def repair(
    mesh: InputMesh,
    *,
    resolution: int = 100,
    open_bodies: str = "auto",
    gap: float = GAP,
    threads: int | None = None,
    keep_cavities: bool = False,
    tangled: IntArray | None = None,
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
    tangled
        Numbers of bodies that cross themselves (`rlacd.repair.tangles`): what their faces enclose becomes solid,
        whatever their windings.

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
    taken = one_body(welded_vertices, welded_faces) if tangled is None else None
    if taken is not None:
        shape, was_inward = taken
        row = BodyRepair(0, "reoriented" if was_inward else "closed", len(welded_faces), len(welded_faces), 0.0)
        return Solid(shape, (welded_vertices, welded_faces), frame, (row,), tuple(warnings), is_as_given=True)
    require_memory(len(welded_faces), BYTES_REPAIRED, mesh.name)
    vertices, faces = detach_films(welded_vertices, welded_faces.astype(np.int64), is_film)
    detached = np.asarray(faces[:, 0] >= len(welded_vertices))
    faces = faces[~_is_inside(vertices, faces, detached, threads)]
    surface = (vertices, faces.astype(np.int32))

    if len(faces) == 0 or face_areas(vertices, faces).max() < NO_AREA:
        warnings.append("No face has an area, so the convex hull of all points is used instead.")
        solid = hull_of_points(points)
        body = BodyRepair(0, "hull", len(mesh.faces), solid.num_tri(), 0.0)
        return Solid(solid, surface, frame, (body,), tuple(warnings))

    query = SurfaceQuery(vertices, faces, threads)
    cells = max(resolution, math.ceil(2 * CELLS_ACROSS / gap)) if gap < GAP else resolution
    if tangled is not None:
        bodies = "1 body crosses" if len(tangled) == 1 else f"{len(tangled)} bodies cross"
        warnings.append(
            f"{bodies} too much of their own surface to be cut, so whatever the faces enclose is taken to be solid."
        )
    work = _attempted(partial(Attempt, query, frame, cells, gap, keep_cavities), open_bodies, tangled)
    work.keep_lost()
    return Solid(
        work.solid,
        surface,
        frame,
        work.record.rows(),
        tuple(warnings + work.warnings),
        holes=tuple(work.holes),
        body_of=work.record.body_of_input,
        index=query.index,
        pieces=work.pieces if len(work.pieces) > 1 else [],
    )


def _attempted(attempt: Callable[..., Attempt], open_bodies: str, tangled: IntArray | None) -> Attempt:
    """The best of a few attempts; most inputs need one."""
    how: dict[str, Any] = {
        "open_bodies": open_bodies,
        "tangled": np.empty(0, dtype=np.int64) if tangled is None else tangled,
    }
    work = attempt(**how)
    if work.is_crossed:
        return work
    if work.lost > _LOST:
        # A cap that bends little can cross the body's own faces, which turns some of it inside out: try small caps.
        other = attempt(**how, bend=0.0)
        if other.lost < work.lost:
            work, how = other, how | {"bend": 0.0}
    if work.lost > _LOST and open_bodies == "auto":
        # Caps or wraps lose something: leave everything open, unless that empties a body.
        other = attempt(**how | {"open_bodies": "thin"})
        if other.lost < work.lost and volume_of(other.solid) > _FILLED * volume_of(work.solid):
            other.warnings.append(
                f"Some of the surface lay up to {work.lost:.4g} from the solid once holes were closed, farthest near "
                f"{work.lost_at}, so open bodies became thin shells; --open solid fills them."
            )
            other.holes = [replace(hole, is_closed=False) for hole in work.holes]
            work, how = other, how | {"open_bodies": "thin"}
    if work.torn > _TORN and work.has_crossing_slabs():
        # Slabs that cross themselves and each other can leave wedges that none of them has.
        other = attempt(**how, by_faces=True)
        if other.torn < _MENDED * work.torn:
            work, how = other, how | {"by_faces": True}
    doubted = work.doubted()
    if len(doubted):
        # If faces of one body cross each other, they may be joined into a wrong skin: try them as sheets.
        other = attempt(**how, as_sheets=doubted)
        if other.record.deviation.max() < work.record.deviation.max():
            work = other
    return work


def _used(mesh: InputMesh) -> tuple[FloatArray, IntArray]:
    """The points that faces use and the faces by these; all points if there are no faces."""
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    if used.all() or len(mesh.faces) == 0:
        return mesh.vertices, mesh.faces
    return mesh.vertices[used], (np.cumsum(used) - 1)[mesh.faces]


def _is_inside(vertices: FloatArray, faces: IntArray, film: BoolArray, threads: int | None) -> BoolArray:
    """Return ``[F]`` which films lie inside the other faces: where two bodies touch."""
    inside = film.copy()
    if film.any():
        query = SurfaceQuery(vertices, faces[~film], threads)
        still = np.ones(int(film.sum()), dtype=bool)
        for points in probes(vertices, faces[film]).swapaxes(0, 1):  # most films fail at the first
            still[still] = np.abs(query.winding(points[still])) > 0.75
        inside[film] = still
    return inside
