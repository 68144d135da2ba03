"""Decomposing the bodies of a robot: each solid once, with lengths relative to the robot."""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import trimesh

from rlacd.decompose_mesh import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshError, OptionError
from rlacd.io.robots.bodies import Body, Collider, size_of
from rlacd.options import LENGTHS, Options
from rlacd.options.fields import LONGEST_SIDE, shown
from rlacd.options.robots import RobotOptions
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.topology import used_points

SHARE = 0.015
"""The distance that hulls may have by default, as a share of the robot's longest side. 20 robots then have 3.9 hulls a
link (geometric mean), and MuJoCo takes twice as many steps a second as with each mesh at its own scale."""


def check_options(options: Mapping[str, Any]) -> None:
    """Check options before any work.

    Raises
    ------
    OptionError
        One is out of range, or not for robots.
    """
    for name in ("unit", "scale", "per_node"):
        if options.get(name):
            raise OptionError(f"{name} is for a single mesh; a robot file states it for each of its meshes.")
    if options.get("avoid"):
        raise OptionError("avoid is for a single mesh; the links of a robot stay clear of each other.")
    if (relative_to := options.get("relative_to")) not in (None, "scene", "mesh"):
        raise OptionError(
            f"relative_to is {shown(relative_to)}; for a robot it has to be 'scene', all of it, or 'mesh'."
        )
    Options.of({name: value for name, value in options.items() if name not in ("progress", "relative_to")})


def decompose_bodies(
    bodies: Sequence[Body], options: Mapping[str, Any], robot: RobotOptions
) -> dict[Collider, Decomposition]:
    """Decompose every collider, those that are the same solid once.

    Returns
    -------
    dict
        The hulls of each, in the frame of its first mesh's element.

    Raises
    ------
    MeshError
        A solid cannot be decomposed.
    OptionError
        An option is out of range, or a pattern of `links` matches none.
    """
    each = options_of_bodies(bodies, options, robot)
    done: dict[Hashable, Decomposition] = {}
    results = {}
    for body, own in zip(bodies, each, strict=True):
        for collider in body.colliders:
            key = collider.key, own.get("threshold_abs")
            if key not in done:
                done[key] = decomposed(body, collider, own)
            results[collider] = done[key]
    return results


def options_of_bodies(bodies: Sequence[Body], options: Mapping[str, Any], robot: RobotOptions) -> list[dict[str, Any]]:
    """The options of each body; raises as `decompose_bodies`."""
    whole, lengths = relative_to_robot(options, bodies), _lengths(bodies, robot.links or {})
    return [whole | ({"threshold_abs": lengths[body.name]} if body.name in lengths else {}) for body in bodies]


def relative_to_robot(options: Mapping[str, Any], bodies: Sequence[Body]) -> dict[str, Any]:
    """Options with lengths in the robot's unit, where they are shares of its longest side; by default a distance."""
    given = {name: value for name, value in options.items() if value is not None}
    if given.pop("relative_to", "scene") == "mesh" or not bodies:
        return given
    size = size_of(bodies)
    if given.setdefault("criterion", "distance") in ("distance", "concavity") and "threshold_abs" not in given:
        share = given.pop("threshold") / LONGEST_SIDE["threshold"] if "threshold" in given else None
        given["threshold_abs"] = float(f"{SHARE * size:.3g}") if share is None else share * size
    if given.get("overlap") and "overlap_abs" not in given:
        given["overlap_abs"] = given.pop("overlap") * size
    return given


def _lengths(bodies: Sequence[Body], links: Mapping[str, float]) -> dict[str, float]:
    """The distance of each body that has one of its own."""
    lengths: dict[str, float] = {}
    for pattern, length in links.items():
        matched = [body.name for body in bodies if re.fullmatch(pattern, body.name)]
        if not matched:
            known = ", ".join(body.name for body in bodies)
            raise OptionError(f"no link with a collision mesh matches the regular expression {pattern!r}: {known}.")
        lengths |= dict.fromkeys(matched, length)
    return lengths


def decomposed(body: Body, collider: Collider, options: Mapping[str, Any]) -> Decomposition:
    """Decompose one collider of a body, with lengths that are larger than it cut to it."""
    mesh, path = collider.mesh(), collider.meshes[0].surface.path
    try:
        return decompose((mesh.vertices, mesh.faces), **_fitting(mesh, options, body))
    except OptionError as error:
        raise OptionError(f"of {body.name}, {error}") from error
    except MeshError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def _fitting(mesh: trimesh.Trimesh, options: Mapping[str, Any], body: Body) -> dict[str, Any]:
    """The options with lengths that are too large for the mesh cut to it; too small ones only for the world's."""
    fitting = dict(options)
    scale = Frame.of(used_points(np.asarray(mesh.vertices), np.asarray(mesh.faces))).scale
    for name, (least, most) in LENGTHS.items():
        if isinstance(length := fitting.get(f"{name}_abs"), (int, float)):
            unit = LONGEST_SIDE[name] / 2 * scale
            length = max(length, least / unit * (1 + ROUNDING)) if body.is_world else length
            fitting[f"{name}_abs"] = min(length, most / unit * (1 - ROUNDING))
    return fitting
