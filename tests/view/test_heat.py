"""The error heat map: it agrees with the certified distance, and inner walls are no error."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.decomposition import Decomposition
from rlacd.viewer.heat import FINEST, INNER, HeatMesh, frame_of, heat_map
from tests.hulls import hull_of
from tests.shapes import elbow

MEASURED_WITHIN = 2e-3  # width of the interval that the report's distance comes from


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[lower, upper])


def hottest(heat: list[HeatMesh]) -> float:
    return max(float(part.distance.max()) for part in heat)


@pytest.mark.slow
@pytest.mark.parametrize("threshold", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("place", [(0.0, 1.0), (1e5, 1e-2), (-3.0, 1e4)])
def test_the_hottest_spot_is_as_far_as_the_report_says(threshold: float, place: tuple[float, float]) -> None:
    mesh = elbow()
    mesh.apply_scale(place[1])
    mesh.apply_translation([place[0], 0, -place[0]])
    result = rlacd.decompose(mesh, threshold=threshold)
    over = result.report.hausdorff.added
    # Distance is 1-Lipschitz: the farthest point of a triangle lies within an edge of a corner.
    assert over - FINEST - MEASURED_WITHIN <= hottest(heat_map(result)) <= over + MEASURED_WITHIN


def test_one_hull_of_an_elbow_is_hot_where_it_bridges_the_corner() -> None:
    mesh = elbow()
    result = rlacd.decompose(mesh, threshold=2.0, detail="full")
    (part,) = heat_map(result)
    frame = frame_of(result)
    # The bridge runs from the tip (2, ., 0.4) to (0.4, ., 2); its middle, (1.2, ., 1.2), is 0.8 away from either beam.
    middle = frame.to_frame([[1.2, 0.2, 1.2]])[0]
    nearest = np.linalg.norm(part.vertices - middle, axis=1).argmin()
    assert part.distance[nearest] == pytest.approx(0.8 * frame.scale, abs=2 * FINEST)
    ground = part.vertices[:, 2] < frame.to_frame([[0, 0, 1e-9]])[0, 2]
    assert part.distance[ground].max() == pytest.approx(0.0, abs=1e-9)


def test_a_perfect_fit_is_cold_and_inner_walls_are_marked() -> None:
    halves = [box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1))]
    result = Decomposition.of([hull_of(half.vertices) for half in halves], box((0, 0, 0), (2, 1, 1)))
    for part in heat_map(result):
        wall = np.isclose(part.vertices[:, 0], 0.0)
        assert wall.any()
        assert (part.distance[wall] == INNER).all()
        assert np.abs(part.distance[~wall]).max() < 1e-12
