"""Merging: what may be united is, what may not stays, judged on the glued union."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.merge import merge_parts
from rlacd.run import Run
from rlacd.solid.component import Component, Part, Plane
from tests.test_sweep import SOLIDS


def pieces_of(solid: Manifold, *planes: Plane) -> list[Component]:
    parts = [Component(solid)]
    for plane in planes:
        parts = [piece for part in parts for side in part.cut(plane) if side is not None for piece in side.pieces()]
    return parts


def along(normal: tuple[float, float, float], offset: float) -> Plane:
    unit = np.array(normal) / np.linalg.norm(normal)
    return Plane((float(unit[0]), float(unit[1]), float(unit[2])), offset)


@pytest.fixture
def run():
    with Run(2) as pool:
        yield pool


def test_a_shattered_box_becomes_one_part(run) -> None:
    parts = pieces_of(Manifold.cube((2, 1, 1), True), along((1, 2, 3), 0.1), along((-1, 1, 0.3), 0.0))
    assert len(parts) == 4
    (whole,) = merge_parts(parts, Concavity(0.01), run)
    assert whole.volume == pytest.approx(2)
    assert whole.hull.volume == pytest.approx(2)


def test_parts_of_an_l_never_become_one(run) -> None:
    shape = Manifold.cube((2, 1, 1)) + Manifold.cube((1, 2, 1))
    parts = pieces_of(shape, along((0, 1, 0), 1.0), along((1, 0, 0), 0.5), along((0, 0, 1), 0.3))
    assert len(merge_parts(parts, Concavity(0.05), run)) >= 2


def test_the_inner_surface_of_a_tube_forbids_uniting_its_halves(run) -> None:
    """Joint R_v is small for a thin bore, but its wall lies deep inside the joint hull: both ways have to be tested."""
    tube = Manifold.cube((1, 1, 1), True) - Manifold.cylinder(2, 0.06, 0.06, 24, True)
    parts = pieces_of(tube, along((1, 0, 0), 0.0))
    assert len(merge_parts(parts, Concavity(0.05), run)) >= 2


def test_parts_apart_unite_where_the_gap_is_no_deeper_than_the_threshold(run) -> None:
    def sheets(gap: float) -> list[Component]:
        return [Component(Manifold.cube((1, 1, 0.01)).translate((0, 0, i * (0.01 + gap)))) for i in range(2)]

    assert len(merge_parts(sheets(0.015), Concavity(0.05), run)) == 1
    assert len(merge_parts(sheets(0.2), Concavity(0.05), run)) == 2


def test_a_deep_crack_keeps_parts_apart(run) -> None:
    """The walls of the crack are surface of the union, and lie half a unit inside its hull."""
    blocks = [Component(Manifold.cube((1, 1, 1)).translate((i * 1.001, 0, 0))) for i in range(2)]
    assert len(merge_parts(blocks, Concavity(0.05), run)) == 2


def test_every_part_of_a_merge_meets_the_criterion(run) -> None:
    criterion = Concavity(0.05)
    ring = Manifold.cylinder(0.3, 1, 1, 40, True) - Manifold.cylinder(1, 0.8, 0.8, 40, True)
    parts = pieces_of(ring, *(along((np.cos(a), np.sin(a), 0), 0.0) for a in np.linspace(0, 3, 7)))
    merged = merge_parts(parts, criterion, run)
    assert len(merged) < len(parts)
    assert all(criterion.is_met(part) for part in merged)
    assert sum(part.volume for part in merged) == pytest.approx(sum(part.volume for part in parts))


@pytest.mark.parametrize("across", [False, True])
def test_pairs_of_nearby_boxes(across: bool) -> None:
    random = np.random.default_rng(0)
    for count in (1, 2, 30):
        places = random.uniform(0, 4, (count, 3))
        parts = {7 * i: Component(Manifold.cube(tuple(random.uniform(0.1, 1, 3))).translate(tuple(places[i])))
                 for i in range(count)}  # fmt: skip
        corners = {i: part.box for i, part in parts.items()}

        def near(i: int, j: int, corners=corners) -> bool:
            gap = np.maximum(np.maximum(corners[i][0] - corners[j][1], corners[j][0] - corners[i][1]), 0)
            return bool(np.linalg.norm(gap) <= 0.2)

        new = [7 * i for i in range(0, count, 3)]
        expected = {
            (min(i, j), max(i, j))
            for i in new
            for j in parts
            if i != j and (near(i, j) or (across and any(near(i, k) and near(k, j) for k in parts)))
        }
        boxes = _native.Boxes([part.hull.corners for part in parts.values()], list(parts))
        assert boxes.pairs(new, 0.2, across).tolist() == [list(pair) for pair in sorted(expected)]


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(5))
def test_gluing_undoes_a_cut(name: str, seed: int) -> None:
    solid = Component(SOLIDS[name]())
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    below, above = solid.cut(Plane(tuple(normal), float(normal @ solid.vertices.mean(axis=0))))
    glued = Part.glued(below, above)
    assert glued.volume == pytest.approx(solid.volume)
    area = _native.mesh_area(glued.vertices, glued.faces)
    assert area == pytest.approx(_native.mesh_area(solid.vertices, solid.faces), rel=1e-5)
    assert glued.hull.volume == pytest.approx(solid.hull.volume)


def test_only_the_common_area_of_two_faces_vanishes() -> None:
    base = Component(Manifold.cube((3, 3, 1)))
    tower = Component(Manifold.cube((1, 1, 2)).translate((1, 1, 1)))
    glued = Part.glued(base, tower)
    assert _native.mesh_area(glued.vertices, glued.faces) == pytest.approx(30 + 10 - 2)


def test_coplanar_faces_on_the_same_side_stay() -> None:
    left = Component(Manifold.cube((1, 1, 1)))
    right = Component(Manifold.cube((1, 1, 1)).translate((2, 0, 0)))
    glued = Part.glued(left, right)
    assert _native.mesh_area(glued.vertices, glued.faces) == pytest.approx(12)


def test_parts_that_are_all_film_keep_their_surfaces() -> None:
    """Every face of such a part touches the other one: without a surface there would be nothing to measure."""
    below = Component(Manifold.cube((1, 1, 2e-9)))
    above = Component(Manifold.cube((1, 1, 2e-9)).translate((0, 0, 2e-9)))
    glued = Part.glued(below, above)
    assert len(glued.faces) == len(below.faces) + len(above.faces)
