"""Drake: hulls for a body of a MultibodyPlant, in its SceneGraph."""

from __future__ import annotations

from typing import Any, cast

from rlacd.decomposition import Decomposition
from rlacd.engines.hulls import hulls_of

__all__ = ["add_hulls"]


def add_hulls(plant: Any, body: Any, mesh: Any, *, settings: Any = None, **options: Any) -> Decomposition:
    """Let a body collide as the convex hulls of a mesh.

    Parameters
    ----------
    plant : pydrake.multibody.plant.MultibodyPlant
        Registered with a SceneGraph, not yet finalized.
    body : pydrake.multibody.tree.RigidBody
        One of its bodies. Its mass is not changed, since hulls weigh nothing: ``report.mass`` of the result has what
        the mesh weighs at density one.
    mesh : Decomposition, or what `rlacd.decompose` takes
        In the frame of the body, in metres.
    settings : pydrake.geometry.ProximityProperties or pydrake.multibody.plant.CoulombFriction, optional
        Of each hull; by default a friction of 1.
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
    from pydrake.geometry import Convex
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import CoulombFriction

    result, hulls = hulls_of(mesh, options)
    taken = len(plant.GetCollisionGeometriesForBody(body))
    for number, (hull, shift) in enumerate(hulls, taken):
        name, points = f"hull_{number:03d}", cast(Any, hull.vertices.T)
        shape = Convex(points, name)
        how = CoulombFriction(1.0, 1.0) if settings is None else settings
        plant.RegisterCollisionGeometry(body, RigidTransform(shift), shape, name, how)
    return result
