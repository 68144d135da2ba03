"""trimesh's convex decomposition, done by rlacd.

To make ``mesh.convex_decomposition()`` use rlacd throughout a program, replace its function once::

    import trimesh.decomposition
    from rlacd.compat.trimesh import convex_decomposition

    trimesh.decomposition.convex_decomposition = convex_decomposition
"""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import trimesh

from rlacd.compat.vhacd import compute_vhacd
from rlacd.decompose_mesh import decompose

__all__ = ["convex_decomposition"]


def convex_decomposition(mesh: trimesh.Trimesh, **kwargs: Any) -> list[dict[str, Any]]:
    """Decompose a mesh as ``trimesh.decomposition.convex_decomposition`` does.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Any mesh.
    **kwargs
        The options of `rlacd.decompose`; or those of V-HACD, as trimesh takes them, see
        `rlacd.compat.vhacd.compute_vhacd`.

    Returns
    -------
    list of dict
        ``vertices`` and ``faces`` of each hull: arguments for `trimesh.Trimesh`.

    Raises
    ------
    MeshError, OptionError
        As raised by those functions.
    """
    if kwargs.keys() & inspect.signature(compute_vhacd).parameters.keys():
        return [{"vertices": v, "faces": f} for v, f in compute_vhacd(mesh.vertices, mesh.faces, **kwargs)]
    return [{"vertices": np.array(hull.vertices), "faces": np.array(hull.faces)} for hull in decompose(mesh, **kwargs)]
