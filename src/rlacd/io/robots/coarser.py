"""How many hulls the links of a robot would be at other tolerances: told of links of many, and a table of all."""

from __future__ import annotations

import os
import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rlacd.decomposition import Decomposition
from rlacd.errors import MeshFileError, OptionError
from rlacd.find_parts import Repaired
from rlacd.fit import Unit
from rlacd.io.robots.decomposed import SHARE, Checked, check_options, fitting, options_of_bodies, with_lengths
from rlacd.io.robots.robot import Body, Collider, Robot
from rlacd.options import Options
from rlacd.options.ranges import FAST
from rlacd.options.robots import RobotOptions
from rlacd.run import Run
from rlacd.solid.input_mesh import InputMesh
from rlacd.thresholds import FACTORS, FINEST_FACTOR, TradeoffRow, picked, rows_of

MANY = 20
"""A link of more hulls is told of, with what would make it fewer."""

SEARCH = ("progress", "budget", "search_steps", "max_hulls")
"""Options of a decomposition that a comparison of thresholds does not take."""


@dataclass(frozen=True)
class RobotTradeoff:
    """Hulls against tightness, link by link; printing it gives a table."""

    name: str
    thresholds_abs: list[float]
    """The finest first, in the robot's unit."""
    links: dict[str, list[int]]
    """For each link with meshes, how many hulls each threshold leads to."""
    pick: int | None
    """The threshold to take for the whole robot, as `rlacd.Tradeoff` says."""
    complete: bool
    """False if there was no time for some links, which then are left out."""
    unit: Unit

    @property
    def total(self) -> list[int]:
        """Hulls of all links together."""
        return [sum(counts) for counts in zip(*self.links.values(), strict=True)]

    def as_dict(self) -> dict[str, Any]:
        """Everything as values that ``json`` can write."""
        return asdict(self) | {"unit": self.unit.name, "total": self.total}

    def save_picture(self, path: str | os.PathLike[str]) -> Path:
        """Draw the curve of all links together as a PNG file (extra ``view``)."""
        from rlacd.viewer.curve import draw_curve

        points = [*zip(self.thresholds_abs, self.total, strict=False)]
        return draw_curve(path, self.name, "threshold_abs", points, self.pick)

    def __str__(self) -> str:
        marks = ["*" * (i == self.pick) for i in range(len(self.thresholds_abs))]
        lengths = zip(marks, map(self.unit.words, self.thresholds_abs), strict=True)
        rows = [
            ("threshold_abs", *(mark + words for mark, words in lengths)),
            *((n, *c) for n, c in self.links.items()),
        ]
        rows += [("all links", *self.total)] if self.links else []
        wide = [max(len(str(row[i])) for row in rows) for i in range(len(rows[0]))]
        return "\n".join(
            "  ".join([f"{row[0]:{wide[0]}}", *(f"{one!s:>{w}}" for one, w in zip(row[1:], wide[1:], strict=True))])
            for row in rows
        )


def tradeoff_of(robot: Robot, options: Mapping[str, Any]) -> RobotTradeoff:
    """Find out how many hulls each link takes at each of ten thresholds.

    Options are those of `rlacd.tradeoff`. The finest threshold is 0.4 times the usual one, if none is given.

    Raises
    ------
    MeshError
        A mesh cannot be decomposed, or there is none.
    OptionError
        An option is out of range, or the criterion has no lengths.
    """
    if options.get("criterion") not in (None, "distance", "concavity"):
        raise OptionError("the thresholds of a robot are lengths: leave criterion out, or give distance or concavity.")
    check_options(options)
    if not robot.replaced:
        raise MeshFileError(f"{robot.source} has no collision mesh, so there is nothing to compare.")
    robot, given, asked = with_lengths(robot, options, RobotOptions())
    given = {name: value for name, value in given.items() if value is not None}
    if given.get("threshold") is None and given.get("threshold_abs") is None:
        given["threshold_abs"] = float(f"{FINEST_FACTOR * SHARE * robot.size:.3g}")
    each = options_of_bodies(robot, {"quality": FAST, **given}, asked)
    links, known, finest = dict[str, list[int]](), dict[Hashable, list[TradeoffRow]](), 0.0
    for body, own in zip(robot.bodies, each, strict=True):
        if body.colliders:
            finest = own["threshold_abs"]
            sums = [_hulls(body, collider, own, FACTORS, known) for collider in body.colliders]
            if all(sums):
                links[body.name] = [sum(counts) for counts in zip(*sums, strict=True)]
    thresholds = [finest * factor for factor in FACTORS]
    is_complete = len(links) == len(robot.replaced)
    made = RobotTradeoff(robot.source.stem, thresholds, links, None, is_complete, robot.unit)
    pick = picked([*zip(thresholds, made.total, strict=False)], given.get("max_hulls"))
    return RobotTradeoff(made.name, thresholds, links, pick, is_complete, robot.unit)


def many_told(robot: Robot, done: Checked, repaired: Mapping[Hashable, Repaired]) -> list[str]:
    """What to say of links of many hulls, if their tolerance is a length: how many at others, and how to ask for that.

    The counts are of one pass without a search. `repaired` are the solids of colliders, by their keys.
    """
    said, known, results = [], dict[Hashable, list[TradeoffRow]](), done.results
    for body, own in zip(robot.bodies, done.options, strict=True):
        count = sum(len(results[collider]) for collider in body.colliders)
        if count <= MANY or "threshold_abs" not in own:
            continue
        length = own["threshold_abs"]
        wider, quick = {**own, "threshold_abs": 2 * length, "quality": FAST}, {**own, "quality": FAST}
        sums = [_hulls(body, collider, wider, (1, 2), known, repaired.get(collider.key)) for collider in body.colliders]
        if not all(sums):
            continue
        twice, four = (sum(counts) for counts in zip(*sums, strict=True))
        enough = 2 if twice <= MANY else 4
        said.append(
            f"{body.name} is {count} hulls; about {twice} at twice the tolerance and {four} at four times, "
            f"--link '{re.escape(body.name)}={enough * length:.3g}'"
        )
        of_open = sum(_of_open_bodies(results[collider]) for collider in body.colliders)
        if count - of_open <= MANY and own["openings"] in ("auto", "small"):
            filled = [
                _hulls(body, collider, {**quick, "openings": "solid"}, (1,), known) for collider in body.colliders
            ]
            if all(filled) and (fewer := sum(counts[0] for counts in filled)) < twice:
                said[-1] += f"; with its open bodies filled {fewer}, --openings solid"
        said[-1] += "."
    return said


def _of_open_bodies(result: Decomposition) -> int:
    """How many hulls are of bodies that stayed thin shells."""
    steps = [body.step for body in result.report.repair]
    owners = [hull.metadata.get("body") for hull in result.hulls]
    return sum(owner is not None and steps[owner] == "slab" for owner in owners)


def _hulls(
    body: Body,
    collider: Collider,
    options: Mapping[str, Any],
    factors: Sequence[float],
    known: dict[Hashable, list[TradeoffRow]],
    repaired: Repaired | None = None,
) -> list[int]:
    """How many hulls a tolerance leads to times each factor; empty if there was no time. The same solids share that."""
    key = collider.key, options["threshold_abs"], options["openings"]
    if key not in known:
        mesh = collider.mesh()
        given = {name: value for name, value in fitting(mesh, options, body).items() if name not in SEARCH}
        own = Options.of(given)
        with Run(own.threads, own.timeout, options.get("progress")) as run:
            source = InputMesh(mesh.vertices, mesh.faces, collider.name, ())
            known[key] = rows_of(source, own, options["threshold_abs"], factors, run, repaired)
    counts = [row.hulls for row in known[key]]
    if len(counts) < len(factors) and counts and counts[-1] == 1:
        counts += [1] * (len(factors) - len(counts))
    return counts if len(counts) == len(factors) else []
