"""The tree of cuts: films that no plane cuts are halved."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import CrossSection

from rlacd import cut
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.run import Run
from rlacd.solid.component import Component

CRITERION = Concavity(0.02)


def cut_by(tree: CutTree, criterion: Concavity = CRITERION) -> list[Component]:
    done, left = tree.cut_until(criterion)
    assert not left
    assert all(criterion.is_met(part) for part in done)
    return done


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
