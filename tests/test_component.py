"""Components: cutting, connected pieces, principal axes; slivers and shavings."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from rlacd.merge.slivers import SLIVER_LOSS, drop_slivers, is_film, is_sliver
from rlacd.planes.candidates import OFFSETS_PER_AXIS, axis_and_principal
from rlacd.policies import SCORES, Greedy
from rlacd.run import Run
from rlacd.solid.component import Component, Plane


def box(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Component:
    return Component(Manifold.cube((x, y, z)).translate(at))


def test_cavities_stay_in_the_piece_around_them() -> None:
    hollow = Manifold.sphere(1, 32) - Manifold.sphere(0.5, 32)
    solid = Component(hollow + Manifold.cube((1, 1, 1)).translate((2, 0, 0)))
    pieces = sorted(solid.pieces(), key=lambda piece: piece.volume)
    assert len(pieces) == 2
    assert pieces[1].volume == pytest.approx(hollow.volume())


def test_candidates_are_the_papers_150() -> None:
    component = Component(Manifold.cube((3, 2, 1), True).rotate((10, 20, 30)))
    candidates = axis_and_principal(component)
    assert len(candidates) == 6 * OFFSETS_PER_AXIS == 150
    for k, direction in enumerate(candidates.directions):
        heights = component.vertices @ direction
        steps = np.diff([heights.min(), *candidates.offsets[k], heights.max()])
        assert steps == pytest.approx(np.full(26, np.ptp(heights) / 26))
    plane = candidates.plane(25 * 4 + 7)
    assert plane.normal == pytest.approx(candidates.directions[4])
    assert plane.offset == candidates.offsets[4, 7]


@pytest.mark.parametrize("score", SCORES)
def test_greedy_cuts_a_dumbbell_at_its_bar(score: str) -> None:
    balls = Manifold.sphere(0.5, 32).translate((-1, 0, 0)) + Manifold.sphere(0.5, 32).translate((1, 0, 0))
    dumbbell = Component(balls + Manifold.cylinder(2, 0.1, 0.1, 16, True).rotate((0, 90, 0)))
    plane = Greedy(score).choose(dumbbell)
    assert abs(plane.normal[0]) > 0.99
    assert abs(plane.offset) < 0.7


def test_slivers_are_distinguished_from_thin_but_sound_parts() -> None:
    assert is_sliver(box(1, 1, 0.01).hull)
    assert not is_sliver(box(1, 1, 0.03).hull)
    assert not is_sliver(Component(Manifold.sphere(1, 32)).hull)
    assert is_film(box(1, 1, 1e-4))
    assert not is_film(box(1, 1, 2e-3))


def test_a_sliver_goes_only_where_others_stand_for_it() -> None:
    block, shaving, sheet = box(1, 1, 1), box(1, 1, 0.001, (0, 0, 1)), box(1, 1, 0.001, (0, 0, 3))
    with Run(1) as run:
        assert drop_slivers([block, shaving, sheet], run) == [block, sheet]
        assert drop_slivers([block, shaving], run, suspects=[block]) == [block, shaving]
        assert drop_slivers([sheet], run) == [sheet]


def test_of_a_stack_of_slivers_enough_stay_for_all_of_them() -> None:
    stack = [box(1, 1, 0.001 + 1e-6 * i, (0, 0, 0.0015 * i)) for i in range(30)]
    with Run(1) as run:
        kept = drop_slivers(stack, run)
    assert len(kept) < len(stack)
    tops = np.array([part.vertices[:, 2].max() for part in kept])
    for part in stack:
        assert np.abs(tops - part.vertices[:, 2].max()).min() <= SLIVER_LOSS + 0.0015


@pytest.mark.parametrize("axis", range(3))
def test_a_cut_along_an_axis_is_exact(axis: int) -> None:
    """Faces in the plane stay whole on their own side, whatever the last bits of its offset: no side keeps a film."""

    def block(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Manifold:
        a, b = np.roll(lower, axis + 1), np.roll(upper, axis + 1)  # the last coordinate becomes number `axis`
        corners = [np.where([i & 1, i & 2, i & 4], b, a) for i in range(8)]
        return Manifold.hull_points(np.array(corners))

    normal = tuple(np.eye(3)[axis].tolist())
    for offset in np.linspace(-0.4, 0.6, 30):
        slab, foot = block((0, 0, -0.7), (1, 1, offset)), block((0.2, 0.2, offset), (0.3, 0.3, 1))
        overhang = block((0.2, 0.2, offset), (1.5, 0.3, 1))
        for upper in (foot, overhang):
            below, above = Component(slab + upper).cut(Plane(normal, float(offset)))
            assert below.box[1, axis] == offset == above.box[0, axis]
            for side, solid in ((below, slab), (above, upper)):
                assert side.volume == pytest.approx(solid.volume(), rel=1e-12)
                assert side.hull.volume == pytest.approx(solid.volume(), rel=1e-12)
