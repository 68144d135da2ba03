"""Decomposing the bodies of a robot: each solid once, with lengths relative to the robot, clear where it was clear."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh

from rlacd.clear import Body as Moving
from rlacd.clear import (
    Cleared,
    CrowdedError,
    LinkPair,
    Motion,
    Solids,
    Surface,
    at_rest,
    kept_clear,
    link_pairs,
    warnings_of,
)
from rlacd.clear.mend import Exact, Redo
from rlacd.decompose_mesh import Memory, decompose_quietly
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshError, MissingExtraError, OptionError
from rlacd.find_parts import Repaired
from rlacd.fit import Unit
from rlacd.io.robots.robot import Body, Collider, Results, Robot
from rlacd.options import Options
from rlacd.options.fields import shown
from rlacd.options.lengths import LONGEST_SIDE, in_unit, read_lengths, unit_of
from rlacd.options.ranges import LENGTHS, DetailName, OpeningsName
from rlacd.options.robots import RobotOptions
from rlacd.run import Progress, ProgressCallback
from rlacd.solid.frame import ROUNDING, Frame
from rlacd.solid.obstacle import Obstacle
from rlacd.solid.poses import inverse, moved
from rlacd.solid.topology import compacted

SHARE = 0.015
"""The distance that hulls may have by default, as a share of the robot's longest side. 20 robots then have 3.9 hulls a
link (geometric mean), and MuJoCo takes twice as many steps a second as with each mesh at its own scale."""

SMALL: OpeningsName = "small"
"""Links are solids, which nothing gets into; what is as open as a bucket stays open, and what other links move in."""

FULL: DetailName = "full"
"""Hulls with all their corners: simpler ones hold them, and a little more."""

LINK = "link "
"""What the stage of a report of progress begins with that names a link, before the reports of its meshes."""

STOPPED = "Links were not checked against each other: the work was stopped before."
"""The warning of robots that there was no time to check."""


@dataclass(frozen=True)
class Checked:
    """The hulls of all colliders, finer where links would touch; where these were looked at, and what they do there.

    Of links that were not checked against each other there is no motion, and no `cleared`.
    """

    results: dict[Collider, Decomposition]
    options: Sequence[Mapping[str, Any]]
    """Those of each body, with what was changed to keep links clear."""
    warnings: list[str] = field(default_factory=list)
    motion: Motion | None = None
    cleared: Cleared | None = None

    @property
    def pairs(self) -> list[LinkPair]:
        """What each two links do; empty if nothing was checked."""
        return [] if self.cleared is None or self.motion is None else link_pairs(self.cleared, self.motion)

    @property
    def samples(self) -> int:
        """Joint positions looked at, with that at rest."""
        return 0 if self.cleared is None or self.motion is None else len(self.motion.poses)


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


def with_lengths(
    robot: Robot, options: Mapping[str, Any], asked: RobotOptions
) -> tuple[Robot, dict[str, Any], RobotOptions]:
    """Convert lengths with a unit to the robot's, and tell lengths in the unit in which one was given."""
    given, name = read_lengths(options), robot.source.name
    told_in, metres = Unit.typed(unit_of(given), robot.metres), robot.metres
    links = None if asked.links is None else in_unit(asked.links, metres, name)
    return replace(robot, told_in=told_in), in_unit(given, metres, name), replace(asked, links=links)


def decomposed_robot(
    robot: Robot, options: Mapping[str, Any], asked: RobotOptions, repaired: dict[Hashable, Repaired]
) -> Checked:
    """Decompose all colliders, those that are the same solid once, and again what touches as hulls only.

    Each solid is repaired once; those in `repaired`, by the key of their collider, not again, and the others are added.

    Raises
    ------
    MeshError
        A solid cannot be decomposed.
    OptionError
        An option is out of range, or a pattern of `links` matches none.
    """
    bodies, each = robot.bodies, options_of_bodies(robot, options, asked)
    tell = _teller(len(bodies), options.get("progress"))
    results: dict[Collider, Decomposition] = {}
    done: dict[Hashable, Decomposition] = {}
    found: dict[Hashable, Memory] = {}

    def decompose_body(number: int) -> None:
        body, own = bodies[number], each[number]
        tell(LINK + body.name, number)
        for collider in body.colliders:
            parts = collider.key, own.get("threshold_abs"), own["openings"]
            if (key := (parts, own.get("detail"))) not in done:
                memory = found.setdefault(parts, Memory(repaired=repaired.setdefault(collider.key, {})))
                done[key] = decomposed(body, collider, own, robot.unit, memory)
            results[collider] = done[key]

    for number in range(len(bodies)):
        decompose_body(number)
    if robot.is_alone or not all(result.report.complete for result in results.values()):
        return Checked(results, each, [] if robot.is_alone else [STOPPED])

    def redo(number: int, obstacles: Sequence[Obstacle], most: int) -> list[Surface] | None:
        tell(LINK + bodies[number].name, number)
        again = results | _clear_of(obstacles, bodies[number], results, each[number], robot.unit, repaired)
        hulls = _moving(bodies[number], again).hulls
        if len(hulls) > most:
            return None
        results.update(again)
        return hulls

    def exact(number: int, is_entered: Callable[[], bool]) -> list[Surface] | None:
        repairs = [body for collider in bodies[number].colliders for body in results[collider].report.repair]
        if not (finer := _finer(each[number], any(body.step != "closed" for body in repairs) and is_entered())):
            return None
        each[number] |= finer
        decompose_body(number)
        return _moving(bodies[number], results).hulls

    tell("clear", 0)
    return _checked(robot, Checked(results, each), asked, options.get("seed") or 0, (redo, exact))


def _finer(options: Mapping[str, Any], is_entered: bool) -> dict[str, Any]:
    """What makes the hulls of a link exact, and leaves it as open as it is if another link moves in it."""
    finer = {} if "detail" in options else {"detail": FULL}
    return finer | ({"openings": "auto"} if is_entered and options["openings"] == SMALL else {})


def _checked(robot: Robot, done: Checked, asked: RobotOptions, seed: int, ways: tuple[Redo, Exact]) -> Checked:
    """Check links against each other, and mend those that touch in two ways (see `kept_clear`)."""
    try:
        motion, said = _motion(robot, asked.samples, seed)
        cleared = kept_clear([*_links(robot.bodies, done.results, motion)], motion, *ways)
    except (MissingExtraError, CrowdedError) as error:
        if asked.exclude or asked.srdf:
            raise
        return replace(done, warnings=[f"Links were not checked against each other: {error}"])
    found = warnings_of(cleared, motion, robot.unit.words)
    ranges = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in motion.warnings]
    return replace(done, warnings=[*said, *ranges, *found], motion=motion, cleared=cleared)


def _teller(total: int, progress: ProgressCallback | None) -> Callable[[str, int], None]:
    """What reports that so many bodies are done, and what comes next."""
    began = time.perf_counter()

    def tell(stage: str, done: int) -> None:
        if progress is not None:
            progress(Progress(stage, done, total, 0, time.perf_counter() - began))

    return tell


def _motion(robot: Robot, samples: int, seed: int) -> tuple[Motion, list[str]]:
    """Where bodies can be, or at least are; and what to say of that."""
    try:
        return robot.motion(samples, seed), []
    except MissingExtraError:
        raise
    except Exception as error:  # MuJoCo reads fewer meshes than we do; a URDF may say anything
        reader = {".urdf": "yourdfpy"}.get(robot.source.suffix.lower(), "MuJoCo")
        said = f"{reader} cannot place the links of {robot.source.name} ({' '.join(str(error).split())[:80]})"
        rest = at_rest([body.name for body in robot.bodies], (), [body.pose for body in robot.bodies])
        return rest, [f"Links were checked against each other at rest only: {said}."]


def options_of_bodies(robot: Robot, options: Mapping[str, Any], asked: RobotOptions) -> list[dict[str, Any]]:
    """The options of each body; raises as `decomposed_robot`."""
    names, replaced = ([body.name for body in bodies] for bodies in (robot.bodies, robot.replaced))
    lengths: dict[str, Any] = {}
    for pattern, length in (asked.links or {}).items():
        matched = [name for name in replaced if re.fullmatch(pattern, name)]
        if not matched:
            known = ", ".join(replaced)
            raise OptionError(
                f"no link with a collision mesh matches the regular expression {pattern!r}; there are {known}."
            )
        lengths |= dict.fromkeys(matched, length)
    whole = _relative_to_robot(options, robot)
    return [whole | ({"threshold_abs": lengths[name]} if name in lengths else {}) for name in names]


def _relative_to_robot(options: Mapping[str, Any], robot: Robot) -> dict[str, Any]:
    """Options with lengths in the robot's unit, where they are shares of its longest side; by default a distance."""
    given = {"openings": SMALL} | {name: value for name, value in options.items() if value is not None}
    if given.pop("relative_to", "scene") == "mesh" or not robot.bodies:
        return given
    if given.setdefault("criterion", "distance") in ("distance", "concavity") and "threshold_abs" not in given:
        share = given.pop("threshold") / LONGEST_SIDE if "threshold" in given else None
        given["threshold_abs"] = float(f"{SHARE * robot.size:.3g}") if share is None else share * robot.size
    if given.get("overlap") and "overlap_abs" not in given:
        given["overlap_abs"] = given.pop("overlap") / LONGEST_SIDE * robot.size
    return given


def decomposed(
    body: Body, collider: Collider, options: Mapping[str, Any], unit: Unit, memory: Memory | None = None
) -> Decomposition:
    """Decompose one collider of a body, with lengths that are larger than it cut to it, and told in a unit."""
    mesh, path = collider.mesh(), collider.meshes[0].file.path
    own = fitting(mesh, options, body)
    try:
        return decompose_quietly((mesh.vertices, mesh.faces), told_in=unit, memory=memory, **own)
    except OptionError as error:
        raise OptionError(f"of {body.name}, {error}") from error
    except MeshError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def fitting(mesh: trimesh.Trimesh, options: Mapping[str, Any], body: Body) -> dict[str, Any]:
    """The options with lengths that are too large for the mesh cut to it; too small ones only for the world's."""
    fitted = dict(options)
    scale = Frame.of(compacted(np.asarray(mesh.vertices), np.asarray(mesh.faces))[0]).scale
    for name, (least, most) in LENGTHS.items():
        if isinstance(length := fitted.get(f"{name}_abs"), (int, float)):
            length = max(length, least / scale * (1 + ROUNDING)) if body.is_world else length
            fitted[f"{name}_abs"] = min(length, most / scale * (1 - ROUNDING))
    return fitted


def _links(bodies: Sequence[Body], results: Results, motion: Motion) -> Iterator[Moving]:
    """Those of the file, and then those whose primitives the motion alone knows."""
    nothing = Surface(np.empty((0, 3)), np.empty((0, 3), dtype=np.int32))
    solids = motion.solids or [Solids(body.primitives) for body in bodies]
    for i, (name, own) in enumerate(zip(motion.links, solids, strict=True)):
        moving = _moving(bodies[i], results) if i < len(bodies) else Moving(name, nothing)
        replaced = sum(len(collider.meshes) for collider in bodies[i].colliders) if i < len(bodies) else 0
        yield replace(moving, primitives=own.primitives, is_whole=own.meshes == replaced and not own.others)


def _moving(body: Body, results: Results) -> Moving:
    mesh, hulls = body.mesh(), body.hulls(results)
    surfaces = [Surface(np.asarray(hull.vertices), np.asarray(hull.faces)) for hull in hulls]
    return Moving(body.name, Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces)), surfaces)


def _clear_of(
    obstacles: Sequence[Obstacle],
    body: Body,
    results: Results,
    options: Mapping[str, Any],
    unit: Unit,
    repaired: Mapping[Hashable, Repaired],
) -> dict[Collider, Decomposition]:
    """Decompose the colliders of a body again that come near obstacles."""
    again = {}
    for collider in body.colliders:
        back = inverse(collider.meshes[0].to_body)
        placed = [Obstacle(o.name, moved(back, o.vertices), o.faces, o.margin, is_told=False) for o in obstacles]
        near = [obstacle for obstacle in placed if _is_near(obstacle, results[collider])]
        if near:
            memory = Memory(repaired=repaired[collider.key])
            again[collider] = decomposed(body, collider, {**options, "avoid": near}, unit, memory)
    return again


def _is_near(obstacle: Obstacle, result: Decomposition) -> bool:
    if not len(obstacle.vertices):
        return False
    lower, upper = obstacle.vertices.min(axis=0) - obstacle.margin, obstacle.vertices.max(axis=0) + obstacle.margin
    boxes = [hull.bounds for hull in result.hulls]
    return any(bool((box[0] <= upper).all() and (box[1] >= lower).all()) for box in boxes)
