"""A robot as the page shows it: what each link is, how joints move it, and where links touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import trimesh

from rlacd.clear import Joint
from rlacd.result import Result
from rlacd.solid.frame import Frame


class Contact(NamedTuple):
    """Two links whose hulls touch, by their numbers, and how, in words."""

    first: int
    second: int
    how: str


class Place(NamedTuple):
    """Positions of the joints that were looked at, and the links that touch there; `said` of whom it tells."""

    said: str
    values: list[float]
    contacts: list[Contact]


@dataclass(frozen=True, eq=False, repr=False)
class RobotResult(Result):
    """A robot at rest as hulls."""

    links: Sequence[str] = ()
    meshes: Sequence[trimesh.Trimesh] = ()
    """What collides of each, at rest."""
    link_of: Sequence[int] = ()
    """The link of each hull."""
    kept: Sequence[Sequence[trimesh.Trimesh]] = ()
    """The primitives of each link, which stay, at rest."""
    joints: Sequence[Joint] = ()
    """First those that can be set, `free` of them."""
    free: int = 0
    carried: Sequence[int] = ()
    """For each link, the joint that carries it; -1 if none does."""
    places: Sequence[Place] = ()
    """The first is at rest; empty if links were not looked at."""
    samples: int = 0
    """Joint positions that were looked at, of which these are the worst for each pair of links."""
    touching: Callable[[list[float]], list[Contact]] | None = None
    """Takes positions of the free joints and returns the links that touch there."""


def robot_scene(robot: RobotResult, frame: Frame) -> dict[str, Any]:
    """Describe for the page how a robot moves; see `rlacd.viewer.scene.scene`."""
    joints = [
        {
            **{name: getattr(joint, name) for name in ("name", "slides", "lower", "upper", "rest", "parent", "leader")},
            "curve": [*joint.curve],
            "axis": joint.axis.tolist(),
            "anchor": frame.to_frame(np.atleast_2d(joint.anchor))[0].tolist(),
        }
        for joint in robot.joints
    ]
    links = [{"name": name, "joint": joint} for name, joint in zip(robot.links, robot.carried, strict=True)]
    places = [place._asdict() for place in robot.places]
    return {"links": links, "joints": joints, "free": robot.free, "places": places, "samples": robot.samples}
