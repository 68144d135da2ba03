"""What can rest on a flat side rests on the hulls too; hulls grow to what of the input lies just outside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import rlacd
from rlacd.criteria import Concavity
from rlacd.finish.finish import take_in
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.solid.component import Component, Part
from rlacd.solid.distance import hull_union
from rlacd.solid.resting import resting_sides
from tests.bounded import bounded
from tests.shapes import box, trimesh_of

DEEP = 1e-4
"""How far hulls may reach through the ground (the longest side is 2)."""


def test_a_box_rests_on_every_side_and_a_sphere_on_none() -> None:
    assert len(resting_sides(Component(box((-1, -1, -0.2), (1, 1, 0.2))))) == 6
    assert len(resting_sides(Component(Manifold.sphere(1.0, 64)))) == 0


def _of_a_fine_ball() -> tuple[int, int]:
    ball = Manifold.sphere(1.0, 400)  # 80,000 triangles
    stopped = rlacd.decompose(trimesh_of(ball), timeout=0.01, threads=1)
    return len(resting_sides(Component(ball))), len(stopped)


@pytest.mark.slow
def test_a_fine_ball_takes_no_more_time_than_its_number_of_facets_asks_for() -> None:
    """Pairs of its facets or corners would take minutes."""
    assert bounded(_of_a_fine_ball, seconds=20) == (0, 1)


def test_it_does_not_rest_where_its_centre_of_mass_is_not_above() -> None:
    wedge = Component(box((0, 0, 0), (0.4, 0.4, 2)) + box((0, 0, 1.6), (2, 0.4, 2)))
    sides = resting_sides(wedge)
    assert not (sides[:, 2] < -0.99).any()
    assert (sides[:, 2] > 0.99).any()


@pytest.mark.promise("flat")
def test_a_bowl_stands_on_its_small_foot() -> None:
    bowl = Manifold.sphere(1.0, 64).trim_by_plane((0, 0, -1), 0).trim_by_plane((0, 0, 1), -0.995)
    (hull,) = rlacd.decompose(trimesh_of(bowl), threads=1)
    assert hull.vertices[:, 2].min() == pytest.approx(-0.995, abs=DEEP)


@pytest.mark.promise("flat")
@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"quality": "fast", "max_vertices": 24}])
@pytest.mark.parametrize(
    "name",
    [
        "vhacd/ob_chess_table.ply",
        *(pytest.param(name, marks=pytest.mark.nightly) for name in ("coacd_examples/KitchenPot.ply", "vhacd/al.ply")),
    ],
)
def test_real_objects_stand_where_they_stood(corpus: Path, name: str, options: dict[str, object]) -> None:
    solid = repair(load_mesh(corpus / "test" / name), resolution=100, threads=1)
    result = rlacd.decompose(corpus / "test" / name, threads=1, **options)  # type: ignore[arg-type]
    points = solid.frame.to_frame(np.concatenate([hull.vertices for hull in result]))
    sides = resting_sides(Component(solid.shape))
    assert len(sides) > 0
    assert np.abs((points @ sides[:, :3].T).max(axis=0) - sides[:, 3]).max() <= DEEP


def brick(x: float, bottom: float = 0.0, top: float = 1.0) -> Component:
    """A box from x to x + 1."""
    mesh = trimesh.creation.box(bounds=[(x, -0.5, bottom), (x + 1, 0.5, top)])
    return Component((np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32)))


def outside(parts: list[Part], points: np.ndarray) -> float:
    return float(hull_union([part.hull for part in parts], 1).distance(points, 1).max())


def test_each_point_goes_to_the_hull_that_has_to_grow_least() -> None:
    parts: list[Part] = [brick(0), brick(1), brick(5)]
    points = np.array([(0.2, 0.1, 1.002), (1.9, 0.1, 1.001), (1.5, 0, 1.003)])
    grown = take_in(parts, points, Concavity(0.05))
    assert outside(grown, points) <= 1e-9
    assert grown[0].hull.vertices[:, 2].max() == pytest.approx(1.002)
    assert grown[1].hull.vertices[:, 2].max() == pytest.approx(1.003)
    assert grown[2] is parts[2]


@pytest.mark.promise("covered")
def test_a_hull_grows_only_if_its_part_then_meets_the_criterion() -> None:
    parts, points = [brick(0), brick(1)], np.array([(0.5, 0, 1.004), (1.5, 0, 1.001)])
    grown = take_in(parts, points, Concavity(0.05))
    errors = [Concavity(0.05).error(part) for part in grown]
    assert errors[0] > errors[1]
    grown = take_in(parts, points, Concavity(sum(errors) / 2))
    assert grown[0] is parts[0]
    assert outside(grown, points[1:]) <= 1e-9


def test_a_hull_that_is_going_to_be_dropped_does_not_keep_others_from_growing() -> None:
    sliver, points = brick(0, bottom=1.0, top=1.001), np.array([(0.5, 0, 1.001)])
    assert outside(take_in([brick(0), sliver], points, Concavity(0.05))[:1], points) <= 1e-9
