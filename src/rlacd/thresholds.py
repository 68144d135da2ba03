"""Which threshold? How many hulls an object takes at each of several, from one tree of cuts."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from manifold3d import Manifold, OpType
from numpy.typing import ArrayLike

from rlacd._native import mesh_volume
from rlacd.decompose_mesh import MeshLike, in_metres
from rlacd.errors import OptionError
from rlacd.find_parts import Decomposer, Problem, Reached, Repaired
from rlacd.finish.finish import cleaned_parts
from rlacd.fit import ANY, Unit
from rlacd.io.read.load import load_mesh
from rlacd.options import Options
from rlacd.options.fields import about, check_callback
from rlacd.options.lengths import read_lengths
from rlacd.options.ranges import FAST
from rlacd.run import ProgressCallback, Run
from rlacd.solid.distance import hull_distances
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.manifold import to_manifold

FACTORS = (1, 1.25, 1.5, 2, 2.5, 4, 6, 10, 15, 25)
"""Times the finest threshold."""

FINEST_FACTOR = 0.4
"""Share of the usual threshold that the finest is where none is given: 0.02, for 0.02 to 0.5."""


class TradeoffRow(NamedTuple):
    """What one threshold leads to."""

    threshold: float
    """As `rlacd.decompose` takes it; with the criterion ``volume``, its `volume_tolerance`."""
    hulls: int
    triangles: int
    added: float
    """How far the hulls reach beyond the input: where the longest side is 2, or in the input's unit if the threshold
    is."""
    added_volume: float
    """The volume of all hulls together, less that of the solid, as a share of that."""


@dataclass(frozen=True)
class Tradeoff:
    """Hulls against tightness; printing it gives a table."""

    name: str
    """Of the object."""
    option: str
    """What the thresholds are given as: ``threshold``, ``threshold_abs`` or ``volume_tolerance``."""
    rows: list[TradeoffRow]
    """The finest first; one with a single hull ends them."""
    pick: int | None
    """The row to take: the finest with at most `max_hulls`, if that was given; else the knee of the curve, beyond
    which a finer threshold costs ever more hulls. None without rows."""
    complete: bool
    """False if there was no time for coarser thresholds."""
    unit: Unit = ANY
    """In which printing it tells lengths, if the thresholds are lengths."""

    def as_dict(self) -> dict[str, Any]:
        """Everything as values that ``json`` can write."""
        return asdict(self) | {"rows": [row._asdict() for row in self.rows]}

    def save_picture(self, path: str | os.PathLike[str]) -> Path:
        """Draw the curve as a PNG file (extra ``view``); raises as `rlacd.Decomposition.save_picture` does."""
        from rlacd.viewer.curve import draw_curve

        points = [(row.threshold, row.hulls) for row in self.rows]
        return draw_curve(path, self.name, self.option, points, self.pick)

    def __str__(self) -> str:
        head = ("", self.option, "hulls", "triangles", "added", "added volume")
        words = self.unit.words if self.option == "threshold_abs" else "{:.4g}".format
        marks = ["*" if i == self.pick else "" for i in range(len(self.rows))]
        lines = [
            (mark, words(c.threshold), c.hulls, c.triangles, words(c.added), f"{100 * c.added_volume:.3g}%")
            for mark, c in zip(marks, self.rows, strict=True)
        ]
        return "\n".join("{:1} {:>16} {:>6} {:>10} {:>12} {:>13}".format(*line) for line in (head, *lines))


def tradeoff(
    mesh: MeshLike,
    faces: ArrayLike | None = None,
    *,
    file_type: str | None = None,
    max_hulls: int | None = None,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> Tradeoff:
    """Find out how many hulls a mesh takes at each of ten thresholds.

    They share the repair and the cuts, so it takes up to five times as long as one decomposition. There is no search:
    as with the quality ``fast``, unless `quality` says otherwise.

    Parameters
    ----------
    mesh, faces, file_type, progress
        As for `rlacd.decompose`.
    max_hulls : int, optional
        Pick the finest threshold with at most so many hulls, instead of the knee.
    **options
        As for `rlacd.decompose`. `threshold`, `threshold_abs` or `volume_tolerance` is the finest to try; the coarsest
        is 25 times that.

    Returns
    -------
    Tradeoff

    Raises
    ------
    MeshError
        The input cannot be read or contains nothing to decompose.
    OptionError
        An option has the wrong type or is out of range, or the criterion is navigable space, which has no threshold.
    """
    options = read_lengths(options)
    chosen = Options.of({"quality": FAST, "max_hulls": max_hulls, **options})
    name = "threshold_abs" if chosen.threshold_abs is not None else chosen.numbers[0]
    if name == "radius" or chosen.per_node:
        raise OptionError("thresholds are compared for a whole mesh, by concavity, distance or volume.")
    if options.get(name) is None:
        usual = about(Options, name).kind.read(getattr(chosen, name))
        chosen = Options.of({"quality": FAST, "max_hulls": max_hulls, **options, name: FINEST_FACTOR * usual})
    check_callback("progress", progress, "a `rlacd.Progress`")
    with Run(chosen.threads, chosen.timeout, progress) as run:
        with run.stage("load"):
            source, chosen = in_metres(load_mesh(mesh, faces, file_type), chosen)
        rows = rows_of(source, chosen, getattr(chosen, name), FACTORS, run)
        complete = run.stopped_by is None
    pick = picked([(row.threshold, row.hulls) for row in rows], max_hulls)
    return Tradeoff(Path(source.name).stem, name, rows, pick, complete, source.unit)


def rows_of(
    source: InputMesh,
    options: Options,
    finest: float,
    factors: Sequence[float],
    run: Run,
    repaired: Repaired | None = None,
) -> list[TradeoffRow]:
    """What the threshold of options, of the value `finest`, leads to times each factor, the first of them 1.

    Those behind a single hull are left out, and those that there is no time for.
    """
    rows = []
    for factor, reached in zip(factors, _reached(source, options, factors, run, repaired), strict=False):
        unit = 1.0 if options.threshold_abs is None else reached.solid.frame.scale
        rows.append(_row(finest * factor, reached, unit, run))
    return rows


def _reached(
    source: InputMesh, options: Options, factors: Sequence[float], run: Run, repaired: Repaired | None
) -> Iterator[Reached]:
    """Decompose a mesh under its goal scaled by each factor, on one tree of cuts, until one part is left.

    Factors ascend from 1. Those that there is no time for are left out.
    """
    with run.until_stopped():
        problem = Problem.of(source, options, run, repaired)
        decomposer = Decomposer.of(problem, run)
        options = problem.options
        for factor in factors:
            (*_, parts), goal, found = decomposer.decompose(problem.goal.scaled(factor))
            if any(options.hull_limits):
                from rlacd.extras.limit import cut_to_limits

                parts = cut_to_limits(parts, goal, problem.root, options, run)
            if run.stopped_by is not None:
                break
            yield Reached(problem.solid, options, goal, parts, found, problem.root)
            if len(parts) <= 1:
                break


def _row(threshold: float, reached: Reached, unit: float, run: Run) -> TradeoffRow:
    solid = reached.solid
    with run.shielded():
        hulls = [part.hull for part in cleaned_parts(reached, run)[0]]
        over = hull_distances(hulls, *solid.surface, threads=run.threads, surface=solid.index).over[1]
        union = Manifold.batch_boolean([to_manifold(hull.vertices, hull.faces) for hull in hulls], OpType.Add)
        own = abs(float(mesh_volume(*solid.mesh)))
    added = max(union.volume() / own - 1, 0.0) if own > 0 else math.inf
    return TradeoffRow(threshold, len(hulls), sum(len(hull.faces) for hull in hulls), over / unit, added)


def picked(points: Sequence[tuple[float, int]], most: int | None) -> int | None:
    """The finest threshold with at most so many hulls, or the knee: the point farthest below the line between the ends.

    The threshold counts by its logarithm; both axes are scaled to the same length (Satopää et al., "Finding a
    'Kneedle' in a Haystack", 2011).
    """
    if most is not None:
        return next((i for i, (_, hulls) in enumerate(points) if hulls <= most), None)
    if len(points) < 3 or points[0][1] == points[-1][1]:
        return len(points) - 1 if points else None
    x, y = np.log([threshold for threshold, _ in points]), np.array([hulls for _, hulls in points], dtype=np.float64)
    below = (y[0] - y) / (y[0] - y[-1]) - (x - x[0]) / (x[-1] - x[0])
    return int(below.argmax())
