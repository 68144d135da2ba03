"""From a mesh to the parts of its solid: repair, simplify, cut, merge, search, lift; to at most so many parts.

Lift and limit cut again what fails; no other stage looks back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

from rlacd._native import Stopped
from rlacd.criteria import Criterion, LimitedCriterion
from rlacd.criteria.limited import BOX, FEWEST
from rlacd.cut import CutTree
from rlacd.cut_and_merge import MOST_CUTTING, MOST_PER_FACE, cut_and_merge
from rlacd.merge import drop_slivers, grow_cover, merge_parts
from rlacd.merge.merge import united_in_turn
from rlacd.options import FAST, Options
from rlacd.planes.sweep import SweepCache
from rlacd.policies import AS_PUBLISHED, Greedy, make_policy
from rlacd.proxy.model import Model
from rlacd.repair.repair import repair
from rlacd.run import Run, Work
from rlacd.search import SearchContext, SearchSummary, at_least, cost, eliminate_parts, search
from rlacd.solid.component import Component, Part
from rlacd.solid.cover import cover
from rlacd.solid.hull import Hull
from rlacd.solid.input_mesh import InputMesh
from rlacd.solid.solid import Solid

COARSER = 1.5
"""The threshold grows by this factor until one part is left, after `MOST_CUTTING` units of work by its fourth power:
only tangles take so long. In between, parts are united two at a time; pairs are measured for as much work."""

FIRST_POWER = 8
"""Power of `COARSER` from which parts over a limit are cut where few hulls are left: 25 times the threshold."""


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
    """

    solid: Solid
    options: Options
    goal: Criterion
    parts: list[Part]
    found: SearchSummary | None = None
    root: Component | None = None


def find_parts(source: InputMesh, options: Options, run: Run) -> Reached:
    """Decompose a mesh until done or stopped."""
    try:
        with run.stage("repair"):
            solid = _repaired(source, options, run)
        options = options.at_scale(solid.frame.scale)
        goal = LimitedCriterion.prepare(options, solid, run)
        root = Component(solid.shape, run.threads)
    except Stopped:
        run.note_stop()
        return covered(source, options, run)
    if options.max_hulls == 1:
        pieces = drop_slivers(root.pieces(), run)
        return Reached(solid, options, goal, pieces if len(pieces) == 1 else [root], None, root)
    model = Model.of(root, solid.pieces, goal, run)
    solid.pieces.clear()
    decomposer = _Decomposer.of(model, goal, options, run)
    parts, goal, found = decomposer.decompose(goal)
    if options.max_hulls is not None and not decomposer.keeps(options.max_hulls, parts):
        parts = decomposer.at_most(options.max_hulls, parts, goal)
    elif options.hull_limits.allow(*BOX) and not options.hull_limits.allow(*FEWEST):
        try:
            with run.stage("limit"), run.limited(MOST_CUTTING + MOST_PER_FACE * root.size, cuts="cut"):
                parts = decomposer.cut_to_limits(parts, goal)
        except Stopped:
            run.note_stop()
    return Reached(solid, options, goal, parts, found, root)


def covered(source: InputMesh, options: Options, run: Run) -> Reached:
    """Cover a mesh that there was no time to decompose, with one hull for each of its bodies."""
    solid, parts = cover(source, run)
    options = options.at_scale(solid.frame.scale)
    return Reached(solid, options, LimitedCriterion.prepare(options, solid, None), parts)


@dataclass(frozen=True)
class _Decomposer:
    """Decomposes a model, under coarser and coarser goals, on the same tree of cuts.

    Attributes
    ----------
    model : Model
    options : Options
    run : Run
    sweeps : SweepCache
        The sweeps of the cuts, which the search goes on to use.
    tree : CutTree
    """

    model: Model
    options: Options
    run: Run
    sweeps: SweepCache
    tree: CutTree

    @classmethod
    def of(cls, model: Model, goal: Criterion, options: Options, run: Run) -> _Decomposer:
        """Prepare to decompose a model."""
        sweeps = SweepCache()
        second = Greedy("hull-sum", sweeps=sweeps) if options.first_policy == options.default_policy else None
        policy = make_policy(options.first_policy, sweeps, _scale(model.tighter(goal)))
        tree = CutTree(model.component, policy, run, second=second)
        return cls(model, options, run, sweeps, tree)

    def decompose(self, goal: Criterion, factor: float = 1.0) -> tuple[list[Part], Criterion, SearchSummary | None]:
        """Cut, merge, search and lift under a threshold larger by a factor.

        Returns the parts, the goal as settled on them, and a summary of the search. They do not depend on what was
        done before.
        """
        with self.run.limited():
            done = cut_and_merge(self.tree, self.model.tighter(goal, factor), self.run, merge=self.options.merge)
            states, found = self._searched(done.parts, done.criterion, goal if factor == 1.0 else None)
            best = states[-1]
            if self.model.proxy is None:
                return best, done.criterion, found
            lifted = self._lifted(best, goal, factor)
            least = found.at_least if found is not None else 1
            for parts in states[:-1]:  # of the levels below: on the solid they may be fewer
                if parts is not best and len(lifted) > least and self.run.stopped_by is None:
                    lifted = min(lifted, self._lifted(parts, goal, factor), key=cost)
            return lifted, goal, found

    def _lifted(self, parts: list[Part], goal: Criterion, factor: float) -> list[Part]:
        policy = make_policy(self.options.first_policy, SweepCache(), _scale(goal))
        return self.model.lift(parts, goal, factor, policy, self.run, merge=self.options.merge)

    def keeps(self, most: int, parts: list[Part]) -> bool:
        """Whether there are at most so many parts."""
        with self.run.shielded():
            return len(parts) <= most or len(drop_slivers(parts, self.run)) <= most

    def at_most(self, most: int, free: list[Part], goal: Criterion) -> list[Part]:
        """The decomposition into at most so many parts whose largest error is least, among those under coarser goals.

        `free` is that without a limit, which has more. If there is no time, the solid stays one part.
        """
        run, whole, limited = self.run, self.model.solid, LimitedCriterion(goal, self.options.hull_limits)
        best, least = list[Part]([whole]), math.inf
        factor, begin = 1.0, run.work.done
        try:
            least = limited.error(whole)
            while True:
                parts = free if factor == 1.0 else self.decompose(goal, factor)[0]
                for state, error in united_in_turn(parts, self._united, limited, Work(MOST_CUTTING), run):
                    if len(state) <= most and error < least:
                        best, least = state, error
                if len(parts) <= 1 or run.stopped_by is not None:
                    return best
                factor *= COARSER if run.work.done - begin < MOST_CUTTING else COARSER**4
        except Stopped:
            run.note_stop()
        return best

    def _united(self, first: Part, second: Part) -> Part:
        clipped = self.model.proxy and self.model.solid.inside(Hull.around(first.hull, second.hull))
        return clipped if clipped and clipped.size else Part.glued(first, second)

    def cut_to_limits(self, parts: list[Part], goal: Criterion) -> list[Part]:
        """Cut parts that limits too low for the criterion make break it, the worst first, while hulls are left."""
        limited, most = LimitedCriterion(goal, self.options.hull_limits), self.options.max_hulls or math.inf
        met = self.run.map(limited.is_met, parts)
        done = [part for part, is_met in zip(parts, met, strict=True) if is_met]
        broken = sorted((part for part, is_met in zip(parts, met, strict=True) if not is_met), key=limited.error)
        while broken and (room := most - len(done) - len(broken) + 1) > 1:
            done += self._cut_on(broken.pop(), limited, room)
        done += broken
        if len(done) == len(parts) or not self.options.merge:
            return done
        return merge_parts(done, limited, self.run, solid=self.model.solid)

    def _cut_on(self, part: Part, limited: Criterion, most: float) -> list[Part]:
        """Get at most so many pieces of a part that meet the criterion, scaled where that takes more."""
        inside = self.model.solid.inside(part.hull)
        if not inside.size:
            return [part]
        policy = make_policy(self.options.first_policy, SweepCache(), _scale(limited))
        tree, best = CutTree(Component((inside.vertices, inside.faces)), policy, self.run), [part]
        first = 0 if most == math.inf else FIRST_POWER
        for power in range(first, -1, -1):  # the finest that fits, by way of cheap ones
            criterion = limited.scaled(COARSER**power)
            new = cut_and_merge(tree, criterion, self.run, merge=self.options.merge).parts
            if len(new) > most:
                break
            best = new
        return best

    def _searched(
        self, parts: list[Part], goal: Criterion, asked: Criterion | None
    ) -> tuple[list[list[Part]], SearchSummary | None]:
        """The parts that the levels up to the one asked for end with, the best last, and a summary of the search.

        `asked` is the solid's unscaled goal.
        """
        options, run, found, states = self.options, self.run, None, [parts]
        policy, root = options.first_policy, self.model.component
        context = SearchContext(root, goal, options.seed)
        given = options.quality, options.budget, options.search_steps
        quality, seconds, steps = given if asked is not None else ("balanced", None, None)
        assert quality is not None, "filled in by the options"
        goes_on = options.merge and policy not in AS_PUBLISHED
        eliminates = goes_on and goal.eliminates
        if run.stopped_by is not None:
            return states, None
        try:
            if options.quality == FAST:
                if goes_on:
                    with run.stage("merge"), run.limited(run.work.done):
                        states = [parts := grow_cover(parts, goal, run, root)]
                if eliminates and run.stopped_by is None:
                    with run.stage("search"):
                        states = [eliminate_parts(context, parts, run)]
                return states, None
            with run.stage("search"):
                if eliminates and goal.obstacles is not None:
                    states = [parts := eliminate_parts(context, parts, run)]
                    if run.stopped_by is not None:
                        return states, None
                if asked is not None:
                    bound = run.start(partial(at_least, self.model.solid, parts, asked.overhang, run))
                    enough = cache(lambda: run.if_in_time(lambda: run.result(bound), lambda: 1))
                    context = replace(context, enough=enough)
                states, found = search(context, parts, run, quality, seconds, steps)
        except Stopped:
            run.note_stop()
        return states, found


def _repaired(source: InputMesh, options: Options, run: Run) -> Solid:
    return repair(
        source,
        resolution=options.resolution,
        open_bodies=options.open,
        gap=2 * options.gap,
        threads=run.threads,
        keep_cavities=options.sees_cavities,
    )


def _scale(criterion: Criterion) -> float | None:
    """How far a hull may reach beyond its part, if the criterion bounds that: an input of networks."""
    return criterion.overhang if math.isfinite(criterion.overhang) else None
