"""The convex hull kernel against Qhull and exact rational arithmetic."""

from __future__ import annotations

import os
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from fuzz.geometry import why_not_convex
from rlacd import _native
from rlacd.extras.finish.primitives import outline
from rlacd.solid.hull import Hull


def exact_height(a: np.ndarray, b: np.ndarray, c: np.ndarray, p: np.ndarray) -> Fraction:
    """Six times the signed volume of a, b, c, p, without rounding."""
    u, v, w = ([Fraction(float(x)) - Fraction(float(y)) for x, y in zip(q, a, strict=True)] for q in (b, c, p))
    return u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])


def assert_is_hull(points: np.ndarray, exact_points: int = 40) -> None:
    indices, faces, rank = _native.convex_hull(points)
    assert rank == 3
    corners = points[indices]
    assert len(np.unique(indices)) == len(indices)
    assert set(faces.ravel()) == set(range(len(indices)))
    assert why_not_convex(corners, faces, exactly=len(faces) < 1000) is None
    for f in faces[:exact_points]:
        for p in points[:exact_points]:
            assert exact_height(*corners[f], p) <= 0, "no point above any facet, exactly"


coordinate = st.floats(-1, 1, allow_subnormal=False, width=32).map(lambda x: 0.0 if abs(x) < 1e-6 else float(x))
clouds = hnp.arrays(np.float64, st.tuples(st.integers(4, 60), st.just(3)), elements=coordinate)
lattice = hnp.arrays(np.float64, st.tuples(st.integers(4, 60), st.just(3)), elements=st.integers(-2, 2).map(float))


@pytest.mark.slow
@pytest.mark.parametrize("strategy", ["clouds", "lattice"])
@pytest.mark.promise("convex")
def test_hull_is_exact_and_agrees_with_qhull(strategy: str) -> None:
    @settings(max_examples=400 if os.environ.get("RLACD_RANDOM") else 100, deadline=None)
    @given({"clouds": clouds, "lattice": lattice}[strategy])
    def check(points: np.ndarray) -> None:
        _, _, rank = _native.convex_hull(points)
        try:
            reference = ConvexHull(points)
        except QhullError:
            reject()  # flat within Qhull's tolerance
        if rank < 3:
            assert reference.volume < 1e-12
            return
        assert_is_hull(points, exact_points=12)
        hull = Hull.of(points)
        # Qhull merges facets that are flat within its tolerance, which costs thin hulls a relative error.
        flat = 1e-15 * reference.area
        assert hull.volume == pytest.approx(reference.volume, rel=1e-9, abs=10 * flat)
        assert _native.mesh_area(hull.vertices, hull.faces) == pytest.approx(reference.area, rel=1e-9, abs=1e-12)

    check()


RANDOM = np.random.default_rng(0).normal(size=(3000, 3))
GRID = np.array(list(product(range(6), repeat=3)), dtype=np.float64)


@pytest.mark.parametrize(
    ("points", "corners"),
    [
        *((RANDOM[:count] * scale, None) for count in (4, 10, 100, 3000) for scale in (1e-9, 1.0, 1e9)),
        (RANDOM / np.linalg.norm(RANDOM, axis=1)[:, None], len(RANDOM)),
        (np.concatenate([GRID, GRID]), 8),
    ],
)
def test_hulls_of_many_points(points: np.ndarray, corners: int | None) -> None:
    assert_is_hull(points)
    hull = Hull.of(points)
    assert len(hull.vertices) == corners or corners is None
    assert hull.volume == pytest.approx(ConvexHull(points).volume, rel=1e-9)


@pytest.mark.parametrize(
    ("points", "rank"),
    [
        (np.zeros((0, 3)), -1),
        (np.ones((7, 3)), 0),
        (np.outer(np.arange(5.0), [1, 2, 3]), 1),
        (np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1.0]]), 2),
        (np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, np.nextafter(3, 4)]]), 1 + 0),
    ],
    ids=["none", "one point", "a line", "a square", "almost a line"],
)
def test_rank_of_degenerate_points(points: np.ndarray, rank: int) -> None:
    indices, faces, found = _native.convex_hull(points)
    assert found == rank if rank != 1 else found in (1, 2)
    assert len(indices) == len(faces) == 0


def test_points_one_ulp_off_a_plane_are_seen() -> None:
    square = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1.0]])
    bump = np.array([[0.5, 0.5, np.nextafter(1, 2)]])
    _, _, rank = _native.convex_hull(np.concatenate([square, bump]))
    assert rank == 3


@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
def test_points_that_are_not_finite_are_refused(bad: float) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, bad]], dtype=float)
    with pytest.raises(ValueError, match="finite"):
        Hull.of(points)


def inradius(hull: Hull) -> float:
    """The radius of the largest ball in a hull, by another solver."""
    corners = hull.vertices[hull.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = np.einsum("ij,ij->i", normals, corners[:, 0])
    rows = np.column_stack([normals, np.ones(len(normals))])
    return float(linprog([0, 0, 0, -1], A_ub=rows, b_ub=offsets, bounds=[(None, None)] * 4).x[3])


@given(st.integers(0, 10**6), st.integers(4, 200), st.sampled_from([1e-6, 1.0, 1e6]))
@settings(max_examples=60, deadline=None)
def test_a_ball_fits_up_to_the_inradius(seed: int, count: int, scale: float) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3)) * random.uniform(0.05, 1, 3) + random.normal(size=3)
    hull = Hull.of(points)
    radius = inradius(hull)
    vertices = hull.vertices * scale
    assert _native.holds_ball(vertices, hull.faces, radius * scale * (1 - 1e-6))
    assert not _native.holds_ball(vertices, hull.faces, radius * scale * (1 + 1e-6))


@given(st.integers(0, 10**6), st.integers(3, 60), st.booleans())
@settings(max_examples=100, deadline=None)
def test_outlines_are_those_of_qhull(seed: int, count: int, on_a_grid: bool) -> None:
    random = np.random.default_rng(seed)
    points = random.integers(0, 6, (count, 2)).astype(float) if on_a_grid else random.normal(size=(count, 2))
    corners = outline(points)
    try:
        expected = ConvexHull(points)
    except QhullError:
        assert len(corners) < 3
        return
    assert set(map(tuple, corners)) == {tuple(points[i]) for i in expected.vertices}
    x, y = corners.T
    assert np.roll(y, -1) @ x - np.roll(x, -1) @ y == pytest.approx(2 * expected.volume)


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.zeros((1, 2)), np.ones((9, 2)), np.arange(12.0).reshape(6, 2)])
def test_what_lies_on_a_line_has_no_outline(points: np.ndarray) -> None:
    assert len(outline(points)) < 3
