"""Tabular dual-state Q-learning on real cut trees: which discounts converge (the paper's appendix A, Fig. 7).

python benchmarks/appendix_a.py MESHES OUT.png    # needs matplotlib
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from rlacd.criteria import Concavity
from rlacd.errors import RlacdError
from rlacd.learn.tabular import Node, grow, middle_planes, process_of, q_learning
from rlacd.solid.component import Component
from rlacd.solid.load import load_mesh
from rlacd.solid.repair import repair

DISCOUNTS = {
    "share of the hull volume (eq. 9)": None,
    "0.4 + 0.4": 0.4,
    "0.5 + 0.5": 0.5,
    "0.7 + 0.7": 0.7,
    "0.9 + 0.9": 0.9,
    "0.99 + 0.99": 0.99,
}


def trees(folder: Path, count: int, depth: int) -> list[Node]:
    """Cut trees of the first `count` small meshes, in the order of their names' hashes, that need a cut."""
    roots: list[Node] = []
    used = 0
    names = sorted(p for p in folder.rglob("*.ply") if p.stat().st_size < 15_000)
    for path in [names[i] for i in np.random.default_rng(0).permutation(len(names))]:
        try:
            found = grow(Component(repair(load_mesh(path)).manifold), Concavity(0.02), middle_planes(), depth)
        except (RlacdError, ValueError):
            continue
        if any(node.outcomes for node in found):
            roots += found
            used += 1
        if used == count:
            break
    return roots


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--depth", type=int, default=4)
    parser.add_argument("--steps", type=int, default=300_000)
    given = parser.parse_args()

    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    roots = trees(given.meshes, given.count, given.depth)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    every = given.steps // 300
    for name, discount in DISCOUNTS.items():
        process = process_of(roots, alike=True, static_discount=discount)
        exact = process.solve()
        history = q_learning(process, given.steps, np.random.default_rng(0), every=every)
        at = every * np.arange(len(history))
        size = np.array([np.abs(q).max() for q in history])
        left.plot(at[size < 1e12], size[size < 1e12], label=name)
        line = f"{name}: {process.states} states, greatest |Q| {np.abs(history[-1]).max():.4g}"
        if exact is not None:
            error = [np.abs(q - exact)[process.possible].max() for q in history]
            right.plot(at, error, label=name, color=left.lines[-1].get_color())
            line += f", greatest |Q*| {np.abs(exact).max():.4g}, error {error[-1]:.4g}"
        print(line + ("" if exact is not None else ", dynamic programming diverges"))
    left.set(xscale="log", yscale="log", xlabel="steps of Q-learning", ylabel="greatest |Q|", title="all discounts")
    right.set(
        xscale="log", yscale="log", xlabel="steps of Q-learning", ylabel="greatest |Q − Q*|", title="where Q* exists"
    )
    left.legend(fontsize=6, loc="center right")
    figure.savefig(given.picture, dpi=90)


if __name__ == "__main__":
    main()
