"""The plane sweep against real cuts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, Mesh64
from scipy.spatial import ConvexHull, QhullError

from rlacd import _native
from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.sweep import sweep
from rlacd.solid.component import Component, Plane


def from_trimesh(mesh: trimesh.Trimesh) -> Manifold:
    return Manifold(Mesh64(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.uint64)))


def gear() -> Manifold:
    teeth = [Manifold.cube((0.3, 0.2, 0.4), True).translate((1, 0, 0)).rotate((0, 0, 40 * i)) for i in range(9)]
    return sum(teeth, Manifold.cylinder(0.3, 1, circular_segments=48)) - Manifold.cylinder(2, 0.3, 0.3, 24, True)


SOLIDS = {
    "L": lambda: Manifold.cube((2, 1, 1)) + Manifold.cube((1, 2, 1)),
    "gear": gear,
    "torus": lambda: from_trimesh(trimesh.creation.torus(1, 0.3)),
    "shell": lambda: (
        Manifold.sphere(1, 48) - Manifold.sphere(0.95, 48) - Manifold.cube((3, 3, 3), True).translate((0, 0, 2))
    ),
    "two bodies": lambda: Manifold.sphere(1, 24) + Manifold.cube((1, 1, 1)).translate((2, 0, 0)),
    "tilted": lambda: gear().rotate((17, 31, 5)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_sweep_equals_real_cuts(name: str) -> None:
    component = Component(SOLIDS[name]())
    scored = sweep(component, axis_and_principal(component))
    total = component.volume
    for index in range(0, len(scored.candidates), 3):
        plane = scored.candidates.plane(index)
        above, below = component.manifold.split_by_plane(plane.normal, plane.offset)
        for side, solid, hull in (
            (below, scored.solid_below, scored.hull_below),
            (above, scored.solid_above, scored.hull_above),
        ):
            assert solid[index] == pytest.approx(side.volume(), abs=1e-9 * total)
            points = np.asarray(side.to_mesh64().vert_properties[:, :3])
            try:
                expected = ConvexHull(points).volume
            except (QhullError, ValueError):
                expected = 0.0
            assert hull[index] == pytest.approx(expected, rel=1e-9, abs=1e-12)
        section = component.manifold.rotate(_upright(plane.normal)).slice(plane.offset)
        assert scored.section_area[index] == pytest.approx(section.area(), abs=1e-6)


def _upright(normal: tuple[float, float, float]) -> tuple[float, float, float]:
    """Euler angles (degrees, x then y then z) that turn the normal to +z."""
    x, y, z = normal
    about_x = np.degrees(np.arctan2(y, z))
    about_y = -np.degrees(np.arctan2(x, np.hypot(y, z)))
    return (float(about_x), float(about_y), 0.0)


def test_section_of_a_box() -> None:
    component = Component(Manifold.cube((1, 2, 3)))
    scores = _native.sweep(component.vertices, component.faces, np.eye(3), np.full((3, 1), 0.25), 1)
    area, perimeter = scores[:, 4], scores[:, 5]
    assert area == pytest.approx([6, 3, 2])
    assert perimeter == pytest.approx([10, 8, 6])
    assert scores[:, 6] == pytest.approx([0.25] * 3)
    assert scores[:, 7] == pytest.approx([0.75, 1.75, 2.75])
    assert scores[:, 8] == pytest.approx([3, 3, 2])


def test_vertices_on_the_plane_belong_to_both_sides() -> None:
    component = Component(Manifold.cube((1, 1, 1)) + Manifold.cube((1, 1, 1)).translate((1, 1, 0)))
    scores = _native.sweep(component.vertices, component.faces, np.eye(3)[:1], np.array([[1.0]]), 1)
    assert scores[0, :2] == pytest.approx([1, 1])


def test_planes_that_miss_or_shave_are_invalid() -> None:
    component = Component(Manifold.cube((4, 4, 1)))
    scored = sweep(component, axis_and_principal(component))
    valid = scored.valid().reshape(6, 25)
    assert valid[0].all()
    assert valid[1].all()
    assert not valid[2, 0], "a slice of 1/26 of the height is thinner than 2 % of the plate"
    assert valid[2, 12]


def test_same_bits_for_any_number_of_threads() -> None:
    component = Component(gear().rotate((3, 5, 7)))
    candidates = axis_and_principal(component)
    one, many = (
        _native.sweep(component.vertices, component.faces, candidates.directions, candidates.offsets, threads)
        for threads in (1, 5)
    )
    assert np.array_equal(one, many)


def test_rows_of_equal_directions_share_a_sweep() -> None:
    component = Component(gear())
    grid = axis_and_principal(component)
    extra = Candidates(np.eye(3)[[2, 0, 2, 0]], np.array([[0.4], [0.3], [0.15], [0.4]]))
    joined = Candidates.joined(grid, extra)
    assert [joined.plane(i) for i in (0, 40, 150, 153)] == [
        grid.plane(0),
        grid.plane(40),
        Plane((0.0, 0.0, 1.0), 0.4),
        Plane((1.0, 0.0, 0.0), 0.4),
    ]
    together, apart = sweep(component, joined), (sweep(component, grid), sweep(component, extra))
    for scores in ("hull_below", "hull_above", "solid_below", "section_area", "thickness_above", "extent_below"):
        expected = np.concatenate([getattr(part, scores) for part in apart])
        assert getattr(together, scores) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("offsets", [[0.5, 0.2], [0.2, np.nan], [np.inf, np.inf]])
def test_offsets_have_to_be_finite_and_ascend(offsets: list[float]) -> None:
    component = Component(Manifold.cube((1, 1, 1)))
    with pytest.raises(ValueError, match="finite and ascend"):
        _native.sweep(component.vertices, component.faces, np.eye(3)[:1], np.array([offsets]), 1)
