"""What can rest on a flat side rests on the hulls at the same height, whatever corners they leave out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

import rlacd
from rlacd.finish.limit import resting_sides
from rlacd.io.read.load import load_mesh
from rlacd.options.presets import HullLimits
from rlacd.repair.repair import repair
from rlacd.solid.component import Component
from rlacd.solid.hull import TOLERANCE, limit_hull
from tests.shapes import box

DEEP = 1e-4
"""How far hulls may reach through the ground (the longest side is 2)."""


def cup() -> Manifold:
    outer = Manifold.cylinder(1.2, 0.5, 0.6, 48)
    return outer - Manifold.cylinder(1.2, 0.4, 0.5, 48).translate([0, 0, 0.1])


def test_a_box_rests_on_every_side_and_a_sphere_on_none() -> None:
    assert len(resting_sides(Component(box((-1, -1, -0.2), (1, 1, 0.2))))) == 6
    assert len(resting_sides(Component(Manifold.sphere(1.0, 64)))) == 0


def test_it_does_not_rest_where_its_centre_of_mass_is_not_above() -> None:
    wedge = Component(box((0, 0, 0), (0.4, 0.4, 2)) + box((0, 0, 1.6), (2, 0.4, 2)))
    sides = resting_sides(wedge)
    assert not (sides[:, 2] < -0.99).any()
    assert (sides[:, 2] > 0.99).any()


@pytest.mark.parametrize("corners", [8, 12, 24])
def test_a_simpler_hull_stays_above_the_ground(corners: int) -> None:
    solid = Component(cup())
    ground = np.array([[0.0, 0.0, -1.0, TOLERANCE]])
    simple = limit_hull(solid.hull, HullLimits(corners, None), 0.02, ground)
    assert len(simple.vertices) <= corners
    assert simple.vertices[:, 2].min() >= -2 * TOLERANCE


@pytest.mark.promise("flat")
@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"quality": "fast", "max_vertices": 24}])
@pytest.mark.parametrize(
    "name",
    ["vhacd/ob_chess_table.ply", "coacd_examples/KitchenPot.ply", "ikea_assembled/table_benno_0141.ply"],
)
def test_real_objects_stand_where_they_stood(corpus: Path, name: str, options: dict[str, object]) -> None:
    solid = repair(load_mesh(corpus / "test" / name), resolution=100, threads=1)
    result = rlacd.decompose(corpus / "test" / name, threads=1, **options)  # type: ignore[arg-type]
    points = solid.frame.to_frame(np.concatenate([hull.vertices for hull in result]))
    sides = resting_sides(Component(solid.shape))
    assert len(sides) > 0
    for *normal, offset in sides:
        assert abs((points @ normal).max() - offset) <= DEEP
