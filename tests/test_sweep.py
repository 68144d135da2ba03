"""The plane sweep against real cuts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, Mesh64
from scipy.spatial import ConvexHull, QhullError

from rlacd import _native
from rlacd.planes.candidates import axis_and_principal
from rlacd.planes.sweep import sweep
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component
from rlacd.solid.manifold import to_manifold


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


def hull_volume(points: FloatArray) -> float:
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


@pytest.mark.parametrize("name", SOLIDS)
def test_sweep_equals_real_cuts(name: str) -> None:
    component = Component(SOLIDS[name]())
    scored = sweep(component, axis_and_principal(component))
    total, whole = component.volume, to_manifold(component.vertices, component.faces)
    for index in range(0, len(scored.candidates), 3):
        plane = scored.candidates.plane(index)
        above, below = whole.split_by_plane(plane.normal, plane.offset)
        for side, solid, hull in (
            (below, scored.solid_below, scored.hull_below),
            (above, scored.solid_above, scored.hull_above),
        ):
            assert solid[index] == pytest.approx(side.volume(), abs=1e-9 * total)
            points = np.asarray(side.to_mesh64().vert_properties[:, :3])
            assert hull[index] == pytest.approx(hull_volume(points), rel=1e-9, abs=1e-12)
        section = whole.rotate(_upright(plane.normal)).slice(plane.offset)
        assert scored.section_area[index] == pytest.approx(section.area(), abs=1e-6)


def crowded_pyramid(apexes: int) -> tuple[FloatArray, IntArray]:
    """A pyramid over a star whose apex is many vertices, joined by edges and triangles of no size."""
    angle = 2 * np.pi * np.arange(apexes) / apexes
    radius = np.where(np.arange(apexes) % 2 == 0, 1.0, 0.5)
    base = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(apexes)], axis=1)
    vertices = np.concatenate([base, np.tile([0.1, 0.2, 1.0], (apexes, 1)), np.zeros((1, 3))])
    i, after = np.arange(apexes), np.roll(np.arange(apexes), -1)
    bottom = np.stack([after, i, np.full(apexes, 2 * apexes)], axis=1)
    sides = [np.stack([i, after, i + apexes], axis=1), np.stack([after, after + apexes, i + apexes], axis=1)]
    fan = apexes + np.arange(1, apexes - 1)
    top = np.stack([np.full_like(fan, apexes), fan, fan + 1], axis=1)
    return vertices, np.concatenate([bottom, *sides, top]).astype(np.int32)


def finned_tetrahedron() -> tuple[FloatArray, IntArray]:
    """A tetrahedron with a fin of no thickness: to its blunt tip, more edges lead from one side than from the other."""
    p, q, r, s = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 1.0, 0.0), (0.5, 0.5, 1.0)
    vertices = np.array([p, q, r, s, (0.01, 0.0, 0.0), (0.5, -0.1, -0.1)])
    p, q, r, s, middle, tip = range(6)
    tetrahedron = [(p, r, middle), (middle, r, q), (q, s, middle), (middle, s, p), (p, s, r), (s, q, r)]
    fin = [(p, middle, tip), (middle, q, tip), (middle, p, tip), (q, middle, tip)]
    return vertices, np.array([*tetrahedron, *fin], dtype=np.int32)


@pytest.mark.parametrize("solid", [crowded_pyramid(12), crowded_pyramid(40), finned_tetrahedron()])
def test_corners_count_where_the_mesh_is_degenerate(solid: tuple[FloatArray, IntArray]) -> None:
    component = Component(solid)
    vertices, faces = solid
    corners = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    scored = sweep(component, axis_and_principal(component))
    assert component.volume > 0
    for index in range(len(scored.candidates)):
        plane = scored.candidates.plane(index)
        height = vertices @ plane.normal - plane.offset
        low, high = height[corners[:, 0]], height[corners[:, 1]]
        cross = low * high < 0
        share = (low / np.where(cross, low - high, 1))[cross, None]
        crossing = (1 - share) * vertices[corners[cross, 0]] + share * vertices[corners[cross, 1]]
        for side, hull in ((height <= 0, scored.hull_below), (height >= 0, scored.hull_above)):
            expected = hull_volume(np.concatenate([vertices[side], crossing]))
            assert hull[index] == pytest.approx(expected, rel=1e-9, abs=1e-12)


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


@pytest.mark.parametrize("offsets", [[0.5, 0.2], [0.2, np.nan], [np.inf, np.inf]])
def test_offsets_have_to_be_finite_and_ascend(offsets: list[float]) -> None:
    component = Component(Manifold.cube((1, 1, 1)))
    with pytest.raises(ValueError, match="finite and ascend"):
        _native.sweep(component.vertices, component.faces, np.eye(3)[:1], np.array([offsets]), 1)
