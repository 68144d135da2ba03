"""What became of a robot, in its own terms: its links, lengths in its unit, warnings about all solids of a kind."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trimesh

from rlacd.clear import LinkPair
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshError
from rlacd.fit import ANY, Unit
from rlacd.io.robots.decomposed import Checked
from rlacd.io.robots.robot import Body, Collider, Results, Robot, Written
from rlacd.plain_json import as_plain
from rlacd.report import kind_of


@dataclass(frozen=True, eq=False)
class RewrittenLink:
    """A link (URDF), body (MJCF) or rigid body (USD) that collides; hulls replaced its meshes."""

    name: str
    """As in the file; of a USD stage its path."""
    meshes: Sequence[Path]
    """The files of its collision meshes, or the paths of their prims."""
    hulls: Sequence[trimesh.Trimesh]
    """In the frame of the link, in the robot's unit."""
    files: Sequence[str]
    """The names of the hulls' files."""
    results: Sequence[Decomposition]
    """The decomposition of each of its solids, in the frame of the solid's first mesh."""
    primitives: int = 0
    """How many primitives it has beside, which stay; 0 in a USD stage, where they are not looked at."""

    @classmethod
    def of(cls, body: Body, results: Results, names: Mapping[Collider, Sequence[str]]) -> RewrittenLink:
        """What became of a body."""
        meshes = [mesh.file.path for collider in body.colliders for mesh in collider.meshes]
        files = [name for collider in body.colliders for name in names[collider]]
        own = [results[collider] for collider in body.colliders]
        return cls(body.name, meshes, body.hulls(results), files, own, len(body.primitives))

    @property
    def added(self) -> float | None:
        """How far its hulls reach beyond its meshes, in the robot's unit; None without, or if not measured."""
        return _most([_reach(result) for result in self.results])


@dataclass(frozen=True, eq=False)
class RewrittenRobot:
    """The result of rewriting a robot."""

    path: Path
    """The new description."""
    folder: Path
    """Where its hulls are, as OBJ files."""
    links: list[RewrittenLink]
    """The links that collide, also those of primitives alone."""
    warnings: list[str]
    """What the user should know: one sentence each."""
    seconds: float
    """Wall time."""
    size: float
    """The longest side of the box around all that collides, with all joints at zero."""
    metres: float = 1.0
    """The robot's unit of length."""
    unit: Unit = ANY
    """In which lengths are told."""
    pairs: Sequence[LinkPair] = ()
    """What each two of the links do at the joint positions that were looked at; empty if none were."""
    samples: int = 0
    """How many those are."""
    _source: tuple[Robot, Checked] | None = None

    @property
    def complete(self) -> bool:
        """False when a decomposition was stopped early."""
        return all(result.report.complete for link in self.links for result in link.results)

    @property
    def added(self) -> float | None:
        """How far hulls reach beyond the meshes, in the robot's unit; None where there was no time to measure."""
        return _most([link.added for link in self.replaced])

    @property
    def touch_within(self) -> float | None:
        """Wherever the joints are, hulls of two links touch only where the links are at most so far apart.

        It is what the two links add whose hulls reach farthest, in the robot's unit; None where not measured.
        """
        each = [link.added for link in self.replaced]
        known = sorted(length for length in each if length is not None)
        return sum(known[-2:]) if len(known) == len(each) else None

    @property
    def replaced(self) -> list[RewrittenLink]:
        """The links with collision meshes, which hulls replaced."""
        return [link for link in self.links if link.meshes]

    def save_report(self, path: str | os.PathLike[str]) -> Path:
        """Write what was measured, as `rlacd.Decomposition.save_report` does; on a page, joints can be moved.

        Raises
        ------
        MeshError
            No link has a collision mesh, which a page would show.
        """
        from rlacd.viewer.report import save_report

        return save_report(path, self.as_dict(), self._page)

    def _page(self) -> str:
        if self._source is None or not self.replaced:
            raise MeshError(f"{self.path} has no collision mesh, so there is nothing to show.")
        from rlacd.io.robots.viewed import shown
        from rlacd.viewer.report import report_page

        return report_page(shown(*self._source, self.warnings, self.seconds))

    def as_dict(self) -> dict[str, Any]:
        """All measurements as plain values; lengths named ``_abs`` are in the robot's unit."""
        return {
            "robot": str(self.path),
            "metres": self.metres,
            "size_abs": self.size,
            "complete": self.complete,
            "meshes": sum(len(link.meshes) for link in self.links),
            "hulls": sum(len(link.files) for link in self.links),
            "added_abs": self.added,
            "touch_within_abs": self.touch_within,
            "seconds": self.seconds,
            "links": [
                {
                    "name": link.name,
                    "meshes": [str(mesh) for mesh in link.meshes],
                    "hulls": len(link.files),
                    "primitives": link.primitives,
                    "files": [*link.files],
                    "added_abs": link.added,
                    "solids": [result.report.as_dict() for result in link.results],
                }
                for link in self.links
            ],
            "samples": self.samples,
            "pairs": as_plain([*self.pairs]),
            "warnings": self.warnings,
        }


def rewritten(robot: Robot, done: Checked, place: Path, written: Written, began: float) -> RewrittenRobot:
    """What became of a robot that was written, since a time of `time.perf_counter`."""
    links = [RewrittenLink.of(body, done.results, written.names) for body in robot.bodies]
    how = "" if robot.bodies else "; --from-visual makes collision geometry of what it shows"
    said = [] if robot.replaced else [f"{robot.source} has no collision mesh, so this is a copy{how}."]
    said += [*robot.warnings, *written.warnings, *warnings_of(robot, done.results), *done.warnings]
    seconds, of_links = time.perf_counter() - began, (done.pairs, done.samples)
    return RewrittenRobot(
        place, written.folder, links, said, seconds, robot.size, robot.metres, robot.unit, *of_links, (robot, done)
    )


def warnings_of(robot: Robot, results: Results) -> list[str]:
    """What the reports of all solids warn of; the worst lost the widest passage, or has hulls that reach farthest."""
    solids: dict[int, tuple[str, Decomposition]] = {}
    for body in robot.bodies:
        for collider in body.colliders:
            solids.setdefault(id(results[collider]), (body.name, results[collider]))
    each = [(name, result, said) for name, result in solids.values() for said in result.report.warnings]
    others = [one for one in each if " parts exceed the " not in one[2] or not _too_far(one[1])]
    said = grouped([(name, said, _widest(r) if "passage" in said else _reach(r) or 0.0) for name, r, said in others])
    far = [(*found, name) for name, result in solids.values() if (found := _too_far(result))]
    if far:
        worst, asked, _, name = max(far)
        links = name if len(far) == 1 else f"{len(far)} solids, the worst {name},"
        many = sum(count for _, _, count, _ in far)
        hulls = "1 hull of" if many == 1 else f"{many} hulls of"
        allowed, by = robot.unit.words(asked), robot.unit.words(worst - asked)
        said.append(f"{hulls} {links} exceed the tolerance of {allowed}, by up to {by}.")
    return said


def _too_far(result: Decomposition) -> tuple[float, float, int] | None:
    """The farthest of the hulls that exceed the threshold, the threshold, and how many do; None if it is no length."""
    fit = result.report.fit
    if fit is None or not fit.is_length or fit.max is None or fit.limit is None or fit.max <= fit.limit:
        return None
    scale = result.report.scale
    return fit.max / scale, fit.limit / scale, sum(error > fit.limit for error in fit.per_part or ())


def grouped(warnings: Sequence[tuple[str, str, float]]) -> list[str]:
    """One sentence for all warnings of a kind: the worst, by what it is about, what it says, and how bad that is."""
    kinds: dict[str, list[tuple[str, str, float]]] = {}
    for one in warnings:
        kinds.setdefault(kind_of(one[1]), []).append(one)
    sentences = []
    for each in kinds.values():
        name, said, _ = max(each, key=lambda one: one[2])
        others = {1: "", 2: " and 1 other"}.get(len(each), f" and {len(each) - 1} others")
        sentences.append(f"{name}{others}: {said}")
    return sentences


def _widest(result: Decomposition) -> float:
    return max((one.radius_abs - one.left_abs for one in result.report.passages or ()), default=0.0)


def _reach(result: Decomposition) -> float | None:
    over = result.report.hausdorff.added
    return None if over is None else over / result.report.scale


def _most(lengths: Sequence[float | None]) -> float | None:
    known = [length for length in lengths if length is not None]
    return max(known) if known and len(known) == len(lengths) else None
