"""Robots for the viewer and the report: at rest, with what moves them and the places where links touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Lock

import numpy as np
import trimesh

from rlacd.clear import Cleared, Known, Motion, check
from rlacd.finish.report import joint_report
from rlacd.io.robots.bodies import placed, size_of, turned
from rlacd.io.robots.clearance import Checked, Robot, resting
from rlacd.solid.input_mesh import InputMesh
from rlacd.view.robot import Contact, Place, RobotResult

MOST_PLACES = 40
"""Pairs of links whose worst joint positions are shown."""


def shown(robot: Robot, done: Checked, warnings: Sequence[str], seconds: float) -> RobotResult:
    """Show a robot with at least one link that has hulls."""
    motion, size = done.motion or resting(robot.bodies), size_of(robot.bodies)
    meshes, hulls, link_of = placed(robot.bodies, motion.poses[0]), list[trimesh.Trimesh](), list[int]()
    for number, (body, pose) in enumerate(zip(robot.bodies, motion.poses[0], strict=True)):
        own = [turned(pose, hull.vertices, hull.faces) for hull in body.hulls(done.results)]
        hulls += [trimesh.Trimesh(*hull, process=False) for hull in own]
        link_of += [number] * len(own)
    each = [(body.name, done.results[collider].report) for body in robot.bodies for collider in body.colliders]
    report = joint_report(each, 2.0 / size if size > 0 else 1.0)
    if (length := report["options"].get("threshold_abs")) is not None:
        report["options"]["threshold"] = length * report["scale"]
    report |= {"name": robot.source.stem, "up": robot.up, "metres": robot.metres, "seconds": {"total": seconds}}
    report |= {"warnings": [*warnings], "samples": done.samples, "pairs": [pair.as_plain() for pair in done.pairs]}
    touching = None if done.cleared is None else _touching(robot, done.cleared, motion)
    places = [] if touching is None else _places(robot, done, motion, touching)
    moves = motion.joints, len(motion.sampled), motion.carried, places, done.samples, touching
    links = [body.name for body in robot.bodies]
    whole = mesh_of(robot, meshes, warnings)
    source = trimesh.Trimesh(whole.vertices, whole.faces, process=False)
    return RobotResult(hulls, report, source, None, whole, links, meshes, link_of, *moves)


def mesh_of(robot: Robot, links: Sequence[trimesh.Trimesh], warnings: Sequence[str]) -> InputMesh:
    """The meshes of all links as one."""
    whole = trimesh.util.concatenate(links)
    points, faces = np.asarray(whole.vertices), np.asarray(whole.faces)
    return InputMesh(points, faces, robot.source.name, (*warnings,), robot.up, robot.metres)


def _touching(robot: Robot, cleared: Cleared, motion: Motion) -> Callable[[list[float]], list[Contact]]:
    """What tells which links touch at joint positions: all, but those that a joint connects and whose meshes touch."""
    known, one = Known(), Lock()  # of readers, since they place the links of one model

    def touching(values: list[float]) -> list[Contact]:
        with one:
            found = check(cleared.bodies, motion.at(values), known=known)
        depths = {pair: what.offences[0].depth if what.offences else 0.0 for pair, what in found.items()}
        order = sorted(depths, key=lambda pair: (-depths[pair], pair))
        return [
            Contact(*pair, _deep(robot, depths[pair])) for pair in order if depths[pair] or pair not in motion.adjacent
        ]

    return touching


def _deep(robot: Robot, depth: float) -> str:
    return f"{robot.in_mm(depth)} deep, though their meshes do not" if depth else "as their meshes do"


def _places(
    robot: Robot, done: Checked, motion: Motion, touching: Callable[[list[float]], list[Contact]]
) -> list[Place]:
    """At rest, and where each pair of links that touch does so worst: the deepest first."""
    found = {} if done.cleared is None else done.cleared.touching
    worst = []
    for pair, what in found.items():
        depth, sample = (
            (what.offences[0].depth, what.offences[0].sample) if what.offences else (0.0, what.hulls.argmax())
        )
        if depth or pair not in motion.adjacent:
            first, second = (robot.bodies[i].name for i in pair)
            share = f"at {100 * what.hulls.mean():.3g} % of the positions"
            said = f"{first} and {second}: {share}, here {_deep(robot, depth)}"
            worst.append((-depth, said, motion.positions[sample].tolist()))
    rest = motion.positions[0].tolist()
    chosen = [("At rest", rest), *((said, values) for _, said, values in sorted(worst)[:MOST_PLACES])]
    return [Place(said, values, touching(values)) for said, values in chosen]
