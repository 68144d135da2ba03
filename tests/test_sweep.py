"""The plane sweep against real cuts."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, Mesh64
from scipy.spatial import ConvexHull, QhullError

from rlacd import _native
from rlacd.planes.candidates import Candidates, axis_and_principal
from rlacd.planes.sweep import SLIVER, SLIVERS, Sweep, SweepCache, least_excess, sweep
from rlacd.policies import SCORES
from rlacd.policies.greedy import excess_norm, hull_sum
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Plane
from rlacd.solid.frame import ROUNDING
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


# --- the plane of least excess ----------------------------------------------------------------------------------------


EXPONENTS = {"hull_sum": 1.0, "max_excess": math.inf, "excess_norm": SCORES["excess-norm"]}
COSTS = {"hull_sum": hull_sum, "max_excess": lambda swept: excess_cost(swept, math.inf), "excess_norm": excess_norm}


def excess_cost(swept: Sweep, exponent: float) -> FloatArray:
    below = np.maximum(swept.hull_below - swept.solid_below, 0)
    above = np.maximum(swept.hull_above - swept.solid_above, 0)
    return np.maximum(below, above) if math.isinf(exponent) else below**exponent + above**exponent


def cheapest(scored: Sweep, cost: FloatArray) -> Plane | None:
    """The first of the valid planes of least cost; those that leave slivers only if there is no other."""
    for sliver in SLIVERS:
        valid = scored.valid(sliver)
        if valid.any():
            equal = cost[valid].min() + ROUNDING * cost[valid].max()
            return scored.candidates.plane(int(np.argmax(valid & (cost <= equal))))
    return None


@pytest.mark.parametrize("score", EXPONENTS)
@pytest.mark.parametrize("name", SOLIDS)
def test_it_is_the_plane_that_a_sweep_of_all_finds(name: str, score: str) -> None:
    component = Component(SOLIDS[name]())
    sweeps = SweepCache()
    swept = sweeps.of(component)
    found = least_excess(component, sweeps.candidates(component), EXPONENTS[score])
    assert found == cheapest(swept, COSTS[score](swept))


@pytest.mark.parametrize("solid", [crowded_pyramid(12), crowded_pyramid(40), finned_tetrahedron()])
def test_it_is_so_where_the_mesh_is_degenerate(solid: tuple[FloatArray, IntArray]) -> None:
    component = Component(solid)
    candidates = axis_and_principal(component)
    swept = sweep(component, candidates)
    assert least_excess(component, candidates, EXPONENTS["excess_norm"]) == cheapest(swept, excess_norm(swept))


@st.composite
def blocks_and_planes(draw: st.DrawFn) -> tuple[Component, Candidates]:
    """A few blocks with corners on a coarse grid, and planes on it and off it: many meet faces, some miss the solid."""
    grid = st.integers(0, 6)
    solid = Manifold()
    for _ in range(draw(st.integers(1, 4))):
        corner = [draw(grid) / 4 for _ in range(3)]
        solid += Manifold.cube([draw(st.integers(1, 4)) / 4 for _ in range(3)]).translate(corner)
    if draw(st.booleans()):
        solid = solid.rotate((0, 0, 45)) + Manifold.sphere(draw(st.integers(1, 3)) / 4, 12)
    directions, offsets = [], []
    for _ in range(draw(st.integers(1, 8))):
        normal = np.array([draw(st.integers(-2, 2)) for _ in range(3)], dtype=np.float64)
        if not normal.any():
            normal[2] = 1
        directions.append(normal / np.linalg.norm(normal))
        offsets.append(sorted(draw(st.lists(st.integers(-4, 12).map(lambda i: i / 4), min_size=5, max_size=5))))
    return Component(solid), Candidates(np.array(directions) + 0.0, np.array(offsets))


@settings(max_examples=150, deadline=None)
@given(blocks_and_planes(), st.sampled_from([1.0, 1.3, 2.0, math.inf]))
def test_no_valid_plane_costs_less(case: tuple[Component, Candidates], exponent: float) -> None:
    component, candidates = case
    swept = sweep(component, candidates)
    valid = next((v for s in (SLIVER, SLIVER / 100) if (v := swept.valid(s)).any()), None)
    found = least_excess(component, candidates, exponent)
    if valid is None:
        assert found is None
        return
    cost = excess_cost(swept, exponent)
    chosen = next(i for i in np.flatnonzero(valid) if candidates.plane(int(i)) == found)
    # Excesses are differences of volumes: those of nearly convex solids are nothing but rounding.
    rounding = 1e-12 * component.hull.volume
    rounding = rounding if math.isinf(exponent) else exponent * component.hull.volume ** (exponent - 1) * rounding
    most = component.hull.volume - (0 if exponent == 1 else component.volume)
    tie = 1e-9 * max(most, 0.0) ** (1 if math.isinf(exponent) else exponent)
    assert cost[chosen] <= cost[valid].min() + tie + rounding


def test_the_first_of_equal_planes_is_taken() -> None:
    solid = Component(gear() + gear().translate((4, 0, 0)).mirror((1, 0, 0)).translate((4, 0, 0)))
    waist = 0.5 * (solid.box[0, 0] + solid.box[1, 0])
    for shift in (0.3, -0.3):  # the solid is symmetric about its waist
        candidates = Candidates(np.eye(3)[[0, 0]], np.array([[waist + shift], [waist - shift]]))
        assert least_excess(solid, candidates, 1.3) == Plane((1.0, 0.0, 0.0), waist + shift)


def test_slivers_are_left_only_where_every_plane_leaves_one() -> None:
    notched = Component(Manifold.cube((4, 4, 1)) - Manifold.cube((1, 1, 0.02)))
    shaving, middle = Candidates(np.eye(3)[2:], np.array([[0.02]])), Candidates(np.eye(3)[2:], np.array([[0.02, 0.5]]))
    plane = least_excess(notched, shaving, 1.0)
    assert plane.offset == 0.02, "nothing else is left"
    plane = least_excess(notched, middle, 1.0)
    assert plane.offset == 0.5, "the notch is not worth a film"
    assert least_excess(notched, Candidates(np.eye(3)[2:], np.array([[-1.0, 0.0, 1.0, 7.0]])), 1.0) is None
    assert least_excess(notched, Candidates(np.zeros((0, 3)), np.zeros((0, 1))), 1.0) is None


def ask(vertices: FloatArray, offsets: list[float], exponent: float = 1.3, tie: float = 0.0) -> int:
    faces = Component(gear()).faces
    return _native.find_least_excess(
        vertices, faces, np.eye(3)[:1], np.array([offsets]), exponent, tie, 1e-11, [SLIVER], 1
    )


def test_what_makes_no_sense_is_refused() -> None:
    vertices = Component(gear()).vertices
    assert ask(vertices, [0.1, 0.2]) in (0, 1)
    with pytest.raises(ValueError, match="finite and ascend"):
        ask(vertices, [0.5, 0.2])
    with pytest.raises(ValueError, match="finite and ascend"):
        ask(vertices, [0.2, math.nan])
    with pytest.raises(ValueError, match="exponent"):
        ask(vertices, [0.2], exponent=0.9)
    with pytest.raises(ValueError, match="exponent"):
        ask(vertices, [0.2], exponent=math.nan)
    with pytest.raises(ValueError, match="tie"):
        ask(vertices, [0.2], tie=-1.0)
    with pytest.raises(ValueError, match="not finite"):
        ask(np.where(vertices == vertices.max(), np.nan, vertices), [0.2])
