"""Reading robots of all formats."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rlacd.io.robots.document import Files
from rlacd.io.robots.mjcf import read_mjcf
from rlacd.io.robots.references import References
from rlacd.io.robots.rewritten import grouped
from rlacd.io.robots.robot import Robot
from rlacd.io.robots.urdf import read_urdf
from rlacd.io.robots.usd import read_stage

KINDS = {".urdf": "urdf", ".xml": "mjcf"}
STAGES = (".usd", ".usda", ".usdc")


def is_robot(path: str | os.PathLike[str]) -> bool:
    """Tell by its ending whether a file describes a robot; a stage may be one, see `robot_or_none`."""
    return Path(path).suffix.lower() in KINDS


def read_robot(
    source: Path, package_dirs: Sequence[str] = (), *, apart: bool = False, from_visual: bool = False
) -> Robot:
    """Read a URDF, MJCF or USD file, to be decomposed by its meshes or, not `apart`, by its links.

    With `from_visual`, links without collision geometry collide as what they show; not those of a stage.

    Raises
    ------
    MeshError
        The file or one of its meshes cannot be read, or is not allowed to be read.
    OptionError
        A package's folder does not exist.
    """
    ending = source.suffix.lower()
    if ending in STAGES:
        return read_stage(source, apart=apart)
    files = Files(References(source, package_dirs))
    robot = (read_urdf if ending == ".urdf" else read_mjcf)(source, files, apart=apart, from_visual=from_visual)
    meshes = [(mesh.file.path, body.name) for body in robot.bodies for one in body.colliders for mesh in one.meshes]
    links = {path: f"{name} ({path.name})" for path, name in reversed(meshes)}  # the first link of each
    robot.warnings.extend(grouped([(links.get(path, path.name), said, 0.0) for path, said in files.said]))
    return robot


def robot_or_none(path: Path, package_dirs: Sequence[str] = (), *, apart: bool = False) -> Robot | None:
    """Read a robot; None if it is none: another kind of file, or a stage without meshes that collide."""
    if not is_robot(path) and path.suffix.lower() not in STAGES:
        return None
    robot = read_robot(path, package_dirs, apart=apart)
    return robot if is_robot(path) or robot.bodies else None
