"""Expert iteration: label planes with the merged parts of the whole solid that greedy ends in after them; fit to these.

`python -m benchmarks.learned.whole MESHES LABELS MINUTES [--held-out SET] [--out FOLDER]`

Of meshes of the split train that greedy-162 cuts into 12 to 40 parts, up to six components of its tree are cut each by
up to seven planes that a network can force by the paper's rule: those of less hull sum than all of reflex edges, and
the best of these. The component is completed, the rest of the solid stays, and the whole is merged. Of every third
component, all is completed and merged once more by greedy over 24 planes an axis: how far one completion tells of
another bounds what can be learned. Every third mesh is of the collection held out. A shard holds a mesh; its random
numbers depend on the shard alone, so an interrupted run goes on where it stopped.

Then networks are fitted to the labels, as `fit.py` does, and what their plane saves on the collection held out, and in
five folds by mesh, is printed, against the plane of least hull sum; beside it, what the best labelled plane saves by
its own completion and by the other. `compare.py` deploys what is written to FOLDER as ``forcing:FOLDER``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.learned.fit import FOLDS, Labels, features_of, fit
from benchmarks.learned.labels import component, leaves, listed, save, valid_of
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.environment import CutCache
from rlacd.merge.numbered import NumberedParts
from rlacd.merge.unite import ByGrowth, united
from rlacd.planes.candidates import EDGES_PER_COMPONENT, all_planes
from rlacd.planes.sweep import Sweep, sweep
from rlacd.policies import Greedy, Policy
from rlacd.policies.greedy import excess_norm, hull_sum, paper_planes_and_edges
from rlacd.policies.learned import LEAST_GAIN, NAMES
from rlacd.policies.network import Network
from rlacd.policies.plane_features import PLANES, plane_features
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray
from rlacd.solid.component import Component, Plane

FACES, PARTS, LEAVES, NODES, TRIED, NEAR, MOST = (60, 700), (12, 40), 3, 6, 7, 60, 120
THRESHOLD = 0.05
COUNTS = ("raw", "neighbours", "merged")
RUN = Run(1)
GREEDY = Greedy("hull-sum", planes=paper_planes_and_edges)
CHANCE = Greedy("hull-sum", planes=lambda component: all_planes(component, 24, EDGES_PER_COMPONENT))


def forceable(s: Sweep, valid: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Planes that a network can force by the paper's rule, that of least hull sum first."""
    cost = np.where(valid, hull_sum(s), np.inf)
    edge = PLANES + int(cost[PLANES:].argmin()) if len(cost) > PLANES else -1
    order = np.argsort(cost[:PLANES], kind="stable")
    order = order[cost[order] < (cost[edge] if edge >= 0 else np.inf)]
    return np.append(order, edge) if edge >= 0 and np.isfinite(cost[edge]) else order


class Forcing:
    """The paper's rule with networks whose mean forces the plane of least predicted parts."""

    def __init__(self, networks: Sequence[Network]) -> None:
        self._networks = networks

    def choose(self, component: Component, threads: int = 1) -> Plane | None:
        """Choose a plane."""
        s = sweep(component, paper_planes_and_edges(component))
        if (valid := valid_of(s)) is None:
            return None
        planes = forceable(s, valid)
        planes = np.append(planes[:NEAR], planes[NEAR:][-1:])  # the edge's is the last
        volumes = component.hull.volume, component.volume
        seen = plane_features(s, valid, *volumes, np.ptp(component.box, axis=0), THRESHOLD)[planes].astype(np.float32)
        predicted = np.mean([network(seen)[:, 0] for network in self._networks], axis=0)
        best = int(predicted.argmin())
        return s.candidates.plane(int(planes[best if predicted[best] < predicted[0] - LEAST_GAIN else 0]))


def tried_of(s: Sweep, planes: NDArray[np.intp], rng: np.random.Generator) -> list[int]:
    """Planes to label, apart from each other; that of least hull sum comes first, then the edge's."""
    chosen = [int(planes[0])]
    chosen += [int(planes[-1])] if planes[-1] >= PLANES and planes[-1] != planes[0] else []
    free = planes[planes < PLANES][:NEAR]
    for order, count in (
        (free, 2),
        (free[np.argsort(excess_norm(s)[free], kind="stable")], 2),
        (rng.permutation(free), 2),
    ):
        for plane in order.tolist():
            if count == 0 or len(chosen) == TRIED:
                break
            if all(abs(plane - other) > 1 for other in chosen):
                chosen.append(plane)
                count -= 1
    return chosen


class Completions:
    """Components completed by a policy, and wholes merged."""

    def __init__(self, tree: CutTree, policy: Policy, cache: CutCache) -> None:
        self._tree, self._policy, self._cache = tree, policy, cache
        self._known: dict[Component, list[Component]] = {}
        self._parent = {child: c for c, below in tree._children.items() for child in below}

    def parts(self, component: Component) -> list[Component]:
        """The parts that a component ends in."""
        if component not in self._known:
            tree = CutTree(component, self._policy, RUN)
            done, left = tree.cut_until(Concavity(THRESHOLD), MOST)
            self._known[component] = done + left
        return self._known[component]

    def rest(self, component: Component) -> list[Component]:
        """The parts of all that is not below a component of the tree."""
        if (parent := self._parent.get(component)) is None:
            return []
        beside = [
            part for other in self._tree._children[parent] if other is not component for part in self.parts(other)
        ]
        return self.rest(parent) + beside

    def whole(self, node: Component, plane: Plane) -> list[int] | None:
        """Raw parts, after NavACD's merging, and after all merging, of the whole solid; None if nothing is cut."""
        if not (sides := self._cache.sides(node, plane)):
            return None
        return counts_of(self.rest(node) + [part for side in sides for part in self.parts(side)])


def counts_of(pieces: list[Component]) -> list[int]:
    """Raw parts, after NavACD's merging, and after all merging."""
    settled, counts = Concavity(THRESHOLD).settled(pieces), [len(pieces)]
    alive = NumberedParts(pieces, settled)
    for across in (False, True):  # as `merge_parts` does
        for _ in united(alive, ByGrowth(settled, across), RUN.work, RUN):
            pass
        counts.append(len(alive.parts))
    return counts


def planned(root: Component) -> list[Component]:
    """The parts if each component is cut by the plane after which greedy leaves the whole in fewest merged parts."""
    cache, rng, left, done = CutCache(), np.random.default_rng(0), [root], list[Component]()
    greedy = Completions(CutTree(root, GREEDY, RUN), GREEDY, cache)
    while left:
        node = left.pop(int(np.argmax([c.hull.volume for c in left])))
        if Concavity(THRESHOLD).is_met(node):
            done.append(node)
            continue
        if (pieces := cache.pieces(node)) != [node]:
            left += pieces
            continue
        s, rest = sweep(node, paper_planes_and_edges(node)), [*done]
        valid = valid_of(s)
        planes = [] if valid is None else tried_of(s, forceable(s, valid), rng)
        tried = [sides for plane in planes if (sides := cache.sides(node, s.candidates.plane(plane)))]
        if not tried:
            done += greedy.parts(node)
            continue
        if len(tried) > 1:
            rest += [part for other in left for part in greedy.parts(other)]
            counts = [counts_of(rest + [part for side in sides for part in greedy.parts(side)]) for sides in tried]
            tried = [tried[counts.index(min(counts, key=lambda c: c[::-1]))]]
        left += tried[0]
    return done


def labels_of(path: Path, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Label planes of a few components of a mesh."""
    root, cache = Component(repair(load_mesh(path), threads=1).shape), CutCache()
    tree = CutTree(root, GREEDY, RUN)
    done, left = tree.cut_until(Concavity(THRESHOLD), PARTS[1])
    if left or not PARTS[0] <= len(done) <= PARTS[1]:
        return []
    nodes = [c for c, below in tree._children.items() if len(below) == 2 and cache.pieces(c) == [c]]
    nodes = sorted((c for c in nodes if leaves(tree, c) >= LEAVES), key=lambda c: -leaves(tree, c))
    nodes = nodes[:1] + [nodes[i + 1] for i in rng.permutation(max(len(nodes) - 1, 0))[: NODES - 1]]
    own, chance = Completions(tree, GREEDY, cache), Completions(tree, CHANCE, cache)
    found = []
    for number, node in enumerate(nodes):
        s = sweep(node, paper_planes_and_edges(node))
        if (valid := valid_of(s)) is None:
            continue
        planes = tried_of(s, forceable(s, valid), rng)
        twice = (number + int(rng.integers(3))) % 3 == 0
        rows = []
        for plane in planes if len(planes) > 1 else []:
            ends = own.whole(node, s.candidates.plane(plane))
            again = chance.whole(node, s.candidates.plane(plane)) if twice else [0, 0, 0]
            if ends and again:
                rows.append([plane, *ends, *again])
        if not rows or rows[0][0] != planes[0]:
            rows = [[planes[0], 0, 0, 0, 0, 0, 0]]  # a network has no say
        info = [
            node.hull.volume,
            node.volume,
            *np.ptp(node.box, axis=0),
            leaves(tree, node),
            len(done),
            len(node.faces),
        ]
        found.append(component(s, valid, [*info, root.hull.volume], rows))
    return found


def names_of(meshes: Path, held_out: str) -> list[str]:
    """Meshes in the order they are labelled: every third is of the collection held out."""
    rows = listed(meshes, FACES)
    inside, others = ([r["file"] for r in rows if (r["set"] == held_out) is here] for here in (True, False))
    names = [name for i, one in enumerate(inside) for name in (*others[2 * i : 2 * i + 2], one)]
    return names + others[2 * len(inside) :]


def label(meshes: Path, out: Path, minutes: float, held_out: str) -> None:
    """Write shards until the time is over."""
    out.mkdir(parents=True, exist_ok=True)
    end = time.monotonic() + 60 * minutes
    for number, name in enumerate(names_of(meshes, held_out)):
        path = out / f"{number:05d}.npz"
        if path.exists():
            continue
        if time.monotonic() > end:
            break
        try:
            got = labels_of(meshes / name, np.random.default_rng([11, number]))
        except (RlacdError, ValueError):  # flat or empty
            got = []
        save(path, got, mesh=np.array(name))


@dataclass(frozen=True, eq=False)
class Whole:
    """Labels by log(merged parts); log of all counts [L, 2, 3] by both completions, -inf of what is not completed
    again; whether each component [C] is of the collection held out; how many components had one plane alone.
    """

    labels: Labels
    counts: FloatArray
    held_out: NDArray[np.bool_]
    without_say: int

    @classmethod
    def read(cls, folder: Path, held_out: str) -> Whole:
        """Read the shards of a folder."""
        features, counts, sizes, of, without, names = [], [], [], [], 0, []
        for path in sorted(folder.glob("*[0-9].npz")):
            with np.load(path, allow_pickle=False) as file:
                shard = dict(file)
            names.append(str(shard["mesh"]))
            for i, end in enumerate(np.cumsum(shard["planes"])):
                rows, info = shard["rows"][shard["rows"][:, 0] == i, 1:], shard["info"][i]
                without += len(rows) == 1
                if len(rows) == 1:
                    continue
                here = slice(end - shard["planes"][i], end)
                features.append(features_of(shard, here, info, THRESHOLD)[rows[:, 0]])
                counts.append(rows[:, 1:].reshape(-1, 2, 3))
                sizes.append(len(rows))
                of.append(len(names) - 1)
        with np.errstate(divide="ignore"):
            logs = np.log(np.concatenate(counts))
        begin, inside = np.concatenate([[0], np.cumsum(sizes)]), np.array([f"/{held_out}/" in n for n in names])
        return cls(Labels(np.concatenate(features), logs[:, 0, 2], begin, np.array(of)), logs, inside[of], without)

    def says(self, chosen: NDArray[np.intp], components: NDArray[np.intp], by: int = 0) -> str:
        """Change of the logarithms of the counts if rows [C] are chosen, with 95 % intervals by resampling meshes."""
        change = self.counts[chosen[components], by] - self.counts[self.labels.begin[components], by]
        _, mesh = np.unique(self.labels.mesh[components], return_inverse=True)
        sums, sizes = np.zeros((mesh.max() + 1, 3)), np.bincount(mesh)
        np.add.at(sums, mesh, change)
        drawn = np.random.default_rng(0).integers(len(sizes), size=(2000, len(sizes)))
        low, high = np.quantile(sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1)[:, None], (0.025, 0.975), axis=0)
        means = zip(COUNTS, change.mean(axis=0), low, high, strict=True)
        other = np.mean(chosen[components] != self.labels.begin[components])
        return "  ".join([f"{other:.2f} changed", *(f"{n} {m:+.4f} ({a:+.4f} to {b:+.4f})" for n, m, a, b in means)])

    def least(self, cost: FloatArray, least: float = 0.0) -> NDArray[np.intp]:
        """The row of least cost of each component; its first unless that costs more by `least`."""
        ends = zip(self.labels.begin[:-1], self.labels.begin[1:], strict=True)
        return np.array([a + (j if cost[a + (j := int(cost[a:b].argmin()))] < cost[a] - least else 0) for a, b in ends])

    def report(self) -> None:
        """Print what is labelled, how far two completions agree, and what the best labelled planes save by each."""
        every, twice = np.arange(len(self.held_out)), np.flatnonzero(self.counts[self.labels.begin[:-1], 1, 0] > 0)
        of, inside = (len({*self.labels.mesh[c]}) for c in (every, self.held_out))
        print(f"{len(self.counts)} planes of {len(every)} components of {of} meshes, {inside} of them held out")
        print(f"{self.without_say} more components in which a network has no say")
        rows = np.concatenate([np.arange(*self.labels.begin[c : c + 2]) for c in twice])
        owner = np.repeat(np.arange(len(twice)), np.diff(self.labels.begin)[twice])
        both, sizes = self.counts[rows], np.bincount(owner)
        for i, name in enumerate(COUNTS):
            a, b = (y - (np.bincount(owner, y) / sizes)[owner] for y in (both[:, 0, i], both[:, 1, i]))
            agree = (a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum())
            print(f"{name}: two completions correlate by {agree:.3f} within components (deviation {a.std():.3f})")
        for i in (1, 2):
            for by in (0, 1):
                says = (
                    self.says(self.least(self.counts[:, by, i]), twice),
                    self.says(self.least(self.counts[:, by, i]), twice, 1),
                )
                print(f"least {COUNTS[i]} by completion {by}, counted by 0: {says[0]}\n{'counted by 1':>40}: {says[1]}")

    def learned(self, target: int, outside: NDArray[np.intp], share: float) -> None:
        """Print what networks save that are fitted to one of the counts, from a share of the meshes."""
        labels, every = replace(self.labels, parts=self.counts[:, 0, target]), np.arange(len(self.held_out))
        seen = np.random.default_rng(1).random(labels.mesh.max() + 1)[labels.mesh] < share
        fold = np.random.default_rng(0).permutation(labels.mesh.max() + 1)[labels.mesh] % FOLDS
        inputs, folded = labels.features.astype(np.float32), np.zeros(len(labels.parts))

        def predicted(known: NDArray[np.intp], seeds: int) -> FloatArray:
            nets = [fit(labels, known[seen[known]], seed) for seed in range(seeds)]
            return np.asarray(np.mean([net(inputs)[:, 0] for net in nets], axis=0), dtype=np.float64)

        own = predicted(outside, len(NAMES))
        for k in range(FOLDS):
            here = (fold == k).repeat(np.diff(labels.begin))
            folded[here] = predicted(np.flatnonzero(fold != k), 2)[here]
        print(f"\nfitted to {COUNTS[target]} of {share:.0%} of the meshes")
        for least in (0.0, LEAST_GAIN):
            inside = np.flatnonzero(self.held_out)
            print(f"  from {least} on, held out:   {self.says(self.least(own, least), inside)}")
            print(f"  from {least} on, learned:    {self.says(self.least(own, least), outside)}")
            print(f"  from {least} on, five folds: {self.says(self.least(folded, least), every)}")


def parser() -> argparse.ArgumentParser:
    """What the command takes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("labels", type=Path)
    parser.add_argument("minutes", type=float)
    parser.add_argument("--held-out", default="kaykit_cc0")
    parser.add_argument("--out", type=Path)
    return parser


def main() -> None:
    """Label, fit and report."""
    args = parser().parse_args()
    torch.set_num_threads(1)
    label(args.meshes, args.labels, args.minutes, args.held_out)
    whole = Whole.read(args.labels, args.held_out)
    whole.report()
    outside = np.flatnonzero(~whole.held_out)
    for target in range(len(COUNTS)):
        whole.learned(target, outside, 1.0)
    for share in (0.25, 0.5):
        whole.learned(len(COUNTS) - 1, outside, share)
    for seed, name in enumerate(NAMES if args.out else ()):
        args.out.mkdir(parents=True, exist_ok=True)
        (args.out / name).write_bytes(fit(whole.labels, outside, seed).to_bytes())


if __name__ == "__main__":
    main()
