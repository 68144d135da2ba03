"""From any soup of triangles to one closed, oriented solid, by the least change that works.

Input: an `InputMesh`. Output: a `Solid`, with the step that changed each body most. Equal vertices are merged,
degenerate and doubled faces dropped. One closed body stays as it is unless largely inside out. All else goes through
the steps of `steps.py`.

The watertight-manifold algorithm of Huang et al. (2018) could replace most of them, but it grows every sheet by a voxel
and turns a dozen exact faces into tens of thousands of approximate ones; these steps keep the faces of the input.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rlacd import _native
from rlacd._native import poll_stop
from rlacd.errors import EmptyMeshError
from rlacd.memory import BYTES_REPAIRED, require_memory
from rlacd.repair.distance import SurfaceQuery, is_tangle
from rlacd.repair.union import one_body, to_arrays
from rlacd.repair.wanted import DEFAULT_GAP, Wanted
from rlacd.report import BodyRepair
from rlacd.solid.arrays import FloatArray, Int64Array
from rlacd.solid.component import DENSE
from rlacd.solid.frame import Frame
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Solid
from rlacd.solid.topology import compacted, marked


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
    wanted = Wanted.of(resolution, open_bodies, gap, keep_cavities)
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
    if taken is not None and not (len(corners) <= DENSE and is_tangle(SurfaceQuery(*to_arrays(taken[0]), threads))):
        shape, was_inward = taken
        row = BodyRepair(0, "reoriented" if was_inward else "closed", len(welded_faces), len(welded_faces), 0.0)
        return Solid(shape, (welded_vertices, welded_faces), frame, (row,), mesh.warnings, is_as_given=True)
    require_memory(len(welded_faces), BYTES_REPAIRED, mesh.name)
    from rlacd.repair.steps import mended  # one closed body needs none of it

    return mended(mesh, points, (welded_vertices, welded_faces, is_sliver), frame, wanted, threads)
