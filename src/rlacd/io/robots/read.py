"""Reading robots of all formats: their bodies, and where these can be."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

from rlacd.errors import MeshFileError
from rlacd.io.read.load import load_mesh
from rlacd.io.read.open_file import read_named
from rlacd.io.robots import usd
from rlacd.io.robots.bodies import Collider, Surface
from rlacd.io.robots.clearance import Robot, motion_of, resting
from rlacd.io.robots.mjcf import plan_mjcf
from rlacd.io.robots.mjcf_model import read_model
from rlacd.io.robots.plan import Plan, Sources
from rlacd.io.robots.references import References
from rlacd.io.robots.rewritten import grouped
from rlacd.io.robots.spans import LARGEST_DESCRIPTION, Element, parse
from rlacd.io.robots.urdf import plan_urdf

ENDINGS = {".urdf": "urdf", ".xml": "mjcf"}
ROOTS = {"urdf": "robot", "mjcf": "mujoco"}


def is_robot(path: str | os.PathLike[str]) -> bool:
    """Tell by its ending whether a file describes a robot."""
    return Path(path).suffix.lower() in ENDINGS


def read_robot(source: Path, package_dirs: Sequence[str] = ()) -> tuple[Robot, list[str]]:
    """Read a robot of any format, and what to say of it; raises as `rlacd.rewrite_robot`."""
    if source.suffix.lower() in usd.ENDINGS:
        stage = usd.read_colliders(source)
        return robot_of_stage(stage, apart=False)[0], stage.warnings
    root = opened(source, kind := kind_of(source))
    plan, said = planned(root, kind, References(source, package_dirs), source, source.parent, apart=False)
    return robot_of_file(kind, source, plan), said


def robot_of_file(kind: str, source: Path, plan: Plan) -> Robot:
    """The robot of a URDF or MJCF file."""
    return Robot(source, plan.bodies, partial(motion_of, kind, source, plan.bodies))


def robot_of_stage(stage: usd.Colliders, *, apart: bool) -> tuple[Robot, dict[Collider, list[int]]]:
    """The robot of a USD stage, which is looked at as it stands; and the places of its colliders' meshes."""
    bodies, prims = usd.bodies_of(stage, apart=apart)
    fixed = {node["path"] for node in stage.nodes if not node["body"]}
    return Robot(stage.source, bodies, lambda *_: (resting(bodies, fixed), []), stage.metres, stage.up), prims


def kind_of(source: Path) -> str:
    """The kind of a robot file, by its ending; raises MeshFileError if it is none."""
    if not is_robot(source):
        raise MeshFileError(f"{source} is not a robot file: its name has to end in {' or '.join(ENDINGS)}.")
    return ENDINGS[source.suffix.lower()]


def opened(source: Path, kind: str) -> Element:
    """The root of a robot file.

    Raises
    ------
    MeshFileError
        It cannot be read, or is of another kind.
    """
    root = parse(source, read_named(source, LARGEST_DESCRIPTION))
    if root.tag != ROOTS[kind]:
        raise MeshFileError(f"{source} is not {kind.upper()}: it starts with <{root.tag}>, not <{ROOTS[kind]}>.")
    return root


def planned(
    root: Element, kind: str, references: References, place: Path, folder: Path, *, apart: bool
) -> tuple[Plan, list[str]]:
    """Find the meshes to replace, for a result at `place` with its hulls in `folder`; and warnings."""
    source, said = root.file.folder, list[tuple[str, str, float]]()
    load = cache(lambda path: _surface(path, said))
    if kind == "urdf":
        sources = Sources(references, load, lambda old, hull: _reference(old, hull, references, folder), apart)
        plan = plan_urdf(root, sources)
    else:
        compiler = read_model(root, references, lambda path: read_named(path, LARGEST_DESCRIPTION))
        within = os.path.relpath(source / compiler.mesh_folder, source)  # the same from the new file
        target = os.path.relpath(folder.absolute(), Path(os.path.abspath(place.absolute().parent / within)))
        plan = plan_mjcf(compiler, Sources(references, load, lambda _, hull: (Path(target) / hull).as_posix(), apart))
    return plan, [*plan.warnings, *left_behind(plan.relative, source, place), *grouped(said)]


def _surface(path: Path, said: list[tuple[str, str, float]]) -> Surface:
    """Read a mesh file, in the unit that a COLLADA file states: ROS, Gazebo and Bullet apply it.

    Whether such a file whose y axis points up is turned differs between them, so that is a warning.
    """
    mesh = load_mesh(path)
    said += [(path.name, warning, 0.0) for warning in mesh.warnings]
    if path.suffix.lower() != ".dae":
        return Surface(path, mesh.vertices, mesh.faces)
    if mesh.up != "z":
        turned = f"{mesh.up.upper()}_UP is declared, and some programs rotate such a file when they read it"
        said.append((path.name, f"{turned}; hulls keep its coordinates.", 0.0))
    return Surface(path, mesh.vertices * (mesh.metres or 1.0), mesh.faces)


def _reference(old: str, hull: str, references: References, folder: Path) -> str:
    """Refer to a hull the way the mesh was: by its package if it lies in that package, else relative to the file."""
    package = references.package_of(old)
    target = Path(os.path.abspath(folder)) / hull
    if package is not None and target.is_relative_to(package):
        scheme, rest = old.split("://", 1)
        return f"{scheme}://{rest.split('/', 1)[0]}/{target.relative_to(package).as_posix()}"
    return f"{folder.name}/{hull}"


def left_behind(files: Sequence[str], source: Path, place: Path) -> list[str]:
    """Warn about other files that are named relative to a folder which the result does not lie in."""
    if not files or os.path.realpath(place.absolute().parent) == os.path.realpath(source):
        return []
    said = f"{len(files)} other files, such as {files[0]}, are referred to relative to {source}"
    lost = f"will not be found from {place.absolute().parent}: write the result beside the input, or copy them too"
    return [f"{said} and {lost}."]
