"""Compare policies on meshes: `python benchmarks/learned/compare.py MESHES OUT.jsonl [--split test] [--sets SET] ...`.

For each mesh, policy and criterion: parts before merging, after merging neighbours (as NavACD does) and after all
merging, and the CPU seconds of cutting. A criterion is a concavity threshold, or radius and tolerance of navigable
space: ``0.05,0.01``. A policy is a name that ``decompose`` takes; ``learned:FOLDER``, with the networks that ``fit.py``
wrote there; ``forcing:FOLDER``, with those of `whole.py`, by the paper's rule; the paper's deployment of a network with
other planes, ``planes:[ap=N:][ce=N:][no-spatial:][no-principal:]FILE.npz``; or ``half:SEED``, greedy-162 over a random
half of the planes; or ``planned``, by what `whole.py` labels with. A run that was interrupted goes on where it stopped.
In the end, means, and geometric means of the ratios to the first policy's numbers with 95% intervals by resampling
meshes; the same of the fewest parts that any of the policies leaves a mesh in.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import Ratio
from rlacd.criteria import Concavity, Criterion
from rlacd.cut import CutTree
from rlacd.errors import OptionError, RlacdError
from rlacd.extras.criteria.navigable import Navigable
from rlacd.io.read.load import load_mesh
from rlacd.merge import merge_parts
from rlacd.options.navigable import NavigableSpace
from rlacd.planes.candidates import EDGES_PER_COMPONENT, OFFSETS_PER_AXIS
from rlacd.planes.sweep import SweepCache, distinct_planes, paper_planes, valid_planes
from rlacd.policies import Greedy, Policy, make_policy
from rlacd.policies.greedy import least_hulls
from rlacd.policies.learned import Learned, networks_in
from rlacd.policies.network import SHORTLIST, QFunction, best_planes, q_values
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.arrays import BoolArray
from rlacd.solid.component import Component, Plane
from rlacd.solid.solid import Solid

MOST_PARTS = 500
"""Meshes of which the first policy makes more parts are left out."""

FEWEST = "fewest of all"


def criterion_of(name: str, solid: Solid) -> tuple[Criterion, float | None]:
    """Get a criterion, and its length if it has one."""
    if "," in name:
        radius, tolerance = map(float, name.split(","))
        return Navigable.of(NavigableSpace(radius=radius, tolerance=tolerance), solid, 1), None
    return Concavity(float(name)), float(name)


def policy_of(name: str, length: float | None) -> Policy:
    """Get a policy by its name, or a deployment."""
    if name.startswith("half:"):
        return Greedy("hull-sum", SweepCache(seed=[int(name.removeprefix("half:"))]))
    if name.startswith("forcing:"):
        from benchmarks.learned.whole import Forcing  # needs torch

        return Forcing(networks_in(Path(name.removeprefix("forcing:"))))
    if name.startswith("learned:"):
        return Learned(scale=length, networks=networks_in(Path(name.removeprefix("learned:"))))
    if not name.startswith("planes:"):
        return make_policy(name, scale=length)
    _, *words, path = name.split(":")
    given = dict(word.partition("=")[::2] for word in words)
    if not given.keys() <= {"ap", "ce", "no-spatial", "no-principal"}:
        raise OptionError(f"{name} is not known; there are planes:[ap=N:][ce=N:][no-spatial:][no-principal:]FILE.npz.")
    exists = np.repeat(["no-spatial" not in given, "no-principal" not in given], 3 * OFFSETS_PER_AXIS)
    counts = int(given.get("ap", SHORTLIST)), int(given.get("ce", EDGES_PER_COMPONENT))
    return Deployment(q_values(path, length), exists, *counts)


@dataclass(frozen=True)
class Deployment:
    """The paper's rule, as `rlacd.policies.network.QPolicy`, of the planes that exist; ties go to the sweep's first."""

    values: QFunction
    exists: BoolArray
    planes: int
    edges: int

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose a plane."""
        candidates = paper_planes(component)
        valid = (distinct_planes if self.exists.all() else valid_planes)(component, candidates)
        best = best_planes(self.values(component), self.exists & valid, self.planes)
        return least_hulls(component, candidates, np.sort(best), self.edges, threads)


def measure(
    solid: Solid, policy: str, criterion: tuple[Criterion, float | None], merge: bool
) -> dict[str, float] | None:
    """Cut and merge; None if there is nothing to cut, or too many parts."""
    decides, length = criterion
    root = Component(solid.shape)
    if decides.is_met(root):
        return None
    with Run(1) as run:
        begin = time.process_time()
        if policy == "planned":
            from benchmarks.learned.whole import planned  # needs torch

            done, left = planned(root), list[Component]()
        else:
            done, left = CutTree(root, policy_of(policy, length), run).cut_until(decides, MOST_PARTS)
        row = {"cut_s": time.process_time() - begin, "raw": float(len(done) + len(left))}
        if left and row["raw"] >= MOST_PARTS:
            return None
        if merge:
            pieces = [*done, *left]
            settled = decides.settled(pieces)
            row["navacd"] = float(len(merge_parts(pieces, settled, run, across=False)))
            row["merged"] = float(len(merge_parts(pieces, settled, run)))
    return row


def parts_of(rows: list[dict[str, Any]], policy: str) -> dict[tuple[str, str], float]:
    """Raw parts of a policy by mesh and criterion; 0 where there is nothing to cut."""
    return {(r["file"], r["criterion"]): r.get("raw", 0) for r in rows if r["policy"] == policy}


def summary(rows: list[dict[str, Any]], policies: list[str], criteria: list[str]) -> None:
    """Print the ratios."""
    for criterion in criteria:
        of = {(r["file"], r["policy"]): r for r in rows if r["criterion"] == criterion and "raw" in r}
        names = [f for f in dict.fromkeys(f for f, _ in of) if all((f, p) in of for p in policies)]
        for f in names:
            of[f, FEWEST] = {k: min(of[f, p].get(k, 0) for p in policies) for k in ("raw", "navacd", "merged")}
        for policy in [*policies, FEWEST] if names else ():
            for key in ("raw", "navacd", "merged", "cut_s"):
                pairs = [(of[f, policy].get(key), of[f, policies[0]].get(key)) for f in names]
                shared = [(a, b) for a, b in pairs if a and b]
                if shared:
                    own, first = zip(*shared, strict=True)
                    print(
                        f"{criterion:9s} {policy:22s} {key:6s} {Ratio.of(own, first)}  of totals "
                        f"{sum(own) / sum(first):.3f}  mean {np.mean(own):.4g}  {len(own)} meshes"
                    )


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--split", default="test")
    parser.add_argument("--sets", nargs="+", help="collections; all of the split by default")
    parser.add_argument("--count", type=int, default=10**6)
    parser.add_argument("--faces", type=int, default=10**6)
    parser.add_argument(
        "--parts", type=int, nargs=2, default=(0, MOST_PARTS), help="meshes of so many, raw, by the first policy"
    )
    parser.add_argument("--merge", action="store_true")
    parser.add_argument("--criteria", nargs="+", default=["0.05"])
    parser.add_argument("--policies", nargs="+", default=["greedy-hull-sum+edges", "greedy", "learned"])
    return parser


def main() -> None:
    """Measure what is missing and print the summary."""
    args = parser().parse_args()
    with open(args.meshes / "index.csv", encoding="utf-8") as file:
        listed = [r for r in csv.DictReader(file) if r["split"] == args.split and r["set"] in (args.sets or [r["set"]])]
    names = sorted((int(r["faces"]), r["file"]) for r in listed if int(r["faces"]) <= args.faces)
    names = [names[i] for i in np.sort(np.random.default_rng(0).permutation(len(names))[: args.count])]
    rows = [json.loads(line) for line in args.out.read_text().splitlines()] if args.out.exists() else []
    known = {(r["file"], r["policy"], r["criterion"]) for r in rows}
    first, (least, most) = parts_of(rows, args.policies[0]), args.parts
    with open(args.out, "a") as out:
        for _, name in names:
            wanted = [(p, c) for c in args.criteria for p in args.policies if (name, p, c) not in known]
            try:
                solid = repair(load_mesh(args.meshes / name), threads=1) if wanted else None
            except RlacdError:
                continue
            made: dict[str, tuple[Criterion, float | None]] = {}
            for policy, criterion in wanted:
                assert solid is not None
                if policy != args.policies[0] and not least <= first.get((name, criterion), least) <= most:
                    continue
                row = {"file": name, "policy": policy, "criterion": criterion}
                made[criterion] = made.get(criterion) or criterion_of(criterion, solid)
                row |= measure(solid, policy, made[criterion], args.merge) or {}
                rows.append(row)
                first |= parts_of([row], args.policies[0])
                print(json.dumps(row), file=out, flush=True)
    summary(rows, args.policies, args.criteria)


if __name__ == "__main__":
    main()
