"""Newton: hulls for a body of a ModelBuilder."""

from __future__ import annotations

import copy
from typing import Any

from rlacd.decomposition import Decomposition
from rlacd.engines.hulls import hulls_of

__all__ = ["add_hulls"]


def add_hulls(builder: Any, body: int, mesh: Any, *, settings: Any = None, **options: Any) -> Decomposition:
    """Let a body collide as the convex hulls of a mesh.

    Parameters
    ----------
    builder : newton.ModelBuilder
        Not yet finalized.
    body : int
        One of its bodies, or -1 for the world. Its mass is not changed, since hulls weigh nothing: ``report.mass``
        of the result has what the mesh weighs at density one.
    mesh : Decomposition, or what `rlacd.decompose` takes
        In the frame of the body, in metres.
    settings : newton.ModelBuilder.ShapeConfig, optional
        Of each hull, without its density; by default the builder's.
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
    import newton
    import warp

    result, hulls = hulls_of(mesh, options)
    how = copy.copy(builder.default_shape_cfg if settings is None else settings)
    how.density = 0.0
    for hull, shift in hulls:
        count = len(hull.vertices)  # Newton keeps 64 unless told otherwise
        shape = newton.Mesh(hull.vertices, hull.faces.ravel(), compute_inertia=False, maxhullvert=count)
        builder.add_shape_convex_hull(body, xform=warp.transform(shift, warp.quat_identity()), mesh=shape, cfg=how)
    return result
