"""Fallbacks: a hull for every body of an input that there was no time to repair, or for every face of sheets."""

from __future__ import annotations

import itertools

import numpy as np
from manifold3d import Manifold

from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray, heights, length
from rlacd.solid.component import DENSE, Component, Part
from rlacd.solid.frame import HALF_THICKNESS, Frame, thickened
from rlacd.solid.hull import TOLERANCE, Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.manifold import LATE, to_manifold
from rlacd.solid.solid import Solid, surface_of
from rlacd.solid.topology import compacted, marked, point_bodies

MOST_HULLS = 2000
"""If there are more bodies, neighbours in the columns of a grid share a hull."""

_CELLS = MOST_HULLS ** (1 / 3) / 2
"""Per unit of length of that grid."""

_DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def cover(mesh: InputMesh, run: Run) -> tuple[Solid, list[Part]]:
    """Return the hull of every body of an input, without repairing anything.

    Faces that share a corner, or have corners at the same place, form one body. The hull of a body holds all of its
    points. After `LATE` seconds the rest get looser hulls, as exact ones of half a million corners take seconds: boxes,
    and from `DENSE` points on the supporting planes in 26 directions, found in blocks of so many points.

    Parameters
    ----------
    mesh : InputMesh
        Has at least one point.
    run : Run
        Has stopped; it does not interrupt this.

    Returns
    -------
    solid : Solid
        An empty one: nothing was repaired.
    parts : list of Part
        Each is its own hull.
    """
    with run.shielded():
        used = compacted(mesh.vertices, mesh.faces)[0]
        frame = Frame.of(used, mesh.unit)
        vertices = frame.to_frame(mesh.vertices)
        faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
        bodies = _bodies(vertices, faces) if len(faces) else [frame.to_frame(used)]
    with run.hurried(LATE):
        hulls = [_hull(points, run) for points in bodies]
    warning = (
        f"There was no time to repair the mesh: the result is the convex hulls of its bodies as they are in the file "
        f"({len(hulls)}), and the mass is that of these hulls."
    )
    solid = Solid(
        Manifold(), (vertices, faces), frame, (), (*mesh.warnings, warning), left_out=frame.to_frame(mesh.specks)
    )
    return solid, [_part(hull) for hull in hulls]


def slabs(solid: Solid, run: Run) -> list[Part]:
    """A thin hull around every face of the surface of a solid."""
    vertices, faces = solid.surface
    return run.map(lambda face: _part(_hull(vertices[face], run)), list(faces))


def _part(hull: Hull) -> Part:
    """A part that is its own hull."""
    mesh = hull.vertices, hull.faces, hull.volume
    return Component.of((*mesh, *mesh))


def _bodies(vertices: FloatArray, faces: IntArray) -> list[FloatArray]:
    """The points [N, 3] of each body, or of several bodies near each other."""
    used = np.flatnonzero(marked(faces, len(vertices)))
    _, body, sizes = np.unique(point_bodies(vertices, faces)[used], return_inverse=True, return_counts=True)
    order, count = np.argsort(body, kind="stable"), len(sizes)
    vertices, first = vertices[used], np.cumsum(sizes) - sizes
    if count > MOST_HULLS:
        group = np.empty(count, dtype=np.int64)
        cells = np.floor(_CELLS * vertices[order[first]])
        group[np.lexsort(cells.T)] = np.arange(count) * MOST_HULLS // count
        order = order[np.argsort(group[body[order]], kind="stable")]
        first = np.searchsorted(group[body[order]], np.arange(MOST_HULLS))
    placed = vertices[order]
    return np.split(placed, first[1:])


def _hull(points: FloatArray, run: Run) -> Hull:
    exact = run.if_in_time(lambda: Hull.of(points), lambda: _touching(points) if len(points) > DENSE else _box(points))
    with run.shielded():
        return exact or Hull.of(thickened(points)) or _box(points)


def _touching(points: FloatArray) -> Hull:
    """The polytope of the supporting planes of points [N, 3] in `_DIRECTIONS`."""
    reach = np.full(len(_DIRECTIONS), -np.inf)
    for first in range(0, len(points), DENSE):
        np.maximum(reach, heights(points[first : first + DENSE], _DIRECTIONS).max(axis=0), out=reach)
    box = _box(points)
    body = to_manifold(box.vertices, box.faces)
    for direction, offset in zip(_DIRECTIONS, reach + 2 * TOLERANCE, strict=True):
        body = body.trim_by_plane(-direction, -offset / length(direction))
    return Hull.of(surface_of(body)[0]) or box


def _box(points: FloatArray) -> Hull:
    """The box around points [N, 3], at least as thick as a repaired sheet."""
    box = np.array([points.min(axis=0), points.max(axis=0)])
    is_thin = box[1] - box[0] < HALF_THICKNESS
    box += np.where(is_thin, HALF_THICKNESS, TOLERANCE) * np.array([[-1.0], [1.0]])
    hull = Hull.of(np.array(list(itertools.product(*box.T))))
    assert hull is not None, "a box with a thickness has a hull"
    return hull
