"""MuJoCo: hulls for a body of an MjSpec."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rlacd.decomposition import Decomposition
from rlacd.engines.hulls import hulls_of

__all__ = ["add_hulls"]


def add_hulls(
    spec: Any, body: Any, mesh: Any, *, settings: Mapping[str, Any] | None = None, **options: Any
) -> Decomposition:
    """Let a body collide as the convex hulls of a mesh.

    Parameters
    ----------
    spec : mujoco.MjSpec
    body : mujoco.MjsBody
        One of its bodies. Its mass is not changed, since hulls weigh nothing: ``report.mass`` of the result has what
        the mesh weighs at density one.
    mesh : Decomposition, or what `rlacd.decompose` takes
        In the frame of the body, in metres.
    settings : mapping, optional
        Attributes of each hull's geom, such as ``{"friction": [1, 0.005, 0.0001]}``; by default group 3 and mass 0.
    **options
        Those of `rlacd.decompose`.

    Returns
    -------
    Decomposition

    Raises
    ------
    RlacdError
        As `rlacd.decompose`.
    """
    import mujoco

    result, hulls = hulls_of(mesh, options)
    for index, (hull, shift) in enumerate(hulls):
        name = f"{body.name or result.name}_hull_{index:03d}"
        while spec.mesh(name) is not None or spec.geom(name) is not None:
            name += "_"
        spec.add_mesh(name=name, uservert=hull.vertices.ravel().tolist(), userface=hull.faces.ravel().tolist())
        geom = {"name": name, "group": 3, "mass": 0.0, "pos": shift, **(settings or {})}
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **geom)
    return result
