import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from rlacd.merge import in_input
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
    few = in_input(hull, frame, max_vertices=4)
    assert len(few.vertices) == 4
