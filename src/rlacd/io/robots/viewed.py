"""What the viewer and the report show of robots: at rest, with what moves them and the places where links touch."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any

import trimesh

from rlacd.clear import Cleared, Motion, Solids, at_rest, check
from rlacd.decompose_mesh import decompose
from rlacd.errors import MeshFileError
from rlacd.extras.nodes.joint_report import joint_report
from rlacd.io.robots.decomposed import SMALL, Checked, check_options, decomposed_robot
from rlacd.io.robots.read import robot_or_none
from rlacd.io.robots.rewritten import warnings_of
from rlacd.io.robots.robot import Body, Robot, turned
from rlacd.options.robots import RobotOptions
from rlacd.result import Result
from rlacd.solid.input_mesh import InputMesh
from rlacd.viewer.controls import Subject, read_subject
from rlacd.viewer.robot import Contact, Place, RobotResult

USUAL = {"criterion": "distance", "threshold": 0.03, "openings": SMALL}
"""First values of the page's controls for a robot: those of `rlacd.rewrite_robot`."""

MOST_PLACES = 40
"""Pairs of links whose worst joint positions are shown."""

_ONE = Lock()  # of readers, since they place the links of one model


def read_viewed(path: Path, up: str | None = None, package_dirs: Sequence[str] = ()) -> Subject:
    """Read what is to be shown; a robot at rest.

    Raises
    ------
    MeshError
        It cannot be read, or no link has a collision mesh.
    """
    robot = robot_or_none(path, package_dirs)
    if robot is None:
        return read_subject(path, up)
    if not robot.replaced:
        raise MeshFileError(f"{path} has no collision mesh, so there is nothing to show.")
    mesh = _whole(robot, robot.shapes(), robot.warnings)
    return Subject(path, path.stem, up or robot.up, mesh, is_robot=True)


def decompose_viewed(mesh: Path, *, package_dirs: Sequence[str] = (), **options: Any) -> Result:
    """Decompose what is shown, as `rlacd.decompose` or `rlacd.rewrite_robot` do."""
    began, robot = time.perf_counter(), robot_or_none(mesh, package_dirs)
    if robot is None:
        return decompose(mesh, **options)
    check_options(options)
    done = decomposed_robot(robot, options, RobotOptions(), {})
    said = [*robot.warnings, *warnings_of(robot, done.results), *done.warnings]
    return shown(robot, done, said, time.perf_counter() - began)


def shown(robot: Robot, done: Checked, warnings: Sequence[str], seconds: float) -> RobotResult:
    """Show a robot with at least one link that has hulls."""
    names = [body.name for body in robot.bodies]
    motion = done.motion or at_rest(names, (), [body.pose for body in robot.bodies])
    solids = motion.solids or [Solids(body.primitives) for body in robot.bodies]
    kept = [
        [turned(pose, one.outside) for one in own.primitives] for own, pose in zip(solids, motion.poses[0], strict=True)
    ]
    hulls, meshes, link_of = list[trimesh.Trimesh](), list[trimesh.Trimesh](), list[int]()
    for number, pose in enumerate(motion.poses[0]):
        body = robot.bodies[number] if number < len(names) else Body(motion.links[number], pose, ())
        own = [turned(pose, hull) for hull in body.hulls(done.results)]
        hulls += own
        link_of += [number] * len(own)
        meshes.append(trimesh.util.concatenate([turned(pose, body.mesh()), *kept[number]]))
    each = [(body.name, done.results[collider].report) for body in robot.bodies for collider in body.colliders]
    report = joint_report(each, 2.0 / robot.size if robot.size > 0 else 1.0)
    options = dict(report.options)
    if (length := options.get("threshold_abs")) is not None:
        options["threshold"] = length * report.scale
    named = replace(report, name=robot.source.stem, up=robot.up, metres=robot.metres, warnings=tuple(warnings))
    report = replace(named, options=options, seconds={"total": seconds})
    touching = None if done.cleared is None else partial(_contacts, robot, done.cleared, motion)
    moves = (
        motion.joints,
        len(motion.sampled),
        motion.carried,
        _places(robot, done, motion),
        done.samples,
        touching,
    )
    whole = _whole(robot, meshes, warnings)
    source = trimesh.Trimesh(whole.vertices, whole.faces, process=False)
    return RobotResult(hulls, report, source, None, whole, [*motion.links], meshes, link_of, kept, *moves)


def _whole(robot: Robot, links: Sequence[trimesh.Trimesh], warnings: Sequence[str]) -> InputMesh:
    """What collides of all links as one."""
    whole = trimesh.util.concatenate(links)
    return InputMesh(whole.vertices, whole.faces, robot.source.name, (*warnings,), robot.up, robot.metres)


def _contacts(robot: Robot, cleared: Cleared, motion: Motion, values: list[float]) -> list[Contact]:
    """The links that touch at joint positions: all, but those that a joint connects and whose meshes touch."""
    with _ONE:
        found = check(cleared.bodies, motion.at(values))
    order = sorted(found, key=lambda pair: (-found[pair].depth, pair))
    told = [pair for pair in order if found[pair].depth or pair not in motion.adjacent]
    return [Contact(*pair, _deep(robot, found[pair].depth)) for pair in told]


def _deep(robot: Robot, depth: float) -> str:
    return f"{robot.unit.words(depth)} deep, though in the input they do not" if depth else "as in the input"


def _places(robot: Robot, done: Checked, motion: Motion) -> list[Place]:
    """At rest, and where each pair of links that touch does so worst: the deepest first."""
    if done.cleared is None:
        return []
    worst = []
    for pair, what in done.cleared.touching.items():
        sample = what.offences[0].sample if what.offences else int(what.hulls.argmax())
        if what.depth or pair not in motion.adjacent:
            first, second = (motion.links[i] for i in pair)
            share = f"at {100 * what.hulls.mean():.3g}% of the positions"
            said = f"{first} and {second}: {share}, here {_deep(robot, what.depth)}"
            worst.append((-what.depth, said, motion.positions[sample].tolist()))
    rest = motion.positions[0].tolist()
    chosen = [("At rest", rest), *((said, values) for _, said, values in sorted(worst)[:MOST_PLACES])]
    return [Place(said, values, _contacts(robot, done.cleared, motion, values)) for said, values in chosen]
