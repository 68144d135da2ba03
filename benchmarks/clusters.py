"""What merging pairs leaves: clusters of touching parts whose joint hull, or a primitive, would be tight enough.

    python benchmarks/clusters.py MESHES --list quick.txt

Cuts and merges each mesh as `quality="fast"` does, then takes all connected clusters of two to four parts and asks of
each whether what the solid fills of its joint hull meets the criterion, and whether a primitive around it does.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from rlacd.run import Clock
from rlacd.criteria import Concavity
from rlacd.criteria.screen import Feasibility
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.io.read.load import load_mesh
from rlacd.merge.boxes import Boxes
from rlacd.merge.overlap import TOUCH
from rlacd.merge.primitives import primitive_part
from rlacd.policies import make_policy
from rlacd.primitive_kinds import PRIMITIVE_KINDS
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Part
from rlacd.solid.hull import Hull
from rlacd.run import Workers

LARGEST = 4


def count_clusters(root: Component, parts: list[Part], criterion: Concavity) -> Counter[tuple[int, str]]:
    """How many clusters there are of each size; with a tight joint hull; with a tight primitive."""
    pairs = Boxes(dict(enumerate(parts))).pairs(range(len(parts)), TOUCH).tolist()
    near: list[set[int]] = [set() for _ in parts]
    for first, second in pairs:
        near[first].add(second)
        near[second].add(first)
    found: Counter[tuple[int, str]] = Counter()
    clusters = {frozenset(pair) for pair in pairs}
    while clusters:
        larger: set[frozenset[int]] = set()
        for cluster in clusters:
            size = len(cluster)
            found[size, "clusters"] += 1
            hull = Hull.of(np.concatenate([parts[i].hull.vertices for i in cluster]))
            assert hull is not None
            if criterion.screen.forbids(root.filling, hull):
                continue
            if size < LARGEST:
                larger |= {cluster | {other} for i in cluster for other in near[i] - cluster}
            if criterion.screen.feasibility(root.filling, hull) is not Feasibility.MAYBE:
                continue
            union = root.inside(hull)
            found[size, "hulls"] += criterion.is_met(union)
            found[size, "primitives"] += primitive_part(union, criterion, PRIMITIVE_KINDS) is not union
        clusters = larger
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--list", type=Path, required=True, help="a mesh a line, relative to the folder")
    parser.add_argument("--threshold", type=float, default=0.05)
    given = parser.parse_args()
    criterion, total, count = Concavity(given.threshold), Counter[tuple[int, str]](), 0
    for name in given.list.read_text().split():
        with Workers(1) as workers:
            root = Component(repair(load_mesh(given.meshes / name), threads=1).shape)
            tree = CutTree(root, make_policy("greedy"), workers)
            parts = cut_and_merge(tree, criterion, workers, Clock(None)).parts
        total += count_clusters(root, parts, criterion)
        count += len(parts)
        print(f"{name}: {len(parts)} parts", flush=True)
    print(f"{count} parts")
    for size in range(2, LARGEST + 1):
        print(
            ", ".join([f"of {size}"] + [f"{total[size, what]} {what}" for what in ("clusters", "hulls", "primitives")])
        )


if __name__ == "__main__":
    main()
