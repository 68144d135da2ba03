"""From a mesh to the parts of its solid: repair, simplify, cut, merge, search, transfer, limit.

Transfer and limit cut again what fails; no other stage looks back.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from rlacd.criteria import Criterion, Filled, LimitedCriterion
from rlacd.cut import CutTree
from rlacd.cut_and_merge import MOST_CUTTING, Pass, cut_and_merge
from rlacd.merge import grow_cover, grown_parts
from rlacd.options import Options
from rlacd.options.ranges import FAST
from rlacd.planes.sweep import SweepCache
from rlacd.policies import AS_PUBLISHED, Greedy, make_policy
from rlacd.repair.repair import repair
from rlacd.repair.slits import without_slits
from rlacd.report import SearchSummary
from rlacd.run import Run
from rlacd.search.at_least import at_least
from rlacd.search.levels import eliminate_parts, search
from rlacd.search.neighbourhood import SearchContext, cost
from rlacd.solid.component import DENSE, Component, Part
from rlacd.solid.cover import cover, slabs
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Solid

if TYPE_CHECKING:
    from rlacd.proxy.simplify import Proxy

COARSER = 1.5
"""The threshold grows by this factor until one part is left, after `MOST_CUTTING` units of work by its fourth power:
only tangles take so long. In between, parts are united two at a time; pairs are measured for as much work."""

TIMES_TOO_MANY, TOO_MANY = 1.5, 5
"""Parts are not searched if they are more than so many times the hulls asked for and so many more: on 30 real meshes no
search divides them by more than 1.32."""

PIECES_A_FACE = 4
"""Sheets are cut into at most so many pieces a face: real ones take a quarter of one, those that cross themselves may
take a hundred."""


EXACT, FLAW, EXACT_WORK = 0.02, 0.001, 0.25e6
"""Exact bodies are grown to a depth that is the first share of a goal's, and the second share of a hull may be empty
(with 0.005 a stool's seat takes in slices of its legs); and the work that may take, if cutting and merging took no
more: furniture of ten boards takes 0.22e6."""

FEW_SIDES = 6
"""So many planes a part are few: those of a box, if no two boxes share one."""


SLIT, EXTENT = 0.6, 2.0
"""Slits are filled that are at most so wide, and at least so large in both other directions, in units of the threshold:
all that is added lies within 0.3 of it, and what is shallower needs no cut. With an extent of 1, fillings of all kinds
take 3 hulls in 840 less but give single meshes up to 7 more."""


class Reached(NamedTuple):
    """The decomposition reached: complete, or the state when it was stopped.

    Attributes
    ----------
    solid : Solid
        The repaired mesh.
    options : Options
        Those given, with lengths relative to the solid's size.
    goal : Criterion
        What the parts meet, unless a stop or `max_hulls` forbade it.
    parts : list of Part
    found : SearchSummary, optional
        What the search found, if there was one.
    root : Component, optional
        The solid as it was cut; None if the parts cover the solid without cuts.
    before : tuple of list of Part
        Earlier states on the solid, the latest last.
    """

    solid: Solid
    options: Options
    goal: Criterion
    parts: list[Part]
    found: SearchSummary | None = None
    root: Component | None = None
    before: tuple[list[Part], ...] = ()


Repaired: TypeAlias = "dict[Hashable, Solid]"
"""A mesh as it was repaired before, by the options of that."""


def find_parts(source: InputMesh, options: Options, run: Run, repaired: Repaired | None = None) -> Reached:
    """Decompose a mesh until done or stopped."""
    problem = None
    with run.until_stopped():
        problem = Problem.of(source, options, run, repaired)
    if problem is None:
        return covered(source, options, run)
    solid, options, root = problem.solid, problem.options, problem.root
    if options.max_hulls == 1:
        return Reached(solid, options, problem.goal, [root], None, root)
    decomposer = Decomposer.of(problem, run)
    states, goal, found = decomposer.decompose(problem.goal)
    most, parts = options.max_hulls, states[-1]
    if most is not None and len(parts) > most:
        from rlacd.extras.limit import at_most

        parts = at_most(most, decomposer.coarser(states, goal), root, goal, options, run)
    elif any(options.hull_limits):
        from rlacd.extras.limit import cut_to_limits

        parts = cut_to_limits(parts, goal, root, options, run)
    before = tuple(state for state in states if most is None or len(state) <= most)
    return Reached(solid, options, goal, parts, found, root, before)


class Problem(NamedTuple):
    """What is decomposed.

    Attributes
    ----------
    solid : Solid
        The repaired mesh.
    options : Options
        With lengths relative to the solid's size.
    goal : Criterion
        In its frame.
    root : Component
        The solid, to be cut.
    """

    solid: Solid
    options: Options
    goal: Criterion
    root: Component

    @classmethod
    def of(cls, source: InputMesh, options: Options, run: Run, repaired: Repaired | None = None) -> Problem:
        """Repair a mesh, unless it was before, and make the criterion that the options ask for."""
        known = {} if repaired is None else repaired
        with run.stage("repair"):
            how = options.resolution, options.openings, options.gap, options.sees_cavities
            if how not in known:
                resolution, openings, gap, keep = how
                known[how] = repair(
                    source,
                    resolution=resolution,
                    open_bodies=openings,
                    gap=gap,
                    threads=run.threads,
                    keep_cavities=keep,
                )
            solid = replace(known[how], pieces=[*known[how].pieces])  # which go when they are no longer needed
            options = options.at_scale(solid.frame.scale)
            goal = LimitedCriterion.prepare(options, solid, run)
            # What next to nothing gets into may become solid, but not where balls or meshes have to.
            is_asked = options.openings == "thin" or options.keep_cavities or isinstance(goal, LimitedCriterion)
            if not is_asked and math.isfinite(goal.outward_deviation):
                width = min(options.gap, SLIT * goal.outward_deviation)
                solid = without_slits(solid, width, EXTENT * goal.outward_deviation)
        return cls(solid, options, goal, Component(solid.shape, run.threads))


def covered(source: InputMesh, options: Options, run: Run) -> Reached:
    """Cover a mesh that there was no time to decompose, with one hull for each of its bodies."""
    solid, parts = cover(source, run)
    options = options.at_scale(solid.frame.scale)
    with run.shielded():
        return Reached(solid, options, LimitedCriterion.prepare(options, solid, None), parts)


@dataclass(frozen=True)
class Decomposer:
    """Decomposes a solid, under coarser and coarser goals, on the same tree of cuts.

    Attributes
    ----------
    problem : Problem
    proxy : Proxy or None
        What is cut in place of a dense solid.
    run : Run
    tree : CutTree
    """

    problem: Problem
    proxy: Proxy | None
    run: Run
    tree: CutTree

    @classmethod
    def of(cls, problem: Problem, run: Run) -> Decomposer:
        """Prepare to decompose a solid."""
        solid, options, goal, root = problem
        proxy = None
        if math.isfinite(goal.outward_deviation) and root.size >= DENSE:
            from rlacd.proxy.simplify import simplify

            with run.until_stopped(), run.stage("simplify"):
                proxy = simplify(root, goal.outward_deviation, run.threads, solid.pieces)
        solid.pieces.clear()
        is_default = options.first_policy == options.default_policy
        sweeps = SweepCache(seed=(options.seed,) if is_default and options.seed else None)
        second = Greedy("hull-sum", sweeps=sweeps) if is_default else None
        policy = make_policy(options.first_policy, sweeps, _tighter(goal, proxy).outward_deviation)
        tree = CutTree(root if proxy is None else proxy.component, policy, run, second=second)
        return cls(problem, proxy, run, tree)

    def decompose(self, goal: Criterion) -> tuple[list[list[Part]], Criterion, SearchSummary | None]:
        """Cut, merge, search and transfer.

        Returns the parts that the levels up to the one asked for end with, the best last, the goal as settled on them,
        and a summary of the search. Sheets that would take more parts than they have faces get one for each face.
        """
        states, settled, found = self._decomposed(goal)
        if len(states[-1]) <= self._most_parts:
            return states, settled, found
        return [self.run.if_in_time(lambda: slabs(self.problem.solid, self.run), lambda: states[-1])], goal, None

    @property
    def _most_parts(self) -> float:
        """More parts are too many: the number of faces of sheets."""
        solid = self.problem.solid
        return len(solid.surface[1]) if solid.is_sheets else math.inf

    def _cut(self, goal: Criterion) -> Pass:
        goal, most = _tighter(goal, self.proxy), PIECES_A_FACE * self._most_parts
        return cut_and_merge(self.tree, goal, self.run, merge=self.problem.options.merge, most=most)

    def _decomposed(self, goal: Criterion) -> tuple[list[list[Part]], Criterion, SearchSummary | None]:
        with self.run.limited():
            done = self._cut(goal)
            if not done.parts:
                return [done.pieces], goal, None
            states, found = self._searched(done.parts, done.criterion, goal)
            best = states[-1]
            states = [parts for parts in states if parts is not best] + [best]
            if self.proxy is None:
                return states, done.criterion, found
            moved = [self._transferred(best, goal)]
            least = found.lower_bound if found is not None else 1
            for parts in states[:-1]:  # of the levels below: on the solid they may be fewer
                if len(moved[-1]) > least and self.run.stopped_by is None:
                    moved = sorted([self._transferred(parts, goal), *moved], key=cost, reverse=True)
            return moved, goal, found

    def _exact(self, parts: list[Part], goal: Criterion) -> list[Part]:
        """The convex bodies that a solid of few sides is made of, to which its pieces, cut until the solid fills their
        hulls, grow back.

        The given parts if they are fewer, or as many and smaller, or if no bodies are found that meet the goal.
        """
        few = self.problem.root.sides <= FEW_SIDES * len(parts)
        if self.proxy is not None or len(parts) == 1 or not few or not math.isfinite(goal.outward_deviation):
            return parts
        run, found = self.run, list[Part]()
        with run.limited(max(run.work.done, EXACT_WORK)):
            filled = Filled(EXACT * goal.outward_deviation, share=FLAW)
            pieces, left = self.tree.cut_until(filled)
            found = [] if left else grown_parts(pieces, len(parts), filled, run)
            if not all(run.map(goal.is_met, found)):
                return parts
        return min(parts, found or parts, key=cost)

    def coarser(self, free: list[list[Part]], goal: Criterion) -> Iterator[list[Part]]:
        """Get decompositions under coarser and coarser goals, until one part is left; `free` are those under the goal.

        They are not searched: on real meshes, hulls as few as asked for fit no better, and it takes most of the time.
        """
        yield from free
        factor, begin = 1.0, self.run.work.done
        while self.run.stopped_by is None:
            factor *= COARSER if self.run.work.done - begin < MOST_CUTTING else COARSER**4
            coarse = goal.scaled(factor)
            with self.run.limited():
                done = self._cut(coarse)
            if done.parts:
                yield self._transferred(done.parts, coarse)
            if len(done.parts) == 1:
                return

    def _transferred(self, parts: list[Part], goal: Criterion) -> list[Part]:
        """Parts of the solid, which meet the goal there, for those of the proxy."""
        if self.proxy is None:
            return parts
        from rlacd.proxy.model import Transfer

        options = self.problem.options
        policy = make_policy(options.first_policy, SweepCache(), goal.outward_deviation)
        return Transfer(self.problem.root, self.proxy, goal, policy, self.run).moved(parts, merge=options.merge)

    def _searched(
        self, parts: list[Part], goal: Criterion, asked: Criterion
    ) -> tuple[list[list[Part]], SearchSummary | None]:
        """The parts that the levels up to the one asked for end with, the best last, and a summary of the search.

        `asked` is the solid's unscaled goal.
        """
        options, run, found, states = self.problem.options, self.run, None, [parts]
        policy, root = options.first_policy, self.tree.root
        context = SearchContext(root, goal, options.seed, run.work.done)
        assert options.quality is not None, "filled in by the options"
        most = math.inf if options.max_hulls is None else TIMES_TOO_MANY * options.max_hulls + TOO_MANY
        goes_on = options.merge and policy not in AS_PUBLISHED
        with run.until_stopped():
            if goes_on and run.stopped_by is None:
                with run.stage("merge"):
                    states = [parts := self._exact(parts, goal)]
            if run.stopped_by is not None:
                return states, None
            if options.quality == FAST or len(parts) > most or self.problem.solid.is_apart:
                if goes_on:
                    with run.stage("merge"), run.limited(context.first_pass):
                        states = [parts := grow_cover(parts, goal, run)]
                if goes_on and goal.eliminates and run.stopped_by is None:
                    with run.stage("search"):
                        states = [eliminate_parts(context, parts, run)]
            else:
                with run.stage("search"):
                    if goes_on and goal.obstacles is not None:
                        states = [parts := eliminate_parts(context, parts, run)]
                    bound = run.start(partial(at_least, self.problem.root, parts, asked.outward_deviation, run))
                    enough = cache(lambda: run.if_in_time(lambda: run.result(bound), lambda: 1))
                    context = replace(context, enough=enough)
                    states, found = search(context, parts, run, options.quality, options.budget, options.search_steps)
        return states, found


def _tighter(goal: Criterion, proxy: Proxy | None) -> Criterion:
    """The goal for what is cut: parts of a proxy have to be tighter, so that those of the solid meet it."""
    return goal if proxy is None else goal.alone.scaled(1 - proxy.margin(goal))
