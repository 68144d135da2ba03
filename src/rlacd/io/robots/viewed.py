"""What the viewer opens: meshes, and robots as `rlacd.rewrite_robot` decomposes them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rlacd.decompose_mesh import decompose
from rlacd.errors import MeshFileError
from rlacd.io.robots import usd
from rlacd.io.robots.bodies import placed
from rlacd.io.robots.clearance import decomposed_robot
from rlacd.io.robots.decomposed import check_options
from rlacd.io.robots.read import is_robot, read_robot
from rlacd.io.robots.rewritten import warnings_of
from rlacd.io.robots.shown import mesh_of, shown
from rlacd.options.robots import RobotOptions
from rlacd.result import Result
from rlacd.view.controls import Subject, read_subject

USUAL = {"criterion": "distance", "threshold": 0.03}
"""First values of the page's controls for a robot: those of `rlacd.rewrite_robot`."""


def moves(path: Path) -> bool:
    """Whether a file is shown as a robot: URDF, MJCF, or a USD stage whose meshes collide."""
    return is_robot(path) or usd.colliders_of(path) is not None


def read_viewed(path: Path, up: str | None = None, package_dirs: Sequence[str] = ()) -> Subject:
    """Read what is to be shown; a robot at rest.

    Raises
    ------
    MeshError
        It cannot be read, or no link has a collision mesh.
    """
    if not moves(path):
        return read_subject(path, up)
    robot, said = read_robot(path, package_dirs)
    if not robot.bodies:
        raise MeshFileError(f"{path} has no collision mesh, so there is nothing to show.")
    mesh = mesh_of(robot, placed(robot.bodies, [body.pose for body in robot.bodies]), said)
    return Subject(path, path.stem, up or robot.up, mesh.unit, mesh, is_robot=True)


def decompose_viewed(mesh: Path, *, package_dirs: Sequence[str] = (), **options: Any) -> Result:
    """Decompose what is shown, as `rlacd.decompose` or `rlacd.rewrite_robot` do."""
    if not moves(mesh):
        return decompose(mesh, **options)
    began = time.perf_counter()
    check_options(options)
    robot, said = read_robot(mesh, package_dirs)
    done = decomposed_robot(robot, options, RobotOptions())
    return shown(robot, done, [*said, *warnings_of(done.results), *done.warnings], time.perf_counter() - began)
