"""The steps from a soup of triangles to a solid, for what is not one closed body as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rlacd._native import face_areas, poll_stop
from rlacd.repair.distance import SurfaceQuery
from rlacd.repair.holes import close_holes
from rlacd.repair.soup import MOST_PATCHES, Soup
from rlacd.repair.state import Piece, State, measure
from rlacd.repair.union import CrossingsError, hull_of_points, slab_of_faces, unite
from rlacd.repair.walls import build_walls, skins
from rlacd.repair.wanted import Wanted
from rlacd.repair.wraps import fill_slits, fill_voids, rebuild_tangles, wrap_all
from rlacd.report import BodyRepair
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array, IntArray
from rlacd.solid.frame import HALF_THICKNESS, Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Solid
from rlacd.solid.topology import NO_AREA, bodies_of, detach_slivers

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


def mended(
    mesh: InputMesh,
    points: FloatArray,
    welded: tuple[FloatArray, IntArray, BoolArray],
    frame: Frame,
    wanted: Wanted,
    threads: int | None,
) -> Solid:
    """Make a solid of a mesh in its frame: its points ``[N, 3]``; vertices, faces, and which are slivers, welded."""
    welded_vertices, welded_faces, is_sliver = welded
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
