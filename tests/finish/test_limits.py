"""Limits on hulls and on their number: kept, convex, around the given hull, not much larger, never worse for more."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from manifold3d import Manifold

import rlacd
from fuzz.geometry import Polytope, why_not_convex
from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.criteria.limited import limited_part
from rlacd.extras.limit import few_enough, united_in_turn
from rlacd.finish.finish import limit_part
from rlacd.options.presets import HullLimits
from rlacd.run import Run, Work
from rlacd.solid.component import Component
from rlacd.solid.hull import NO_LIMITS, Hull, limit_hull
from tests.hulls import assert_same_hulls
from tests.shapes import box, trimesh_of


def exactly_inside(point: np.ndarray, hull: Hull) -> bool:
    """Whether a point lies on or below the plane of every facet, in exact arithmetic."""
    where = [Fraction(float(x)) for x in point]
    for face in hull.faces:
        a, b, c = ([Fraction(float(x)) for x in hull.vertices[n]] for n in face)
        u, v, p = ([x - y for x, y in zip(there, a, strict=True)] for there in (b, c, where))
        normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        if sum(n * x for n, x in zip(normal, p, strict=True)) > 0:
            return False
    return True


def check(hull: Hull, max_vertices: int | None = None, max_faces: int | None = None) -> Hull:
    limits = HullLimits(max_vertices, max_faces)
    limited, evened = limit_hull(hull, limits), limit_hull(hull, limits, enough=0.0)
    for other in (limited, evened):
        assert len(other.vertices) <= (max_vertices or len(hull.vertices))
        assert len(other.faces) <= (max_faces or len(hull.faces))
        assert len(other.faces) == 2 * len(other.vertices) - 4
        rounding = 1e-12 * max(1.0, float(np.abs(other.vertices).max()))
        assert Polytope(other.vertices, other.faces).height(hull.vertices).max() < rounding
        assert other.volume >= hull.volume * (1 - 1e-9)
        again = Hull.of(other.vertices)
        assert len(again.vertices) == len(other.vertices)
        assert other.volume == pytest.approx(again.volume, rel=1e-12)
    surface = _native.Surface(hull.vertices, hull.faces)
    assert surface.distance(evened.vertices).max() <= surface.distance(limited.vertices).max()
    return limited


def test_corners_that_stick_out_too_far_are_evened_out() -> None:
    """No 64 corners around a ball stick out by less than 3.9%, no 32 by less than 8%."""
    ball = Hull.of(trimesh.creation.icosphere(4).vertices)
    for most, plain, even in ((64, 0.08, 0.05), (32, 0.15, 0.1)):
        sizes = [
            np.sqrt((limit_hull(ball, HullLimits(most), enough=e).vertices ** 2).sum(axis=1)).max() for e in (9, 0)
        ]
        assert sizes[0] > 1 + plain
        assert sizes[1] < 1 + even


def test_flat_sides_of_many_corners() -> None:
    """The ends of a cylinder of 1,200 sides: this takes a minute where every line across them counts as an edge."""
    hull = Hull.of(trimesh.creation.cylinder(1, 1, sections=1200).vertices)
    simple = limit_hull(hull, tolerance=0.01)
    assert len(simple.vertices) < 100
    assert Polytope(simple.vertices, simple.faces).height(hull.vertices).max() < 1e-12
    assert simple.volume < 1.02 * hull.volume


points = hnp.arrays(np.float64, st.tuples(st.integers(5, 40), st.just(3)), elements=st.floats(-1, 1, width=32))


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(points, st.integers(4, 20))
@pytest.mark.promise("limits")
def test_any_hull_within_any_limit(cloud: np.ndarray, most: int) -> None:
    hull = Hull.of(cloud)
    assume(hull is not None and hull.volume >= 1e-9)
    for limited in (check(hull, max_vertices=most), check(hull, max_faces=most)):
        assert hull.volume < 1e-6 or why_not_convex(limited.vertices, limited.faces, exactly=True) is None


@pytest.mark.parametrize("thickness", [1e-10, 1e-12, 1e-14])
@pytest.mark.parametrize("plate", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_hardly_there_is_held(seed: int, plate: bool, thickness: float) -> None:
    random = np.random.default_rng(seed)
    hull = Hull.of(random.uniform(-1, 1, (40, 3)) * [1, 0.8 if plate else thickness, thickness])
    limited = limit_hull(hull, HullLimits(int(random.integers(4, 13))))
    assert len(limited.vertices) <= 12
    assert why_not_convex(limited.vertices, limited.faces, exactly=True) is None
    middle = hull.vertices.mean(axis=0)
    assert all(exactly_inside(middle + (1 - 1e-9) * (p - middle), limited) for p in hull.vertices)
    assert np.ptp(limited.vertices[:, 2]) < 1e-7


CUBE = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
RANDOM = np.random.default_rng(1).normal(size=(500, 3))
ANGLES = np.linspace(0, 2 * np.pi, 64, endpoint=False)
ROUND = {
    "chamfered cube": np.vstack([CUBE * np.roll([1, 1, 0.9], k) for k in range(3)]),
    "prism": np.vstack([np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.full(64, z)]) for z in (-1, 1)]),
    "ball": RANDOM / np.linalg.norm(RANDOM, axis=1)[:, None],
}


# For comparison: circumscribed platonic bodies of a ball with 12, 6 and 4 corners add 21 %, 65 % and 231 %, two
# regular octagons around a circle 5.5%, and the cube is what a chamfered cube should become.
@pytest.mark.parametrize(
    ("name", "most", "growth"),
    [
        *(("ball", *row) for row in ((64, 0.055), (32, 0.11), (16, 0.28), (12, 0.4), (8, 0.8), (6, 1.5), (4, 3.0))),
        ("prism", 16, 0.075),
        ("chamfered cube", 8, 8 / Hull.of(ROUND["chamfered cube"]).volume - 1 + 1e-6),
    ],
)
def test_limits_add_little(name: str, most: int, growth: float) -> None:
    hull = Hull.of(ROUND[name])
    limited = check(hull, max_vertices=most)
    assert limited.volume < hull.volume * (1 + growth)
    assert name == "ball" or np.ptp(limited.vertices[:, 2]) < 2 + 1e-6, "what is flat stays so"


def test_box_of_eight_is_left_alone() -> None:
    hull = Hull.of(np.array(np.meshgrid([0, 1], [0, 2], [0, 3])).reshape(3, -1).T.astype(float))
    assert limit_hull(hull, HullLimits(8)) is hull
    assert limit_hull(hull) is hull
    assert check(hull, max_vertices=4).volume < 4.6 * hull.volume


def test_redundant_corners_go_without_a_limit() -> None:
    # Corners pushed out of a cube's sides by less than the tolerance, and near-duplicates of its corners.
    rng = np.random.default_rng(0)
    sides = rng.uniform(-0.9, 0.9, (60, 3))
    sides[np.arange(60), rng.integers(3, size=60)] = 1 + 1e-8 * rng.uniform(size=60)
    twins = CUBE[rng.integers(8, size=40)] * (1 - 1e-8 * rng.uniform(size=(40, 3)))
    hull = Hull.of(np.vstack([CUBE, sides, twins]))
    assert len(hull.vertices) > 30
    limited = check(hull)
    assert len(limited.vertices) <= 10
    surface = _native.Surface(hull.vertices, hull.faces)
    assert surface.distance(limited.vertices).max() <= 1e-6 + 1e-9


def test_redundant_corners_stay_if_the_threshold_needs_them() -> None:
    cube = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T
    chamfer = np.ones(3) - 4e-7 * np.eye(3)
    hull = Hull.of(np.concatenate([cube[:-1], chamfer]))
    part = Component((hull.vertices, hull.faces))
    simple = limited_part(part, NO_LIMITS)
    assert len(simple.hull.vertices) == 8 < len(hull.vertices)
    tight = Concavity(1e-7)  # the corner lies 4e-7 / sqrt(3) outside
    assert tight.is_met(part)
    assert not tight.is_met(simple)
    assert limit_part(part, NO_LIMITS, tight) is part
    assert limit_part(part, HullLimits(8), tight).hull.volume == pytest.approx(simple.hull.volume, rel=1e-6)
    assert limit_part(part, NO_LIMITS, Concavity(0.05)).hull.volume == simple.hull.volume


def cabinet() -> Manifold:
    rooms = [box((0.02, -0.1, 0.02 + 0.445 * i), (0.88, 0.43, 0.445 + 0.445 * i)) for i in range(4)]
    return box((0, 0, 0), (0.9, 0.45, 1.8)) - sum(rooms[1:], rooms[0])


def drawer() -> Manifold:
    inside = box((-0.195, -0.145, 0.005), (0.195, 0.145, 0.2))
    return box((-0.2, -0.15, 0), (0.2, 0.15, 0.12)) - inside + box((-0.22, -0.17, -0.01), (0.22, -0.15, 0.14))


def mug() -> Manifold:
    handle = Manifold.cylinder(0.9, 2.6, 2.6, 24, True) - Manifold.cylinder(1, 1.8, 1.8, 24, True)
    outside = Manifold.cylinder(9, 4, 4, 24) + handle.rotate((90, 0, 0)).translate((4, 0, 4.5))
    return outside - Manifold.cylinder(10, 3.7, 3.7, 24).translate((0, 0, 0.4))


ACCURACY = 0.001
"""Of concavities above the threshold: a fiftieth of it."""

CRITERIA: list[tuple[str, dict[str, Any]]] = [
    ("concavity", {}),
    ("concavity", {"quality": "fast", "max_vertices": 24}),
    ("volume", {"criterion": "volume", "volume_tolerance": 0.05, "quality": "fast"}),
    ("navigable", {"criterion": rlacd.NavigableSpace(0.1, 0.04), "quality": "fast"}),
]


def error(result: rlacd.Decomposition, criterion: str) -> float:
    entry = getattr(result.report, criterion)
    return float(entry.intrusion.max if criterion == "navigable" else entry.max)


CASES = [pytest.param(drawer, 8, marks=pytest.mark.slow)]
CASES += [pytest.param(shape, 39, marks=pytest.mark.nightly) for shape in (cabinet, drawer, mug)]


@pytest.mark.parametrize(("shape", "most"), CASES)
@pytest.mark.parametrize(("criterion", "options"), CRITERIA)
@pytest.mark.promise("max-hulls")
def test_a_limit_is_kept_and_a_larger_one_never_fits_worse(
    shape: Callable[[], Manifold], most: int, criterion: str, options: dict[str, Any]
) -> None:
    mesh = trimesh_of(shape())
    free = rlacd.decompose(mesh, **options)
    last = np.inf
    for limit in range(1, most + 1):
        result = rlacd.decompose(mesh, max_hulls=limit, **options)
        assert len(result) <= limit
        assert result.report.hausdorff.missed < 0.005
        if limit >= len(free):
            assert_same_hulls(result, free)
            assert result.report.warnings == free.report.warnings
            break
        worst = error(result, criterion)
        assert worst <= last + (ACCURACY if criterion == "concavity" else 1e-9)
        assert worst > error(free, criterion)
        if criterion != "concavity" or worst > result.report.concavity.threshold:
            assert result.report.warnings, "it says by how much"
        last = worst


@pytest.mark.promise("max-hulls")
def test_parts_are_chosen_by_the_limited_hulls_they_end_with() -> None:
    """Some cannot stay within the sides on which the solid rests."""
    mesh, last = trimesh_of(cabinet()), np.inf
    for most in (4, 5, 6):
        worst = error(rlacd.decompose(mesh, quality="fast", max_hulls=most, max_vertices=8), "concavity")
        assert worst <= last + ACCURACY
        last = worst


@given(st.lists(st.integers(1, 60), min_size=1), st.integers(1, 40), st.integers(0, 20))
def test_a_larger_number_leaves_no_decomposition_out_that_a_smaller_one_unites(
    counts: list[int], few: int, more: int
) -> None:
    decompositions = [range(count) for count in counts]
    of_few, of_more = (list(few_enough(decompositions, most)) for most in (few, few + more))
    assert all(any(one is other for other in of_more) for one in of_few)
    assert of_few[-1] is decompositions[-1]
    assert [parts for parts in decompositions if len(parts) <= few] == [parts for parts in of_few if len(parts) <= few]


def test_parts_are_united_one_by_one_until_one_is_left_or_the_work_is_spent() -> None:
    boxes = [Component(Manifold.cube((1, 1, 1)).translate((3 * i, 0, 0))) for i in range(5)]

    def united(work: float) -> list[tuple[int, float, float]]:
        states = united_in_turn(boxes, Concavity(0.05), Work(work), Run(1))
        return [(len(parts), sum(part.volume for part in parts), worst) for parts, worst in states]

    every = united(1e9)
    assert [count for count, _, _ in every] == [5, 4, 3, 2, 1]
    assert [volume for _, volume, _ in every] == pytest.approx([5] * 5)
    assert every[0][2] < 0.05 < every[1][2] < every[-1][2]
    assert [count for count, _, _ in united(0)] == [5]


def test_coarser_thresholds_are_tried_where_the_finest_has_used_up_its_account(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rlacd.find_parts.MOST_CUTTING", 3e4)
    result = rlacd.decompose(trimesh_of(mug()), max_hulls=4, quality="fast")
    assert error(result, "concavity") < 0.6, "one hull is at 0.69"
