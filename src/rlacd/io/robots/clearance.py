"""Links that do not touch in the input do not touch as hulls: checked at joint positions, and mended."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rlacd.clear import Body as Moving
from rlacd.clear import (
    Cleared,
    CrowdedError,
    LinkPair,
    Motion,
    at_rest,
    kept_clear,
    link_pairs,
    mjcf_motion,
    urdf_motion,
    warnings_of,
)
from rlacd.decomposition import Decomposition
from rlacd.errors import MissingExtraError
from rlacd.io.robots.bodies import Body, Collider
from rlacd.io.robots.decomposed import decompose_bodies, decomposed, options_of_bodies
from rlacd.options.output import Axis
from rlacd.options.robots import RobotOptions
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.poses import inverse, moved

MOST_SAID = 5
"""Pairs that touch, each with a warning of its own."""


@dataclass(frozen=True)
class Robot:
    """A robot file that has been read.

    Attributes
    ----------
    source : Path
    bodies : list of Body
    motion : callable
        Takes what is asked and a seed; returns where the bodies can be, and what to say of it.
    metres : float
        Its unit of length.
    up : {"x", "y", "z"}
        The axis that points up.
    """

    source: Path
    bodies: list[Body]
    motion: Callable[[RobotOptions, int], tuple[Motion, list[str]]]
    metres: float = 1.0
    up: Axis = "z"

    def in_mm(self, length: float) -> str:
        """A length in words."""
        return f"{1000 * self.metres * length:.3g} mm"


@dataclass(frozen=True)
class Checked:
    """The hulls of links, checked against each other.

    Attributes
    ----------
    results : dict of Collider to Decomposition
        Finer where links would touch.
    motion : Motion, optional
        Where the links were looked at; None if they were not.
    cleared : Cleared, optional
        What they do there.
    warnings : list of str
    """

    results: dict[Collider, Decomposition]
    motion: Motion | None = None
    cleared: Cleared | None = None
    warnings: list[str] = field(default_factory=list)

    @property
    def pairs(self) -> list[LinkPair]:
        """What each two links do; empty if nothing was checked."""
        return [] if self.cleared is None or self.motion is None else link_pairs(self.cleared, self.motion)

    @property
    def samples(self) -> int:
        """Joint positions looked at, with that at rest."""
        return 0 if self.cleared is None or self.motion is None else len(self.motion.poses)


def decomposed_robot(robot: Robot, options: Mapping[str, Any], asked: RobotOptions) -> Checked:
    """Decompose all links, check their hulls against each other, and decompose again what touches though it did not."""
    results = decompose_bodies(robot.bodies, options, asked)
    if len(robot.bodies) < 2:
        return Checked(results)
    if not all(result.report["complete"] for result in results.values()):
        return Checked(results, warnings=["Links were not checked against each other: the work was stopped before."])
    bodies, moves = robot.bodies, None
    try:
        moves, said = robot.motion(asked, options.get("seed") or 0)
        each = options_of_bodies(bodies, options, asked)

        def redo(number: int, obstacles: Sequence[Obstacle]) -> list[tuple[Any, Any]]:
            results.update(_clear_of(obstacles, bodies[number], results, each[number]))
            return _moving(bodies[number], results).hulls

        cleared = kept_clear([_moving(body, results) for body in bodies], moves, redo)
    except (MissingExtraError, CrowdedError) as error:
        if asked.exclude or asked.srdf:
            raise
        return Checked(results, moves, warnings=[f"Links were not checked against each other: {error}"])
    found = warnings_of(cleared, moves, robot.in_mm)
    more = [f"{len(found) - MOST_SAID} more pairs of links touch: see the report."] if len(found) > MOST_SAID else []
    ranges = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in moves.warnings]
    warnings = [*said, *ranges, *found[:MOST_SAID], *more]
    return Checked(results, moves, cleared, warnings)


def motion_of(
    kind: str, path: Path, bodies: Sequence[Body], asked: RobotOptions, seed: int
) -> tuple[Motion, list[str]]:
    """Where the bodies of a URDF or MJCF file can be."""
    names = [body.name for body in bodies]
    try:
        found = (urdf_motion if kind == "urdf" else mjcf_motion)(path, asked.samples, seed)
        return found.some(names), []
    except MissingExtraError:
        raise
    except Exception as error:  # MuJoCo reads fewer meshes than we do; a URDF may say anything
        reader, why = "yourdfpy" if kind == "urdf" else "MuJoCo", " ".join(str(error).split())[:80]
        said = f"{reader} cannot place the links of {path.name} ({why})"
        return resting(bodies), [f"Links were checked against each other at rest only: {said}."]


def resting(bodies: Sequence[Body], fixed: Collection[str] = ()) -> Motion:
    """Bodies where they stand."""
    rest = at_rest([body.name for body in bodies], fixed)
    rest.poses[0] = [body.pose for body in bodies]
    return rest


def _moving(body: Body, results: Mapping[Collider, Decomposition]) -> Moving:
    mesh = body.mesh()
    hulls = [(np.asarray(hull.vertices), np.asarray(hull.faces, np.int32)) for hull in body.hulls(results)]
    return Moving(body.name, (np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)), hulls)


def _clear_of(
    obstacles: Sequence[Obstacle], body: Body, results: Mapping[Collider, Decomposition], options: Mapping[str, Any]
) -> dict[Collider, Decomposition]:
    """Decompose the colliders of a body again that come near obstacles."""
    again = {}
    for collider in body.colliders:
        back = inverse(collider.meshes[0].to_body)
        placed = [Obstacle(o.name, moved(back, o.vertices), o.faces, o.margin, is_told=False) for o in obstacles]
        near = [obstacle for obstacle in placed if _is_near(obstacle, results[collider])]
        if near:
            again[collider] = decomposed(body, collider, {**options, "avoid": near})
    return again


def _is_near(obstacle: Obstacle, result: Decomposition) -> bool:
    if not len(obstacle.vertices):
        return False
    lower, upper = obstacle.vertices.min(axis=0) - obstacle.margin, obstacle.vertices.max(axis=0) + obstacle.margin
    boxes = [hull.bounds for hull in result.hulls]
    return any(bool((box[0] <= upper).all() and (box[1] >= lower).all()) for box in boxes)
