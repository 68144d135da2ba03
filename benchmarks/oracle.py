"""What the paper's objective can give: its best trees of cuts, and those of fewest parts, beside greedy's.

Discounts are shares of the hull (eq. 9), so their product down to a component is |CH(m_i)| / |CH(m)|, and the return of
a whole tree is a sum over its cuts: of |CH(m_i)| (|CH(m_i)| - |CH(m_l)| - |CH(m_r)|) / |CH(m)|^2 for r1, and, for the
last of them, |CH(m_last)| / |CH(m)| r2. The order of cuts is free, as in the paper, so any cut that finishes its
component can be the last. No tree of m_i saves more than its excess, |CH(m_i)| - |m_i|: that bounds what is left.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path

import click
import numpy as np

from benchmarks.cli import OUT, PATH, write
from benchmarks.runner import find_meshes
from benchmarks.store import Row, Task, load_row, save_row
from benchmarks.tables import Page, Ratio, Table
from rlacd.cli.exit_codes import exit_codes
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.environment import CutEnv, Memory, terminal_reward
from rlacd.merge import merge_parts
from rlacd.planes.candidates import reflex_edge_planes
from rlacd.planes.sweep import paper_planes, sweep, valid_planes
from rlacd.policies import make_policy
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.solid.component import Component, Plane
from rlacd.solid.solid import Solid

SHORTLIST = 10
"""Planes of least hull sum that are tried, beside those of reflex edges: what the paper's rule chooses among."""

PARTS = range(4, 13)
"""Parts by greedy-162 of the solids that are looked at."""

TREES = {"greedy": "greedy-162", "fewest": "fewest parts found", "r1": "best by r1", "r1+r2": "best by r1 and r2"}

REST, LAST = 0, 1
"""Whether the solid's last cut is among a component's: only then r2 is earned there."""


@dataclass(eq=False)
class Choice:
    """A cut: what it earns for r1, in units of |CH(m)|^2, and the unfinished components that it leaves."""

    earns: float
    finished: list[Component]
    left: list[Node]


@dataclass(eq=False)
class Node:
    """An unfinished component, and intervals of what its best tree earns without and with the last cut."""

    component: Component
    share: float
    low: list[float]
    high: list[float]
    least: int = 2
    choices: list[Choice] | None = None
    fewest: list[Component] = field(default_factory=list)

    def end(self, which: str) -> list[float]:
        """Of the intervals, the ends called low or high."""
        return self.low if which == "low" else self.high


@dataclass(frozen=True, eq=False)
class Tree:
    """A tree of cuts: its parts, what r1 earns, the share of the last component cut, and whether it is proved best."""

    parts: list[Component]
    earned: float
    last: float
    proved: bool

    @classmethod
    def of(cls, choice: Choice, below: Sequence[Tree], last: float, proved: bool) -> Tree:
        """Join a cut and the trees below it."""
        parts = [*choice.finished, *(part for tree in below for part in tree.parts)]
        earned = choice.earns + sum(tree.earned for tree in below)
        return cls(parts, earned, last, proved and all(tree.proved for tree in below))

    @property
    def whole(self) -> float:
        """The return with r2."""
        return self.earned + self.last * terminal_reward(len(self.parts))


class Oracle:
    """The trees of cuts of one connected solid.

    Parameters
    ----------
    solid : Component
    criterion : Concavity
    run : Run
    budget : int
        Components that may be cut by all their planes to find the fewest parts.
    """

    def __init__(self, solid: Component, criterion: Concavity, run: Run, budget: int) -> None:
        self._criterion, self._run, self._memory, self.budget = criterion, run, Memory(), budget
        self._hull, self._finish, self.expanded = solid.hull.volume, 1.0, 0
        self._nodes: dict[tuple[float, ...], Node] = {}
        self._greedy = make_policy("greedy-hull-sum+edges")
        self.roots = [self._node(c) for c in CutEnv(solid, criterion, self._memory).unfinished]

    def fewest(self, node: Node) -> None:
        """Find fewer parts: greedy from every choice first, then all trees of at most so many parts."""
        self._look_ahead(node)
        try:
            while node.least < len(node.fewest):
                if (parts := self._within(node, node.least)) is not None:
                    node.fewest = parts
        except OutOfBudgetError:
            pass

    def best(self, node: Node, finish: float, mode: int = LAST, tries: int = 15) -> Tree:
        """The tree of greatest return.

        Parameters
        ----------
        finish : float
            r2 of the whole solid; 0 leaves it out.
        mode : int
            `REST` or `LAST`.
        tries : int
            Components that may be expanded to prove one choice.
        """
        if finish != self._finish:
            self._finish = finish
            for known in self._nodes.values():
                known.low[LAST], known.high[LAST] = 0.0, self._most(known)[LAST]
        choice, proved = self._decide(node, mode, tries)
        heir = self._heir(choice, "low") if mode == LAST and choice.left else None
        below = [self.best(child, finish, LAST if child is heir else REST, tries) for child in choice.left]
        last = node.share if mode == LAST and not below else max((tree.last for tree in below), default=0.0)
        return Tree.of(choice, below, last, proved)

    def greedy(self, node: Node) -> Tree:
        """The tree of the least hull sum at every component; the largest component that a cut finishes is the last."""
        choice = max(self._expanded(node), key=lambda c: c.earns)
        below = [self.greedy(child) for child in choice.left]
        return Tree.of(choice, below, max((tree.last for tree in below), default=node.share), proved=True)

    # Trees of greatest return: the most promising tree is expanded until one choice is proved (AO*)

    def _decide(self, node: Node, mode: int, tries: int) -> tuple[Choice, bool]:
        for _ in range(tries):
            choices = self._expanded(node)
            first = max(choices, key=lambda c: (self._value(node, c, mode, "low"), self._value(node, c, mode, "high")))
            others = max((self._value(node, c, mode, "high") for c in choices if c is not first), default=-math.inf)
            if self._value(node, first, mode, "low") >= others - 1e-12:
                return first, True
            if not self._refine(node, mode):
                break
        return first, False

    def _refine(self, node: Node, mode: int) -> bool:
        """Expand a component of the most promising tree; False if it is known whole."""
        if node.choices is None:
            self._expanded(node)
        else:
            open_ = [c for c in node.choices if any(k.high[m] > k.low[m] for k in c.left for m in (REST, LAST))]
            if not open_:
                return False
            choice = max(open_, key=lambda c: self._value(node, c, mode, "high"))
            heir = self._heir(choice, "high") if mode == LAST else None
            modes = {child: LAST if child is heir else REST for child in choice.left}
            child = max(choice.left, key=lambda k: k.high[modes[k]] - k.low[modes[k]])
            if not self._refine(child, modes[child]):
                child.low[modes[child]] = child.high[modes[child]]
        for m in (REST, LAST):
            for end in ("low", "high"):
                node.end(end)[m] = max(self._value(node, c, m, end) for c in self._expanded(node))
        return True

    def _value(self, node: Node, choice: Choice, mode: int, end: str) -> float:
        total = choice.earns + sum(child.end(end)[REST] for child in choice.left)
        if mode == REST:
            return total
        if not choice.left:
            return total + node.share * self._finish
        heir = self._heir(choice, end).end(end)
        return total + heir[LAST] - heir[REST]

    @staticmethod
    def _heir(choice: Choice, end: str) -> Node:
        """The child that gains most by the last cut."""
        return max(choice.left, key=lambda k: k.end(end)[LAST] - k.end(end)[REST])

    # Trees of fewest parts

    def _look_ahead(self, node: Node) -> list[Component]:
        """Greedy after the choice from which greedy leaves the fewest parts, and so on below it."""
        if node.least >= len(node.fewest) > 0 or self.budget <= 0:
            return node.fewest or self.finished_greedily(node)
        best = min(self._expanded(node), key=lambda c: len(c.finished) + sum(map(self._count, c.left)))
        parts = [*best.finished, *(part for child in best.left for part in self._look_ahead(child))]
        if not node.fewest or len(parts) < len(node.fewest):
            node.fewest = parts
        return node.fewest

    def _count(self, node: Node) -> int:
        return len(self.finished_greedily(node))

    def finished_greedily(self, node: Node) -> list[Component]:
        if not node.fewest:
            tree = CutTree(node.component, self._greedy, self._run, self._memory.cache)
            done, left = tree.cut_until(self._criterion, 200)
            node.fewest = done + left
        return node.fewest

    def _within(self, node: Node, most: int) -> list[Component] | None:
        """A tree of at most so many parts; None if there is none, which is noted."""
        if most < node.least:
            return None
        if len(self.finished_greedily(node)) <= most:
            return node.fewest
        for choice in self._expanded(node):
            parts = list(choice.finished)
            spare = most - len(parts) - sum(child.least for child in choice.left)
            for child in sorted(choice.left, key=lambda k: k.share):
                before = child.least
                found = next((p for n in range(spare + 1) if (p := self._within(child, before + n)) is not None), None)
                if spare < 0 or found is None:
                    break
                spare -= len(found) - before
                parts += found
            else:
                if spare >= 0:
                    node.fewest = parts
                    return parts
        node.least = most + 1
        return None

    # Components

    def _node(self, component: Component) -> Node:
        """The same for the same piece, however it was reached."""
        key = key_of(component)
        if key not in self._nodes:
            node = self._nodes[key] = Node(component, component.hull.volume / self._hull, [0.0, 0.0], [0.0, 0.0])
            node.high = self._most(node)
        return self._nodes[key]

    def _most(self, node: Node) -> list[float]:
        saved = node.share * max(node.component.hull.volume - node.component.volume, 0.0) / self._hull
        return [saved, saved + node.share * self._finish]

    def _expanded(self, node: Node) -> list[Choice]:
        if node.choices is None:
            if self.budget <= 0:
                raise OutOfBudgetError
            self.budget -= 1
            self.expanded += 1
            node.choices = list(self._cuts(node))
            for m in (REST, LAST):
                node.high[m] = min(node.high[m], max(self._value(node, c, m, "high") for c in node.choices))
        return node.choices

    def _cuts(self, node: Node) -> Iterator[Choice]:
        """Cut a component by each of its planes, least hull sum first; outcomes that no plane can finish last."""
        seen, stuck = set(), []
        for plane in planes_of(node.component):
            cutting = CutEnv(node.component, self._criterion, self._memory)
            cut = cutting.step(node.component, plane)
            left = [self._node(child) for child in cut.left.unfinished]
            outcome = tuple(sorted(map(key_of, cut.left.all)))
            if outcome in seen or cut.left.stuck == [node.component]:
                continue
            seen.add(outcome)
            earns = node.share**2 * cut.saved  # `saved` is relative to this component
            choice = Choice(earns, cut.left.finished + cut.left.stuck, left)
            if cut.left.stuck:
                stuck.append(choice)
            else:
                yield choice
        yield from stuck if len(stuck) == len(seen) else []


class OutOfBudgetError(Exception):
    """No more components may be expanded."""


def key_of(component: Component) -> tuple[float, ...]:
    """The same for the same piece, up to rounding."""
    return tuple(np.round([*component.box.ravel(), component.volume, component.hull.volume], 9).tolist())


def planes_of(component: Component) -> list[Plane]:
    """The ten best of the 150 planes by hull sum, and those of reflex edges."""
    candidates = paper_planes(component)
    scored = sweep(component, candidates)
    cost = np.where(valid_planes(component, candidates), scored.hull_below + scored.hull_above, np.inf)
    order = [i for i in np.argsort(cost, kind="stable")[:SHORTLIST].tolist() if math.isfinite(cost[i])]
    edges = reflex_edge_planes(component)
    return [candidates.plane(i) for i in order] + [edges.plane(i) for i in range(len(edges))]


def measure(solid: Solid, threshold: float, budget: int) -> Row | None:
    """Numbers of one mesh; None unless it is one connected component of `PARTS` parts by greedy-162."""
    root, criterion = Component(solid.shape), Concavity(threshold)
    cutting = None if criterion.is_met(root) else CutEnv(root, criterion)
    if cutting is None or len(cutting.unfinished) != 1 or len(cutting.all) != 1:
        return None
    with Run(1) as run:
        oracle = Oracle(root, criterion, run, budget)
        [node] = oracle.roots
        trees = {"greedy": oracle.finished_greedily(node)}
        if len(trees["greedy"]) not in PARTS:
            return None
        oracle.fewest(node)
        trees["fewest"], row = node.fewest, Row(least=node.least)
        oracle.budget = sys.maxsize
        greedy = oracle.greedy(node)
        for name, finish in (("r1", 0.0), ("r1+r2", terminal_reward(node.least))):
            found, returns = oracle.best(node, finish), attrgetter("whole" if finish else "earned")
            found = max(found, replace(greedy, proved=False), key=returns)
            row |= {f"{name}.return": returns(found), f"{name}.greedy": returns(greedy)}
            row |= {f"{name}.bound": node.high[LAST], f"{name}.proved": found.proved}
            trees[name] = found.parts
        for name, parts in trees.items():
            merged = merge_parts(parts, criterion.settled(parts), run)
            row |= {f"{name}.raw": len(parts), f"{name}.merged": len(merged)}
        return row | {"expanded": oracle.expanded}


def page(rows: list[Row]) -> Page:
    """The table of all meshes."""
    lines = []
    for name, says in TREES.items():
        cells: list[object] = [says]
        for count in ("raw", "merged"):
            own, greedy = ([row[f"{which}.{count}"] for row in rows] for which in (name, "greedy"))
            cells += [sum(own), Ratio.of(own, greedy)]
        exact = [row["least"] == row["fewest.raw"] if name == "fewest" else row.get(f"{name}.proved") for row in rows]
        lines.append([*cells, "" if name == "greedy" else sum(map(bool, exact))])
    header = ["tree", "raw", "to greedy-162", "merged", "to greedy-162", "proved"]
    about = [f"{len(rows)} meshes. No trees of these planes have fewer than {sum(r['least'] for r in rows)} raw parts."]
    for name in ("r1", "r1+r2"):
        of_best, of_bound = (
            np.mean([row[f"{name}.{which}"] / row[f"{name}.{to}"] for row in rows])
            for which, to in (("greedy", "return"), ("return", "bound"))
        )
        about.append(
            f"{TREES[name]}: greedy's return is {of_best:.3f} of it, and it at least {of_bound:.3f} of the best."
        )
    return Page("What the paper's objective can give", [*about, Table(header, lines)])


@click.command("oracle")
@click.argument("meshes", type=PATH)
@OUT
@click.option("--list", "listed", type=PATH, help="File with a mesh a line, relative to the folder.")
@click.option("--count", type=click.IntRange(1), default=30, show_default=True, help="Meshes that fit.")
@click.option("--faces", type=click.IntRange(4), default=700, show_default=True, help="Triangles of the largest.")
@click.option("--threshold", default=0.04, show_default=True, help="Concavity.")
@click.option("--budget", default=150, show_default=True, help="Components a mesh that the fewest parts may ask for.")
def app(meshes: Path, out: Path, listed: Path | None, count: int, faces: int, threshold: float, budget: int) -> None:
    """Find the best trees of cuts of small solids by the paper's objective and by the number of parts."""
    with exit_codes():
        rows: list[Row] = []
        for name in np.random.default_rng(0).permutation(find_meshes(meshes, listed)).tolist():
            task = Task(name, f"oracle, {faces} faces, {budget} components", threshold)
            row = load_row(out, task)
            if row is None:
                row = {"mesh": name, **(one_of(meshes / name, faces, threshold, budget) or {})}
                save_row(out, task, row)
            rows += [row] if "least" in row else []
            if len(rows) == count:
                break
        write(page(rows), out, "oracle")


def one_of(path: Path, faces: int, threshold: float, budget: int) -> Row | None:
    """`measure` a file, if it is small and can be repaired."""
    try:
        mesh = load_mesh(path)
        return measure(repair(mesh, threads=1), threshold, budget) if len(mesh.faces) <= faces else None
    except (RlacdError, ValueError):
        return None
