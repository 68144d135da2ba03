"""Label planes with the parts that greedy ends in after them.

`python benchmarks/learned/labels.py MESHES OUT CPU_SECONDS [FIRST]`

For meshes of the split train, trees of cuts are grown, greedily or with a share of random cuts among the ten best. Of
up to six components of a tree that end in 4 to 60 parts, about nine planes are cut each: greedy's, that of least hull
sum, good ones apart from each other, and two random ones of the 80 best. Both sides are then completed by greedy, and
the parts counted. Shards hold eight meshes each; random numbers depend on the shard's number alone, so a run that was
interrupted goes on where it stopped, and several may begin at different shards, FIRST.
"""

from __future__ import annotations

import csv
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.criteria import Concavity, Criterion
from rlacd.cut import CutTree
from rlacd.errors import RlacdError
from rlacd.extras.criteria.navigable import Navigable
from rlacd.io.read.load import load_mesh
from rlacd.options.navigable import NavigableSpace
from rlacd.planes.sweep import SLIVERS, Sweep, SweepCache
from rlacd.policies import Greedy
from rlacd.policies.greedy import excess_norm, hull_sum
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.component import Component, Plane

A_SHARD, FACES, LEAVES, NODES, NEAR = 8, (60, 4000), (4, 60), 5, 80
THRESHOLDS = (0.03, 0.04, 0.05, 0.05)
KINDS = ("concavity", "concavity", "concavity", "navigable")
MOST, MOST_AFTER = 120, 150
LEAST_EXCESS = 5.0  # a little simpler than `SIMPLE` of the policy, in the same unit

RUN, SWEEPS, GREEDY = Run(1), SweepCache(), Greedy()


def valid_of(s: Sweep) -> NDArray[np.bool_] | None:
    """Valid planes; those that leave slivers only if there is no other."""
    return next((v for sliver in SLIVERS if (v := s.valid(sliver)).any()), None)


class Explore:
    """Greedy with a share of random cuts among the ten best."""

    def __init__(self, rng: np.random.Generator, epsilon: float) -> None:
        self.rng, self.epsilon = rng, epsilon

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose a plane."""
        if self.rng.random() >= self.epsilon:
            return GREEDY.choose(component, threads)
        s = SWEEPS.of(component)
        if (valid := valid_of(s)) is None:
            return None
        order = np.argsort(np.where(valid, excess_norm(s), np.inf), kind="stable")[: int(valid.sum())]
        return s.candidates.plane(int(order[self.rng.integers(min(10, len(order)))]))


def leaves(tree: CutTree, component: Component) -> int:
    """Number of parts below a component."""
    below = tree._children.get(component, [])
    return sum(leaves(tree, child) for child in below) if below else 1


def planes_of(s: Sweep, valid: NDArray[np.bool_], rng: np.random.Generator) -> list[int]:
    """Planes to label; greedy's is the first."""
    norm, total = excess_norm(s), hull_sum(s)
    chosen: list[int] = []

    def take(cost: NDArray[np.float64], count: int) -> None:
        for plane in np.argsort(np.where(valid, cost, np.inf), kind="stable")[: int(valid.sum())].tolist():
            if count == 0:
                return
            if all(abs(plane - other) > 1 for other in chosen):
                chosen.append(plane)
                count -= 1

    take(norm, 1)
    least = int(np.argmin(np.where(valid, total, np.inf)))
    chosen.extend([least] if least not in chosen else [])
    take(norm, 3)
    take(total, 2)
    take(np.maximum(s.hull_below - s.solid_below, s.hull_above - s.solid_above), 1)
    near = np.argsort(np.where(valid, norm, np.inf))[: min(NEAR, int(valid.sum()))]
    return chosen + [int(p) for p in rng.permutation(near)[:2] if int(p) not in chosen]


def parts_after(component: Component, plane: Plane, criterion: Criterion) -> int | None:
    """Parts that greedy ends in after a cut; None if the cut fails or a part cannot be finished."""
    below, above = component.cut(plane)
    if below is None or above is None:
        return None
    ends = [CutTree(side, GREEDY, RUN).cut_until(criterion, MOST_AFTER) for side in (below, above)]
    return None if any(left for _, left in ends) else sum(len(done) for done, _ in ends)


def listed(meshes: Path, faces: tuple[int, int]) -> list[dict[str, str]]:
    """Rows of the index of meshes: those of the split train with so many triangles, in an order of chance."""
    with open(meshes / "index.csv", encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["split"] == "train" and faces[0] <= int(r["faces"]) <= faces[1]]
    return [rows[i] for i in np.random.default_rng(7).permutation(len(rows))]


def component(s: Sweep, valid: NDArray[np.bool_], info: list[Any], rows: list[Any]) -> dict[str, Any]:
    """What a shard keeps of a component: what a network may see of all planes, and the counts of those labelled."""
    scores = [getattr(s, name) for name in list(Sweep.__dataclass_fields__)[1:]]
    return {
        "F": np.stack(scores, axis=1).astype(np.float32),
        "D": np.repeat(s.candidates.directions, s.candidates.offsets.shape[1], 0).astype(np.float32),
        "O": s.candidates.offsets.ravel().astype(np.float32),
        "valid": valid,
        "info": np.array(info),
        "rows": np.array(rows),
    }


def save(path: Path, found: list[dict[str, Any]], **more: NDArray[Any]) -> None:
    """Write a shard: its components one after the other, the rows with the number of theirs."""
    shard = {"planes": np.array([len(d["F"]) for d in found], np.int64), **more}
    if found:
        shard["info"] = np.stack([d["info"] for d in found])
        shard["rows"] = np.concatenate([np.c_[np.full(len(d["rows"]), j), d["rows"]] for j, d in enumerate(found)])
        shard |= {key: np.concatenate([d[key] for d in found]) for key in ("F", "D", "O", "valid")}
    partial = path.with_suffix(".part.npz")
    np.savez(partial, allow_pickle=False, **shard)
    os.replace(partial, path)


def labels_of(path: Path, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Label planes of a few components of a mesh."""
    kind = KINDS[rng.integers(len(KINDS))]
    threshold = float(rng.choice(THRESHOLDS)) if kind == "concavity" else 0.05
    solid = repair(load_mesh(path), threads=1)
    root = Component(solid.shape)
    space = NavigableSpace(radius=0.1, tolerance=0.02)
    criterion: Criterion = Concavity(threshold) if kind == "concavity" else Navigable.of(space, solid, 1)
    if criterion.is_met(root):
        return []
    tree = CutTree(root, Explore(rng, float(rng.choice([0, 0.3]))), RUN)
    if tree.cut_until(criterion, MOST)[1]:
        return []
    cut = [c for c, below in tree._children.items() if len(below) == 2 and not criterion.is_met(c)]
    nodes = [c for c in cut if LEAVES[0] <= leaves(tree, c) <= LEAVES[1] and len(c.pieces()) == 1]
    nodes = [c for c in nodes if np.cbrt(max(c.hull.volume - c.volume, 0)) > LEAST_EXCESS * threshold]
    nodes.sort(key=lambda c: -leaves(tree, c))
    nodes = nodes[:1] + [nodes[i] for i in rng.permutation(len(nodes) - 1)[:NODES] + 1] if len(nodes) > 1 else nodes
    found = []
    for node in nodes:
        s = SWEEPS.of(node)
        if (valid := valid_of(s)) is None:
            continue
        tried = [(p, parts_after(node, s.candidates.plane(p), criterion)) for p in planes_of(s, valid, rng)]
        rows = [(p, n) for p, n in tried if n is not None]
        if len(rows) < 2:
            continue
        box = [*np.ptp(node.box, axis=0), *node.box.mean(axis=0)]
        info = [node.hull.volume, node.volume, *box, threshold, kind == "navigable", len(node.faces)]
        found.append(component(s, valid, info, rows))
    return found


def shard(meshes: Path, names: list[str], number: int, path: Path) -> None:
    """Label the meshes of a shard."""
    got: list[dict[str, Any]] = []
    files: list[str] = []
    for i in range(A_SHARD):
        name = names[(number * A_SHARD + i) % len(names)]
        try:
            got += labels_of(meshes / name, np.random.default_rng([number, i]))
        except (RlacdError, ValueError):  # flat or empty
            continue
        files += [name] * (len(got) - len(files))
    save(path, got, files=np.array(files))


def main() -> None:
    """Write shards until the CPU time is spent."""
    meshes, out, limit = Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
    out.mkdir(parents=True, exist_ok=True)
    names = [row["file"] for row in listed(meshes, FACES)]
    number = int(sys.argv[4]) if len(sys.argv) > 4 else 0
    while time.process_time() < limit:
        path = out / f"{number:05d}.npz"
        if not path.exists():
            shard(meshes, names, number, path)
        number += 1


if __name__ == "__main__":
    main()
