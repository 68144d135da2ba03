"""From any soup of triangles to one closed, oriented solid, by the least change that works.

Input: an `InputMesh`. Output: a `Solid`, with the step that changed each body most. Equal vertices are merged,
degenerate and doubled faces dropped. One closed body stays as it is unless largely inside out. All else goes through
`STEPS`.

The watertight-manifold algorithm of Huang et al. (2018) could replace most of them, but it grows every sheet by a voxel
and turns a dozen exact faces into tens of thousands of approximate ones; these steps keep the faces of the input.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rlacd import _native
from rlacd._native import face_areas, poll_stop
from rlacd.errors import EmptyMeshError
from rlacd.memory import BYTES_REPAIRED, require_memory
from rlacd.repair.distance import SurfaceQuery, is_tangle
from rlacd.repair.holes import close_holes
from rlacd.repair.soup import MOST_PATCHES, Soup
from rlacd.repair.state import Piece, State, Wanted, measure, query_of
from rlacd.repair.union import CrossingsError, hull_of_points, one_body, slab_of_faces, unite
from rlacd.repair.voxels import DEFAULT_GAP
from rlacd.repair.walls import build_walls, skins
from rlacd.repair.wraps import fill_slits, fill_voids, rebuild_tangles, wrap_all
from rlacd.report import BodyRepair
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array
from rlacd.solid.component import DENSE
from rlacd.solid.frame import HALF_THICKNESS, Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Solid
from rlacd.solid.topology import NO_AREA, bodies_of, compacted, detach_slivers, marked

CELLS_ACROSS = 1.5
"""Least radius of a ball, in cells of its grid."""

# Points at which a triangle is tested for lying inside a body, as it may begin inside and lead out: near its corners,
# its edges, its middle.
_PROBES = np.array([(18, 1, 1), (1, 18, 1), (1, 1, 18), (9, 9, 2), (9, 2, 9), (2, 9, 9), (7, 7, 6)]) / 20


def _take_hull(state: State) -> None:
    """Take the convex hull of all points if there is nothing else."""
    if state.solid.volume() != 0:
        return
    state.warnings.append("The surface could not be closed, so the convex hull of its points is used instead.")
    state.note(np.arange(state.bodies), "hull")
    state.solid = hull_of_points(state.surface.vertices)
    state.parts = [Piece(state.solid, 0)]


def _keep_lost(state: State) -> None:
    """Add slabs of the faces that the solid leaves outside: a skin that crosses itself, or a wrap, loses some.

    So does closing cracks, of needles.
    """
    if state.solid.volume() == 0 or state.is_apart:
        return
    lost, own = measure(state), state.surface
    body, is_gone = state.body_of_input[lost], state.is_gone[lost]
    walls, needles = own.faces[lost[~is_gone]], np.unique(body[is_gone]).tolist()
    soup = Soup(own.vertices, walls, body[~is_gone]).in_patches()
    patches = bodies_of(soup.faces, soup.edges)[0] if len(walls) else 0
    if not 0 < patches + len(needles) <= MOST_PATCHES:  # a plant's leaves would take too many cuts
        return
    try:
        slabs = skins(soup)
        slabs += [Piece(slab_of_faces(own.vertices, own.faces[lost[body == one]]), one, True) for one in needles]
        state.solid = unite([state.solid, *(slab.shape for slab in slabs)], keep_cavities=state.wanted.keep_cavities)
    except CrossingsError:  # they stay lost
        return
    state.parts += slabs
    state.lost[body] = HALF_THICKNESS


STEPS: tuple[Callable[[State], None], ...] = (
    close_holes,
    build_walls,
    State.unite_parts,
    rebuild_tangles,
    fill_voids,
    fill_slits,
)
"""The steps of a repair, in their order: each changes nothing where it is not needed."""


def repair(
    mesh: InputMesh,
    *,
    resolution: int = 100,
    open_bodies: str = "auto",
    gap: float = DEFAULT_GAP,
    threads: int | None = None,
    keep_cavities: bool = False,
) -> Solid:
    """Turn a mesh into one closed, oriented solid.

    Parameters
    ----------
    mesh
        The loaded mesh.
    resolution
        Cells along the longest side of the grid on which voids are searched.
    open_bodies
        ``auto``: a body with openings is solid if nothing can get inside, or if the openings look like damage; else it
        is a shell as thin as its faces. ``small``: a body is solid too if each opening covers little of it. ``solid``:
        every body is filled that has an inside once its openings are closed. ``thin``: open bodies stay shells.
    gap
        Radius of a ball, where the longest side is 2: what it cannot get through is closed. Small balls roll on a finer
        grid than `resolution` asks for.
    threads
        Number of threads that measure distances; all cores by default. The result does not depend on it.
    keep_cavities
        Keep closed cavities empty: those that a union encloses, and closed bodies wound against the body around them.
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
        The run ended before the repair; `rlacd.solid.cover` takes next to no time.
    """
    poll_stop()
    points, corners = compacted(mesh.vertices, mesh.faces)
    if len(points) == 0:
        raise EmptyMeshError("the mesh has no points, so there is nothing to decompose: check the file or its export")
    frame = Frame.of(points, mesh.unit)
    cells = max(resolution, math.ceil(2 * CELLS_ACROSS / gap)) if gap < DEFAULT_GAP else resolution
    wanted = Wanted(open_bodies, gap, cells, keep_cavities)
    solid = _repaired(mesh, (frame.to_frame(points), corners), frame, wanted, threads)
    vertices, faces = solid.surface
    is_left = np.full(len(vertices), len(faces) > 0) & ~marked(faces, len(vertices))
    return replace(solid, left_out=np.concatenate([vertices[is_left], frame.to_frame(mesh.specks)]))


def _repaired(
    mesh: InputMesh, soup: tuple[FloatArray, Int64Array], frame: Frame, wanted: Wanted, threads: int | None
) -> Solid:
    """Repair the vertices and faces of a mesh in its frame."""
    points, corners = soup
    welded_vertices, welded_faces, is_sliver = _native.weld(points, corners)
    taken = one_body(welded_vertices, welded_faces)
    if taken is not None and not (len(corners) <= DENSE and is_tangle(query_of(taken[0], threads))):
        shape, was_inward = taken
        row = BodyRepair(0, "reoriented" if was_inward else "closed", len(welded_faces), len(welded_faces), 0.0)
        return Solid(shape, (welded_vertices, welded_faces), frame, (row,), mesh.warnings, is_as_given=True)
    require_memory(len(welded_faces), BYTES_REPAIRED, mesh.name)
    vertices, faces = detach_slivers(welded_vertices, welded_faces.astype(np.int64), is_sliver)
    detached = np.asarray(faces[:, 0] >= len(welded_vertices))
    faces = faces[~_is_inside(vertices, faces, detached, threads)]
    surface = (vertices, faces.astype(np.int32))
    if len(faces) == 0 or face_areas(vertices, faces).max() < NO_AREA:
        what = "edges" if len(mesh.specks) else "points"
        said = f"No face has an area, so the convex hull of all {what} is used instead."
        solid = hull_of_points(points)
        body = BodyRepair(0, "hull", len(mesh.faces), solid.num_tri(), 0.0)
        return Solid(solid, surface, frame, (body,), (*mesh.warnings, said))
    state = State(SurfaceQuery(vertices, faces, threads), frame, wanted)
    try:
        for step in STEPS:
            poll_stop()
            step(state)
    except CrossingsError:
        wrap_all(state)
    _keep_lost(state)
    _take_hull(state)
    return state.result(mesh.warnings)


def _is_inside(vertices: FloatArray, faces: Int64Array, sliver: BoolArray, threads: int | None) -> BoolArray:
    """Return ``[F]`` which slivers lie inside the other faces: where two bodies touch."""
    inside = sliver.copy()
    if sliver.any():
        corners = vertices[faces[sliver]][:, None]
        points = sum(_PROBES[:, k, None] * corners[:, :, k] for k in range(3))
        winding = SurfaceQuery(vertices, faces[~sliver], threads).winding(np.reshape(points, (-1, 3)))
        inside[sliver] = (np.abs(winding).reshape(-1, len(_PROBES)) > 0.75).all(axis=1)
    return inside
