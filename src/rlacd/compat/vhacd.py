"""The interface of vhacdx 0.1.1, the V-HACD that trimesh uses, decomposed by rlacd.

``from vhacdx import compute_vhacd`` becomes ``from rlacd.compat.vhacd import compute_vhacd``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rlacd.compat import warn_unused
from rlacd.decompose_mesh import decompose
from rlacd.errors import MeshDataError
from rlacd.options.fields import flag, integer, number, read

__all__ = ["compute_vhacd"]

_UNUSED = {
    **dict.fromkeys(("resolution", "minEdgeLength"), "it uses no voxels"),
    "maxRecursionDepth": "it cuts until every part is tight",
    "shrinkWrap": "its hulls lie on the mesh anyway",
    "fillMode": "it repairs meshes that are not closed",
    "findBestPlane": "it always searches for the best plane",
}


def compute_vhacd(
    points: npt.ArrayLike,
    faces: npt.ArrayLike,
    maxConvexHulls: int = 64,
    resolution: int = 400000,
    minimumVolumePercentErrorAllowed: float = 1.0,
    maxRecursionDepth: int = 10,
    shrinkWrap: bool = True,
    fillMode: str = "flood",
    maxNumVerticesPerCH: int = 64,
    asyncACD: bool = True,
    minEdgeLength: int = 2,
    findBestPlane: bool = False,
) -> list[tuple[npt.NDArray[np.float64], npt.NDArray[np.uint32]]]:
    """Decompose a mesh as ``vhacdx.compute_vhacd`` does: same arguments, same defaults, same kind of result.

    Parameters
    ----------
    points : array-like [V, 3]
        Vertices.
    faces : array-like [F, 3] or flat
        Triangles; or one row: ``3, a, b, c, 3, ...`` as vhacdx takes them, or ``a, b, c, a, ...`` as its README says.
    maxConvexHulls : int
        Maximum number of hulls.
    maxNumVerticesPerCH : int
        Maximum number of vertices per hull.
    minimumVolumePercentErrorAllowed : float
        The share of its part's volume that a hull may add, in per cent; exceeded only if `maxConvexHulls` demands it.
    asyncACD : bool
        Whether to use all processors; the result is the same either way.
    resolution, maxRecursionDepth, shrinkWrap, fillMode, minEdgeLength, findBestPlane
        Accepted but unused; a warning explains this once.

    Returns
    -------
    list of (points, faces)
        float64 ``[V, 3]`` and uint32 ``[F, 3]`` of each hull.

    Raises
    ------
    MeshError
        There is nothing to decompose, or the flat faces are not triangles.
    OptionError
        An option is out of range.
    """
    warn_unused(compute_vhacd, locals(), _UNUSED)
    percent = read(number(0), "minimumVolumePercentErrorAllowed", minimumVolumePercentErrorAllowed)
    result = decompose(
        (np.asarray(points, dtype=np.float64), _triangles(faces)),
        criterion="volume",
        volume_tolerance=min(max(percent / 100, 1e-4), 10.0),
        max_hulls=read(integer(1), "maxConvexHulls", maxConvexHulls),
        max_vertices=read(integer(4), "maxNumVerticesPerCH", maxNumVerticesPerCH),
        threads=None if read(flag(), "asyncACD", asyncACD) else 1,
    )
    return [(np.array(hull.vertices, dtype=np.float64), np.array(hull.faces, dtype=np.uint32)) for hull in result]


def _triangles(faces: Any) -> npt.NDArray[np.int64]:
    array = np.asarray(faces)
    if array.ndim == 1 and len(array) % 4 == 0 and (array[::4] == 3).all():
        array = array.reshape(-1, 4)[:, 1:]
    if array.ndim == 1 and len(array) % 3:
        raise MeshDataError(
            "flat faces are neither 3, a, b, c, 3, ... nor a, b, c, a, ...: triangulate polygons first."
        )
    return (array if array.ndim > 1 else array.reshape(-1, 3)).astype(np.int64)
