"""The plane sweep against real cuts; the tree of cuts, where a second policy takes over and slivers are halved."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold, Mesh64
from scipy.spatial import ConvexHull, QhullError

from rlacd import _native, cut
from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.decompose_mesh import decompose
from rlacd.planes.candidates import OFFSETS_PER_AXIS, Candidates, all_planes
from rlacd.planes.sweep import SLIVERS, Sweep, SweepCache, least_excess, sweep
from rlacd.policies import SCORES, Greedy
from rlacd.policies.greedy import excess_norm, hull_sum
from rlacd.run import Run
from rlacd.solid.arrays import FloatArray, IntArray
from rlacd.solid.component import Component, Plane
from rlacd.solid.frame import ROUNDING
from rlacd.solid.manifold import to_manifold
from tests.shapes import box


def axis_and_principal(component: Component) -> Candidates:
    """The paper's directions, with all planes of one in a row."""
    planes = all_planes(component, OFFSETS_PER_AXIS, 0)
    directions = np.ascontiguousarray(planes.directions[::OFFSETS_PER_AXIS])
    return Candidates(directions, planes.offsets.reshape(-1, OFFSETS_PER_AXIS))


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
        flat = trimesh.geometry.plane_transform(plane.offset * np.array(plane.normal), plane.normal)
        section = whole.transform(flat[:3]).slice(0)
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


DEGENERATE = {"crowded 12": crowded_pyramid(12), "crowded 40": crowded_pyramid(40), "fin": finned_tetrahedron()}


@pytest.mark.parametrize("solid", DEGENERATE.values(), ids=DEGENERATE)
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


def test_section_of_a_box() -> None:
    component = Component(Manifold.cube((1, 2, 3)))
    scores = _native.sweep(component.vertices, component.faces, np.eye(3), np.full((3, 1), 0.25), 1)
    area, perimeter = scores[:, 4], scores[:, 5]
    assert area == pytest.approx([6, 3, 2])
    assert perimeter == pytest.approx([10, 8, 6])
    assert scores[:, 6] == pytest.approx([0.25] * 3)
    assert scores[:, 7] == pytest.approx([0.75, 1.75, 2.75])
    assert scores[:, 8] == pytest.approx([3, 3, 2])


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
@pytest.mark.parametrize("name", [*SOLIDS, *DEGENERATE])
def test_it_is_the_plane_that_a_sweep_of_all_finds(name: str, score: str) -> None:
    component = Component(SOLIDS[name]() if name in SOLIDS else DEGENERATE[name])
    sweeps = SweepCache()
    swept = sweeps.of(component)
    found = least_excess(component, sweeps.candidates(component), EXPONENTS[score])
    assert found == cheapest(swept, COSTS[score](swept))


def test_the_first_of_equal_planes_is_taken() -> None:
    solid = Component(gear() + gear().translate((4, 0, 0)).mirror((1, 0, 0)).translate((4, 0, 0)))
    waist = 0.5 * (solid.box[0, 0] + solid.box[1, 0])
    for shift in (0.3, -0.3):  # the solid is symmetric about its waist
        candidates = Candidates(np.eye(3)[[0, 0]], np.array([[waist + shift], [waist - shift]]))
        assert least_excess(solid, candidates, 1.3) == Plane((1.0, 0.0, 0.0), waist + shift)


def test_slivers_are_left_only_where_every_plane_leaves_one() -> None:
    notched = Component(Manifold.cube((4, 4, 1)) - Manifold.cube((1, 1, 0.02)))
    sliver, middle = Candidates(np.eye(3)[2:], np.array([[0.02]])), Candidates(np.eye(3)[2:], np.array([[0.02, 0.5]]))
    plane = least_excess(notched, sliver, 1.0)
    assert plane.offset == 0.02, "nothing else is left"
    plane = least_excess(notched, middle, 1.0)
    assert plane.offset == 0.5, "the notch is not worth a sliver"
    assert least_excess(notched, Candidates(np.eye(3)[2:], np.array([[-1.0, 0.0, 1.0, 7.0]])), 1.0) is None
    assert least_excess(notched, Candidates(np.zeros((0, 3)), np.zeros((0, 1))), 1.0) is None


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


@pytest.mark.parametrize("units", [0.0, 3e3])
def test_work_ends_the_cutting(units: float) -> None:
    with Run(1) as run:
        _, left = CutTree(cross(), Slices(), run).cut_until(CRITERION, math.inf, units)
    assert left
    assert run.work.done > units


@pytest.mark.usefixtures("few")
def test_limits_on_parts_see_the_same_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    """The default policy, made to fail, is replaced in `decompose` too; a chosen one is not."""
    monkeypatch.setattr("rlacd.find_parts.make_policy", lambda *_: Slices())
    options = {"quality": "fast", "merge": False, "threshold": 0.05, "threads": 1}
    mesh = cross().vertices, cross().faces
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


def test_a_sliver_that_no_plane_cuts_is_halved_until_it_is_done() -> None:
    with Run(1) as run:
        sliver = gutter(1e-4)
        parts = cut_by(CutTree(sliver, Never(), run))
        assert 4 <= len(parts) <= 64
        assert sum(part.volume for part in parts) == pytest.approx(sliver.volume, rel=1e-6)
        corners = np.concatenate([part.vertices for part in parts])
        assert np.allclose([corners.min(axis=0), corners.max(axis=0)], sliver.box, atol=1e-12)


def test_a_sliver_inside_out_is_halved_and_a_body_is_left_as_it_is() -> None:
    with Run(1) as run:
        sliver = gutter(1e-4)
        turned = Component((sliver.vertices, np.ascontiguousarray(sliver.faces[:, ::-1])))
        assert turned.volume < 0
        below, above = turned.halved(0.5, principal=False, least=-math.inf)
        assert below.volume + above.volume == pytest.approx(turned.volume, rel=1e-6)
        body = gutter(0.1)
        assert CutTree(body, Never(), run).cut_until(CRITERION) == ([], [body])
