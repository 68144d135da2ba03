import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import rlacd
from fuzz.geometry import Polytope
from rlacd.finish.finish import in_input
from rlacd.options.presets import HullLimits
from rlacd.solid.frame import Frame
from rlacd.solid.hull import Hull

finite = st.floats(-1e3, 1e3, allow_nan=False, width=64)


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 30), st.just(3)), elements=finite), st.sampled_from([1e-9, 1, 1e9])
)
def test_frame_is_centred_and_two_long_and_reversible(points, unit):
    points = points * unit
    frame = Frame.of(points)
    inside = frame.to_frame(points)
    size = np.ptp(points, axis=0).max()
    if size > 1e-9 * unit:
        np.testing.assert_allclose(np.ptp(inside, axis=0).max(), 2, rtol=1e-9)
        np.testing.assert_allclose(inside.min(axis=0) + inside.max(axis=0), 0, atol=1e-4)
    np.testing.assert_allclose(frame.to_input(inside), points, rtol=1e-12, atol=1e-12 * max(size, np.abs(points).max()))


def test_single_point_keeps_the_unit():
    frame = Frame.of([[3.0, 4.0, 5.0]])
    assert frame.scale == 1
    np.testing.assert_array_equal(frame.to_frame([[3.0, 4.0, 5.0]]), [[0, 0, 0]])


@pytest.mark.parametrize("size", [1e-300, 1e300, 1.7e308])
def test_extreme_sizes_stay_finite(size):
    frame = Frame.of(np.array([[-size, 0, 0], [size, 0, 0]]))
    assert np.isfinite(frame.to_frame(np.array([[size, 0, 0]]))).all()


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_hull_thinner_than_the_coordinates_resolve_keeps_its_outline(turn):
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1e-9)], dtype=float)
    hull = Hull.of(np.roll(corners, turn, axis=1))
    frame = Frame(center=np.full(3, 1e9), scale=1.0)
    there = in_input(hull, frame)
    outline = there.vertices - 1e9
    assert there.is_watertight
    assert 0 < trimesh.Trimesh(outline, there.faces).volume < 1e-6
    assert outline.min() >= -1e-6
    assert outline.sum(axis=1).max() <= 1 + 1e-6
    few = in_input(hull, frame, HullLimits(max_vertices=4))
    assert len(few.vertices) == 4


@pytest.mark.parametrize("limits", [{"max_vertices": 4}, {"max_faces": 4}, {"max_vertices": 5}, {"max_faces": 8}])
def test_a_flat_hull_within_limits_stays_near_its_outline(limits):
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0.2, 0.9, 0), (0, 0, 1e-9)], dtype=float)
    there = in_input(Hull.of(corners), Frame(center=np.full(3, 1e9), scale=1.0), HullLimits(**limits))
    assert len(there.vertices) <= limits.get("max_vertices", 9)
    assert len(there.faces) <= limits.get("max_faces", 99)
    assert np.ptp(there.vertices, axis=0).max() <= 4 + 1e-5
    assert Polytope(there.vertices - 1e9, there.faces).height(corners).max() <= 1e-6


def test_what_is_delivered_is_what_is_measured():
    """Far from the origin, rounding moves corners: the report's distances are those of the hulls in the result."""
    vertices = np.array([[2133474.422051975, -1227970.982897935, -2822809.689823566]] * 3)
    vertices[1:] += [[-2.8e-10, -1.04e-9, -9.1e-10], [-2.1e-10, -4.7e-11, -9.8e-10]]
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2]], process=False)
    result = rlacd.decompose(mesh, max_vertices=4)
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    scale = 2 / (upper - lower).max()
    beyond = max((hull.vertices - upper).max() for hull in result) * scale
    assert result.report["hausdorff"]["over"] >= beyond - 1e-5
