"""Searching: never worse than the level below, every part feasible, nothing lost, the same whatever the threads."""

from __future__ import annotations

import itertools
import json
import math
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

import rlacd
from rlacd import _native
from rlacd.cli.main import app
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.io.read.load import load_mesh
from rlacd.merge import merge_parts
from rlacd.planes.sweep import SweepCache
from rlacd.policies import Greedy, make_policy
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.search.neighbourhood import LAG, LEAST_TRIALS, Neighbourhood, SearchContext, cost
from rlacd.search.operators import Exchange, recut
from rlacd.search.part_graph import PartGraph
from rlacd.search.search import BOUNDED_PATIENCE, search
from rlacd.solid.component import Component, Part, Plane, reunite, touch
from tests.shapes import box, from_manifold, strangers

SHAPES = ("test/coacd_examples/SnowFlake.ply", "test/vhacd/ob_chess_table.ply", "test/capod/class8__m85.ply")
CRITERION = Concavity(0.05)


def frame() -> Any:
    """A picture frame, turned so that no face lies along an axis."""
    return (box((-1, -1, -0.3), (1, 1, 0.3)) - box((-0.5, -0.5, -1), (0.5, 0.5, 1))).rotate([20, 30, 10])


def solid_of(mesh: Path) -> Component:
    return Component(repair(load_mesh(mesh), resolution=100, threads=1).manifold)


def first_pass(root: Component, run: Run) -> list[Part]:
    done, left = CutTree(root, make_policy("greedy"), run).cut_until(CRITERION)
    assert not left
    return merge_parts(done, CRITERION, run)


@pytest.fixture(scope="module", params=SHAPES)
def real(request: pytest.FixtureRequest, corpus: Path) -> Component:
    return solid_of(corpus / request.param)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.tuples(*[st.floats(-1, 1)] * 3), st.floats(-0.5, 0.5)),
        min_size=1,
        max_size=3,
    )
)
def test_what_slanted_planes_cut_is_reunited(cuts: list[tuple[tuple[float, float, float], float]]) -> None:
    solid = Component(frame())
    pieces = [solid]
    for normal, offset in cuts:
        length = math.hypot(*normal)
        if length < 1e-3:
            continue
        x, y, z = (x / length for x in normal)
        plane = Plane((x, y, z), offset)
        pieces = [side for piece in pieces for side in piece.cut(plane) if side is not None]
    assert reunite(pieces) is solid
    again = reunite(strangers(pieces))
    if again is None:  # it may give up; it must not return something else
        return
    assert again.volume == pytest.approx(solid.volume, rel=1e-6)
    assert _native.mesh_area(again.vertices, again.faces) == pytest.approx(
        _native.mesh_area(solid.vertices, solid.faces), rel=1e-5
    )


@pytest.mark.nightly
def test_most_neighbours_can_be_reunited_without_a_wall_between_them(real: Component) -> None:
    with Run(1) as run:
        parts = first_pass(real, run)
    reunited = glued = 0.0
    tried = failed = 0
    for first, second in itertools.pairwise(parts):
        tried += 1
        solid = reunite(strangers([*first.members, *second.members]))
        if solid is None:
            failed += 1
            continue
        union = Part.glued(first, second)
        reunited += _native.mesh_area(solid.vertices, solid.faces)
        glued += _native.mesh_area(union.vertices, union.faces)
        assert solid.volume == pytest.approx(first.volume + second.volume, rel=1e-6)
    assert failed <= 0.1 * tried
    assert reunited == pytest.approx(glued, rel=1e-2)


@pytest.mark.nightly
def test_a_search_only_improves_and_keeps_the_solid(real: Component) -> None:
    with Run(1) as run:
        parts = first_pass(real, run)
        found, account = search(SearchContext(real, CRITERION), parts, run, "best", steps=40)
    assert cost(found) <= cost(parts)
    assert account.parts == len(found) <= account.portfolio <= account.first_pass == len(parts)
    assert account.steps == 40 or account.exhausted
    assert all(CRITERION.is_met(part) for part in found)
    assert sum(own.volume for part in found for own in part.members) == pytest.approx(real.volume, rel=1e-3)


@pytest.mark.nightly
def test_a_search_is_never_worse_than_its_start(real: Component) -> None:
    """Whatever its steps. More of them may well end with more parts: what can be eliminated changes on the way."""
    costs = []
    with Run(1) as run:
        parts = first_pass(real, run)
        for steps in (0, 8, 24):
            context = SearchContext(real, CRITERION, seed=3)
            found, _ = search(context, parts, run, "best", steps=steps)
            costs.append(cost(found))
    assert costs[0] >= max(costs[1:])


def test_the_state_of_a_search_is_always_feasible() -> None:
    root = Component(frame())
    with Run(1) as run:
        parts = first_pass(root, run)
        state = Neighbourhood(
            SearchContext(root, CRITERION, scores=["hull-sum"], near_sweeps=SweepCache(12, 0)), parts, run
        )
        for steps in range(3, 15, 3):
            state.improve(steps)
            assert all(CRITERION.is_met(part) for part in state.parts)
            assert sum(own.volume for part in state.parts for own in part.members) == pytest.approx(
                root.volume, rel=1e-6
            )


def test_a_bounded_search_gives_up_after_a_few_trials_per_part(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Any] = []
    for operator in ("recut", "redistribute"):
        monkeypatch.setattr(f"rlacd.search.neighbourhood.{operator}", lambda *given, **_: tried.append(given))
    root = Component(frame())
    with Run(1) as run:
        parts = first_pass(root, run)
        found, account = search(SearchContext(root, CRITERION), parts, run, "balanced")
        assert (account.exhausted, account.parts) == (True, len(found))
        patience = max(BOUNDED_PATIENCE * len(found), LEAST_TRIALS)
        assert len(tried) < patience + LAG
        few = len(tried)
        tried.clear()
        search(SearchContext(root, CRITERION), parts, run, "balanced", steps=10_000)
        assert len(tried) > few


def cubes(*places: tuple[float, float, float]) -> list[Part]:
    return [Component(Manifold.cube().translate(place)) for place in places]


def test_neighbours_share_a_face() -> None:
    parts = cubes(*((float(x), float(y), 0.0) for x in range(3) for y in range(2)))
    here = PartGraph(parts, CRITERION, Run(1))
    assert here.around((0,)) == (1, 2)  # not 3, which has an edge in common
    assert here.around((0, 1)) == (2, 3)
    for seed in range(20):
        cluster = here.draw(3, np.random.default_rng(seed))
        assert cluster is not None
        assert len(cluster) == 3
        assert all(set(here.around((i,))) & set(cluster) for i in cluster)
    assert here.draw(7, np.random.default_rng(0)) is None
    assert here.apply(Exchange((parts[0], parts[1]), ()))
    assert not here.apply(Exchange((parts[1], parts[2]), ()))  # gone already
    assert here.around((2,)) == (3, 4)


def test_touching_is_face_to_face() -> None:
    cube, face, edge, apart = cubes((0, 0, 0), (1, 0.5, 0.5), (1, 1, 0), (1 + 1e-6, 0, 0))
    assert touch(cube, face)
    assert not touch(cube, edge)
    assert not touch(cube, apart)


def test_reuniting_again_and_again_leaves_no_crumbs() -> None:
    solid = again = Component(frame())
    rng = np.random.default_rng(0)
    for _ in range(12):
        x, y, z = rng.normal(size=3)
        length = math.hypot(x, y, z)
        sides = again.cut(Plane((x / length, y / length, z / length), 0.1))
        reunited = reunite(strangers([side for side in sides if side is not None]))
        assert reunited is not None
        again = reunited
    assert again.volume == pytest.approx(solid.volume, rel=1e-6)
    assert len(again.faces) < 12 * len(solid.faces)  # 160 times as many without cleaning up


def test_what_is_all_there_of_a_component_is_put_together_without_a_boolean() -> None:
    bar = Component(Manifold.cube((3, 1, 1), True))
    low, high = (side for side in bar.cut(Plane((1, 0, 0), -0.3)) if side is not None)
    left, right = (side for side in high.cut(Plane((0, 1, 0), 0.1)) if side is not None)
    near, far = (side for side in high.cut(Plane((0, 0, 1), 0.2)) if side is not None)
    assert reunite([right, low, left]) is bar
    assert reunite([far, near]) is high
    for some, volume in (([low, left], low.volume + left.volume), ([low, near], low.volume + near.volume)):
        united = reunite(some)
        assert united is not None
        assert united is not bar
        assert united.volume == pytest.approx(volume, rel=1e-6)


def test_a_cluster_that_was_cut_badly_becomes_fewer_parts() -> None:
    bar = Component(Manifold.cube((3, 1, 1), True))
    pieces: list[Component] = [bar]
    for offset in (-1.0, 0.2, 1.1):
        pieces = [side for piece in pieces for side in piece.cut(Plane((1, 0, 0), offset)) if side is not None]
    exchange = recut(pieces, [], Greedy("hull-sum", sweeps=SweepCache(12, 0)), CRITERION, Run(1))
    assert exchange is not None
    assert exchange.gain == 3
    assert exchange.into[0].volume == pytest.approx(3)
    # With no time left, nothing is found.
    assert recut(pieces, [], Greedy("hull-sum", sweeps=SweepCache(12, 0)), CRITERION, Run(1, -1.0)) is None


@pytest.mark.nightly
@pytest.mark.parametrize("options", [{"quality": "balanced"}, {"quality": "best", "search_steps": 30, "seed": 5}])
@pytest.mark.parametrize("name", SHAPES[:2])
def test_the_same_hulls_for_any_number_of_threads(name: str, options: dict[str, Any], corpus: Path) -> None:
    one, four = (rlacd.decompose(corpus / name, threads=threads, **options) for threads in (1, 4))
    assert len(one) == len(four)
    for a, b in zip(one, four, strict=True):
        assert (a.vertices == b.vertices).all()
        assert (a.faces == b.faces).all()


@pytest.mark.slow
@pytest.mark.promise("levels")
def test_no_level_makes_more_hulls_than_the_one_before() -> None:
    for solid in (frame(), frame() + frame().rotate([0, 90, 0])):
        shape = from_manifold(solid)
        fast, balanced, best = (
            rlacd.decompose((shape.vertices, shape.faces), threads=1, **options)
            for options in ({"quality": "fast"}, {}, {"quality": "best", "search_steps": 16})
        )
        assert len(best) <= len(fast) >= len(balanced)
        assert balanced.report["search"]["steps"] > 0 or len(balanced) == balanced.report["at_least"]


@pytest.mark.nightly
@pytest.mark.parametrize("name", SHAPES)
def test_levels_are_ordered(name: str, corpus: Path) -> None:
    fast, balanced, best = (
        rlacd.decompose(corpus / name, **options)
        for options in ({"quality": "fast"}, {}, {"quality": "best", "search_steps": 96})
    )
    assert len(best) <= len(balanced) <= len(fast)
    assert len(best) < len(fast)  # these shapes have something to gain
    for result in (balanced, best):
        assert result.report["concavity"]["max"] <= 0.05
        assert all(hull.is_convex and hull.is_watertight for hull in result)
        assert result.report["complete"]
    assert fast.report["search"] is None
    assert balanced.report["search"]["work"] <= balanced.report["search"]["allowed"]


@pytest.mark.nightly
def test_other_criteria_are_searched_too(corpus: Path) -> None:
    space = rlacd.NavigableSpace(0.025, 0.02)
    fast, best = (
        rlacd.decompose(corpus / SHAPES[0], criterion=space, **options)
        for options in ({}, {"quality": "best", "search_steps": 40})
    )
    assert len(best) <= len(fast)
    assert best.report["navigable"]["intrusion"]["max"] == 0
    limited = rlacd.decompose(corpus / SHAPES[1], max_vertices=24, quality="balanced")
    assert max(len(hull.vertices) for hull in limited) <= 24
    assert limited.report["concavity"]["max"] <= 0.05


@pytest.mark.nightly
def test_the_command_line_searches(corpus: Path, tmp_path: Path) -> None:
    words = ["--quality", "best", "--search-steps", "5", "--report", "-", "-q"]
    done = CliRunner().invoke(app, ["decompose", str(corpus / SHAPES[1]), "-o", str(tmp_path / "h.glb"), *words])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["options"]["quality"] == "best"
    assert report["search"]["steps"] <= 5


@pytest.mark.parametrize("words", ["--quality better", "--quality fast --budget 3", "--quality best --budget -1"])
def test_the_command_line_refuses_bad_options(words: str, tmp_path: Path) -> None:
    mesh = tmp_path / "ball.ply"
    trimesh.creation.icosphere().export(mesh)
    done = CliRunner().invoke(app, ["decompose", str(mesh), *words.split()])
    assert done.exit_code == 2
    assert list(tmp_path.iterdir()) == [mesh]


@pytest.mark.nightly
def test_cancelling_a_search_keeps_what_it_has_reached(corpus: Path) -> None:
    told: list[rlacd.Progress] = []

    def stop(progress: rlacd.Progress) -> bool:
        told.append(progress)
        return progress.stage != "search" or progress.done < 8

    result = rlacd.decompose(corpus / SHAPES[0], quality="best", search_steps=1000, progress=stop)
    assert result.report["stopped_by"] == "cancel"
    assert result.report["concavity"]["max"] <= 0.05
    assert any("search for fewer hulls early" in warning for warning in result.report["warnings"])
    assert 8 <= result.report["search"]["steps"] < 1000
    counts = [progress.parts for progress in told if progress.stage == "search"]
    assert counts == sorted(counts, reverse=True)


@pytest.mark.nightly
def test_time_does_not_make_the_best_level_worse_than_balanced(corpus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = import_module("rlacd.search.search")  # as an attribute, that name is the function
    monkeypatch.setattr(module, "BEST_SECONDS", 0.01)
    balanced, best = (rlacd.decompose(corpus / SHAPES[0], quality=quality) for quality in ("balanced", "best"))
    assert len(best) <= len(balanced)
    assert best.report["search"]["steps"] >= balanced.report["search"]["steps"]


@pytest.mark.slow
def test_a_budget_ends_the_search_and_not_the_work(corpus: Path) -> None:
    result = rlacd.decompose(corpus / SHAPES[0], quality="best", budget=0.01)
    assert result.report["complete"]
    assert result.report["search"]["steps"] <= 8  # those begun in time
    assert result.report["concavity"]["max"] <= 0.05


def test_a_convex_solid_needs_no_search() -> None:
    result = rlacd.decompose(trimesh.creation.icosphere(), quality="best")
    assert len(result) == 1
    assert result.report["search"]["exhausted"]


@pytest.mark.parametrize(
    "options",
    [
        {"quality": "better"},
        {"quality": "best", "budget": 0},
        {"quality": "best", "budget": math.inf},
        {"quality": "best", "search_steps": -1},
        {"quality": "best", "search_steps": 1.5},
        {"quality": "fast", "budget": 1.0},
        {"merge": False, "search_steps": 3},
        {"quality": "balanced", "merge": False},
    ],
)
def test_bad_options(options: dict[str, Any]) -> None:
    with pytest.raises(rlacd.OptionError):
        rlacd.decompose(([[0, 0, 0]], [[0, 0, 0]]), **options)
