"""Hulls with limits: within them, convex, around the given hull, and not much larger."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.finish.finish import limit_part
from rlacd.options.presets import HullLimits
from rlacd.solid.component import Part
from rlacd.solid.hull import NO_LIMITS, NO_SIDES, Hull, limit_hull


def excess(outer: Hull, inner: Hull) -> float:
    """How far a corner of `inner` sticks out of `outer`, by planes pushed out to the outer's own corners."""
    a, b, c = (outer.vertices[outer.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0] / lengths[lengths > 0, None]
    return float(((inner.vertices @ normals.T).max(axis=0) - (outer.vertices @ normals.T).max(axis=0)).max())


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


def exactly_convex(hull: Hull) -> bool:
    """Whether every corner lies on or below the plane of every facet, in exact arithmetic."""
    return all(exactly_inside(point, hull) for point in hull.vertices)


def check(hull: Hull, max_vertices: int | None = None, max_faces: int | None = None) -> Hull:
    limited = limit_hull(hull, HullLimits(max_vertices, max_faces))
    assert len(limited.vertices) <= (max_vertices or len(hull.vertices))
    assert len(limited.faces) <= (max_faces or len(hull.faces))
    assert len(limited.faces) == 2 * len(limited.vertices) - 4
    assert excess(limited, hull) < 1e-12 * max(1.0, float(np.abs(limited.vertices).max()))
    assert limited.volume >= hull.volume * (1 - 1e-9)
    again = Hull.of(limited.vertices)
    assert len(again.vertices) == len(limited.vertices)
    assert limited.volume == pytest.approx(again.volume, rel=1e-12)
    return limited


points = hnp.arrays(np.float64, st.tuples(st.integers(5, 40), st.just(3)), elements=st.floats(-1, 1, width=32))


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(points, st.integers(4, 20))
@pytest.mark.promise("limits")
def test_any_hull_within_any_limit(cloud: np.ndarray, most: int) -> None:
    hull = Hull.of(cloud)
    assume(hull is not None and hull.volume >= 1e-9)
    for limited in (check(hull, max_vertices=most), check(hull, max_faces=most)):
        assert hull.volume < 1e-6 or exactly_convex(limited)


@pytest.mark.parametrize("thickness", [1e-10, 1e-12, 1e-14])
@pytest.mark.parametrize("plate", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_hardly_there_is_held(seed: int, plate: bool, thickness: float) -> None:
    random = np.random.default_rng(seed)
    hull = Hull.of(random.uniform(-1, 1, (40, 3)) * [1, 0.8 if plate else thickness, thickness])
    limited = limit_hull(hull, HullLimits(int(random.integers(4, 13))))
    assert len(limited.vertices) <= 12
    assert exactly_convex(limited)
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
# regular octagons around a circle 5.5 %, and the cube is what a chamfered cube should become.
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


def test_bad_hulls_are_refused() -> None:
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 1]], dtype=np.int32)
    with pytest.raises(ValueError, match="flat"):
        _native.simplify_hull(flat, faces, 4, 4, 1e-6, NO_SIDES)
    with pytest.raises(ValueError, match="not finite"):
        _native.simplify_hull(flat * np.nan, faces, 4, 4, 1e-6, NO_SIDES)
    with pytest.raises(ValueError, match="no vertices"):
        _native.simplify_hull(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32), 4, 4, 1e-6, NO_SIDES)


def test_redundant_corners_stay_if_the_threshold_needs_them() -> None:
    cube = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T
    chamfer = np.ones(3) - 4e-7 * np.eye(3)
    hull = Hull.of(np.concatenate([cube[:-1], chamfer]))
    part = Part(hull.vertices, hull.faces, hull.volume, hull)
    simple = limit_part(part, NO_LIMITS)
    assert len(simple.hull.vertices) == 8 < len(hull.vertices)
    tight = Concavity(1e-7)  # the corner lies 4e-7 / sqrt(3) outside
    assert tight.is_met(part)
    assert not tight.is_met(simple)
    assert limit_part(part, NO_LIMITS, tight) is part
    assert limit_part(part, HullLimits(8), tight).hull.volume == simple.hull.volume
    assert limit_part(part, NO_LIMITS, Concavity(0.05)).hull.volume == simple.hull.volume
