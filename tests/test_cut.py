"""The tree of cuts: a second policy takes over where the first leaves thousands of components; films are halved."""

from __future__ import annotations

import math

import numpy as np
import pytest
from manifold3d import CrossSection

from rlacd import cut
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.decompose_mesh import decompose
from rlacd.policies import Greedy
from rlacd.run import Run
from rlacd.solid.component import Component, Plane
from tests.shapes import box, from_manifold

CRITERION = Concavity(0.02)


class Slices:
    """A policy that fails: cuts 4 % off the lower end, whatever the shape."""

    def choose(self, component: Component, threads: int = 1) -> Plane:
        lower, upper = component.box[:, 0].tolist()
        return Plane((1.0, 0.0, 0.0), lower + 0.04 * (upper - lower))


def cross() -> Component:
    arms = [box((-1, -0.1, -0.1), (1, 0.1, 0.1)), box((-0.1, -1, -0.1), (0.1, 1, 0.1))]
    return Component(arms[0] + arms[1])


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cut, "MANY_COMPONENTS", 12)


def cut_by(tree: CutTree, criterion: Concavity = CRITERION) -> list[Component]:
    done, left = tree.cut_until(criterion)
    assert not left
    assert all(criterion.is_met(part) for part in done)
    return done


@pytest.mark.usefixtures("few")
def test_where_one_policy_fails_the_other_takes_over_for_good() -> None:
    solid = cross()
    with Run(1) as run:
        sliced = len(cut_by(CutTree(solid, Slices(), run)))
        alone = cut_by(CutTree(solid, Greedy(), run))
        tree = CutTree(solid, Slices(), run, second=Greedy())
        both = cut_by(tree)
        assert len(alone) < 12 < sliced
        assert [part.volume for part in both] == [part.volume for part in alone]
        coarser = Concavity(2 * CRITERION.threshold)
        assert len(cut_by(tree, coarser)) == len(cut_by(CutTree(solid, Greedy(), run), coarser))


@pytest.mark.usefixtures("few")
def test_a_second_policy_that_is_no_better_changes_nothing() -> None:
    solid = cross()
    with Run(1) as run:
        alone = cut_by(CutTree(solid, Slices(), run))
        both = cut_by(CutTree(solid, Slices(), run, second=Slices()))
    assert [part.volume for part in both] == [part.volume for part in alone]


@pytest.mark.parametrize("units", [0.0, 3e3])
def test_work_ends_the_cutting(units: float) -> None:
    with Run(1) as run:
        _, left = CutTree(cross(), Slices(), run).cut_until(CRITERION, math.inf, units)
    assert left
    assert run.work.done > units


def test_limits_on_parts_see_the_same_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    """The default policy, made to fail, is replaced in `decompose` too; a chosen one is not."""
    monkeypatch.setattr(cut, "MANY_COMPONENTS", 12)
    monkeypatch.setattr("rlacd.find_parts.make_policy", lambda *_: Slices())
    solid = from_manifold(box((-1, -0.1, -0.1), (1, 0.1, 0.1)) + box((-0.1, -1, -0.1), (0.1, 1, 0.1)))
    options = {"quality": "fast", "merge": False, "threshold": 0.05, "threads": 1}
    mesh = solid.vertices, solid.faces
    assert len(decompose(mesh, **options)) <= 7
    assert len(decompose(mesh, policy="greedy-excess-norm", **options)) > 12


def gutter(thickness: float) -> Component:
    """Half a pipe without ends."""
    half = CrossSection.circle(0.5, 64) - CrossSection.circle(0.5 - thickness, 64)
    half ^= CrossSection.square((1, 0.5)).translate((-0.5, 0))
    return Component(half.extrude(1.0))


class Never:
    """A policy that finds no plane."""

    def choose(self, component: Component, threads: int = 1) -> None:
        return None


def test_a_film_that_no_plane_cuts_is_halved_until_it_is_done() -> None:
    with Run(1) as run:
        film = gutter(1e-4)
        parts = cut_by(CutTree(film, Never(), run))
        assert 4 <= len(parts) <= 64
        assert sum(part.volume for part in parts) == pytest.approx(film.volume, rel=1e-6)
        corners = np.concatenate([part.vertices for part in parts])
        assert np.allclose([corners.min(axis=0), corners.max(axis=0)], film.box, atol=1e-12)


def test_a_film_inside_out_is_halved_and_a_body_is_left_as_it_is() -> None:
    with Run(1) as run:
        film = gutter(1e-4)
        turned = Component((film.vertices, np.ascontiguousarray(film.faces[:, ::-1])))
        assert turned.volume < 0
        below, above = cut.halves(turned)
        assert below.volume + above.volume == pytest.approx(turned.volume, rel=1e-6)
        body = gutter(0.1)
        assert CutTree(body, Never(), run).cut_until(CRITERION) == ([], [body])
