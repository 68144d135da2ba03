"""What every engine in Python does with a task: take the hulls of a file as convex shapes, and let bodies fall.

A program gets the task's file and that of its answer. A task lists bodies, ``{"file", "falls": [{"starts": [[x, y, z]],
"seconds"}]}``; z points up, and the floor is z = 0.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

STEP = 1 / 500  # s
GRAVITY = -9.81  # m/s²

Hulls = Sequence[dict[str, Any]]
Fall = Callable[[str, list[list[float]], int], list[dict[str, Any]]]


def run(title: str, package: str, take: Callable[[str], Hulls], fall: Fall | None) -> None:
    """Answer a task.

    Parameters
    ----------
    title, package
        The engine, and the package that brings it.
    take
        Takes the file; says of each hull how many vertices the engine kept and what volume they enclose, and of the
        first the mass of the body.
    fall
        Takes the file, where its copies start, and the steps; says the pose (x, y, z, and the quaternion x, y, z, w)
        and the velocities of each at the end. None where the engine does not simulate.
    """
    answers = []
    for body in json.loads(Path(sys.argv[1]).read_text()):
        falls = body["falls"] if fall else []
        ended = [fall(body["file"], each["starts"], round(each["seconds"] / STEP)) for each in falls]
        answers.append({"hulls": take(body["file"]), "falls": ended})
    said = {"engine": f"{title} ({package} {version(package)})", "bodies": answers}
    Path(sys.argv[2]).write_text(json.dumps(said, default=float))


def state(place: Any, turn: Any, velocity: Any, spin: Any) -> dict[str, Any]:
    """Where a body is and how it moves; `turn` is a quaternion x, y, z, w."""
    return {"pose": [*map(float, place), *map(float, turn)], "velocity": [*map(float, velocity), *map(float, spin)]}


def kept(points: Any, faces: Any, mass: float) -> dict[str, Any]:
    """What an engine has of a hull, a closed surface of triangles: how many corners and what volume."""
    corners = np.asarray(points, dtype=float)[np.asarray(faces).reshape(-1, 3)]
    volume = abs(float(np.linalg.det(corners - corners[0, 0]).sum())) / 6
    return {"vertices": len(points), "volume": volume, "mass": mass}
