"""Tabular dual-state Q-learning on real cut trees: which discounts converge (the paper's appendix A)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.charts import Curve, curves_chart
from benchmarks.page import Figure, Page, Text
from benchmarks.tables import Table
from rlacd.criteria import Concavity
from rlacd.errors import MeshError, RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.paper.tabular import Node, grow, middle_planes, process_of, q_learning
from rlacd.repair.repair import repair
from rlacd.solid.component import Component

DISCOUNTS = {
    "share of the hull (eq. 9)": None,
    "0.4 + 0.4": 0.4,
    "0.5 + 0.5": 0.5,
    "0.7 + 0.7": 0.7,
    "0.9 + 0.9": 0.9,
    "0.99 + 0.99": 0.99,
}
THRESHOLD = 0.02
SMALL_FILE = 15_000
"""Bytes: cut trees of small meshes take little time to build."""

POINTS = 300
"""Number of points on each curve."""

ENDLESS = 1e12
"""Values beyond this are not drawn."""


def discounts_page(meshes: Path, names: list[str], count: int = 12, depth: int = 4, steps: int = 300_000) -> Page:
    """Solve the cut trees of `count` small meshes exactly and by tabular Q-learning, for several discounts.

    Parameters
    ----------
    meshes : Path
    names : list of str
        Meshes in that folder. A fixed sample is taken of those that are small and need a cut.
    count, depth, steps : int
        Number of meshes, depth of the cut trees, steps of Q-learning.

    Raises
    ------
    MeshError
        None of the meshes needs a cut.
    """
    roots = _trees(meshes, names, count, depth)
    every = max(1, steps // POINTS)
    sizes, errors, lines = [], [], []
    for name, discount in DISCOUNTS.items():
        process = process_of(roots, alike=True, static_discount=discount)
        exact = process.solve()
        history = q_learning(process, steps, np.random.default_rng(0), every=every)
        at = every * np.arange(1, len(history) + 1)
        size = np.array([np.abs(q).max() for q in history])
        shown = (size > 0) & (size < ENDLESS)
        sizes.append(Curve(name, at[shown].tolist(), size[shown].tolist()))
        cells = ["does not exist", f"|Q| {size[-1]:.3g}"]
        if exact is not None:
            away = np.array([np.abs(q - exact)[process.possible].max() for q in history])
            errors.append(Curve(name, at[away > 0].tolist(), away[away > 0].tolist()))
            cells = [f"{np.abs(exact).max():.3g}", f"error {away[-1]:.3g}"]
        lines.append([name, process.states, *cells])
    page = Page("Which discounts converge (appendix A)")
    page.add(
        Text(
            f"All that three planes can make of {count} real solids in {depth} cuts, concavity {THRESHOLD:g}. "
            "Components that look alike (share of the hull filled and proportions, in thirds) are one state. Tabular "
            f"Q-learning of {steps:,} steps against exact dynamic programming."
        ),
        Table(["discounts", "states", "greatest |Q*|", f"after {steps:,} steps"], lines),
        _figure("discounts-size.svg", sizes, "greatest |Q|"),
        _figure("discounts-error.svg", errors, "greatest |Q − Q*|, where Q* exists"),
    )
    return page


def _figure(name: str, curves: list[Curve], what: str) -> Figure:
    chart = curves_chart(curves, "steps of Q-learning", what, log_x=True, log_y=True, markers=False)
    return Figure(name, chart, what)


def _trees(meshes: Path, names: list[str], count: int, depth: int) -> list[Node]:
    """Cut trees of the first `count` small meshes that need a cut, in a fixed random order."""
    roots: list[Node] = []
    used = 0
    small = [name for name in sorted(names) if (meshes / name).stat().st_size < SMALL_FILE]
    for name in [small[i] for i in np.random.default_rng(0).permutation(len(small))]:
        try:
            solid = Component(repair(load_mesh(meshes / name)).shape)
            found = grow(solid, Concavity(THRESHOLD), middle_planes(), depth)
        except (RlacdError, ValueError):
            continue
        if any(node.outcomes for node in found):
            roots += found
            used += 1
        if used == count:
            break
    if not roots:
        raise MeshError(f"none of the {len(names)} meshes is small and needs a cut; give a folder with others.")
    return roots
