"""The judges of the geometric fuzzer see what is wrong, and nothing where all is well."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh import creation

import rlacd
from fuzz.eye import farthest_from_triangles, outer_points
from fuzz.geometry import Polytope, distance_to_triangles, distance_to_union, why_not_convex
from fuzz.judges import Case, judge
from fuzz.kernels import try_seed
from fuzz.recipes import Shape
from tests.shapes import Closed, box, from_manifold
from tests.shapes_bad import arrays

pytestmark = pytest.mark.slow

ELL = from_manifold(box((0, 0, 0), (4, 1, 1)) + box((0, 0, 0), (1, 1, 4)))


def case(solid: Closed = ELL, **options: Any) -> Case:
    options = {"quality": "fast", **({} if "criterion" in options else {"threshold": 0.05}), **options}
    result = rlacd.decompose((solid.vertices, solid.faces), **options)
    report = result.report.as_dict()
    report["concavity"] = report["concavity"]["max"] if "concavity" in report else None
    hulls = [(np.array(hull.vertices), np.array(hull.faces)) for hull in result]
    return Case(Shape(solid.vertices, solid.faces, (), True), options, hulls, report)


def test_good_hulls_pass() -> None:
    assert judge(case()) == []
    assert judge(case(**SPACE)) == []


SPACE = {"criterion": rlacd.NavigableSpace(0.05, 0.02)}


@pytest.mark.parametrize(
    ("seen", "count", "options", "said"),
    [
        ("out of the hulls", 1, None, {}),
        ("beyond the input", None, None, {}),
        ("concave", None, None, {}),
        ("more than 0.05, and no word of it", None, {"threshold": 0.05}, {}),
        ("into a ball", None, SPACE, {"concavity": None}),
        ("the volume is", None, None, {"mass": {"volume_abs": 8.0, "inertia_abs": np.eye(3).tolist()}}),
    ],
)
def test_what_was_promised_and_is_not_so_is_seen(
    seen: str, count: int | None, options: dict[str, Any] | None, said: dict[str, Any]
) -> None:
    """The first of two hulls alone, or one hull of all under the options of a decomposition into more."""
    good, whole = case(), case(threshold=1.5)
    assert (len(good.hulls), len(whole.hulls), judge(whole)) == (2, 1, [])
    report = {**(whole if options else good).report, "parts": 1, **said}
    wrong = replace(good, hulls=(good if count else whole).hulls[:1], options=options or good.options, report=report)
    assert any(seen in word for word in judge(wrong))


def test_a_mass_with_its_cavity_and_a_corner_without_a_word_are_seen() -> None:
    inner = creation.box((0.5, 0.5, 0.5))
    hollow = trimesh.util.concatenate([creation.box(), trimesh.Trimesh(inner.vertices, inner.faces[:, ::-1])])
    shape = Shape(np.array(hollow.vertices), np.array(hollow.faces), (), True)
    good = case(Closed(shape.vertices, shape.faces))
    assert judge(good) == []
    solid = replace(good, report={**good.report, "mass": case(Closed(*arrays(creation.box()))).report["mass"]})
    assert any("the volume is 8, not 7" in word for word in judge(solid))
    point = replace(shape, vertices=np.concatenate([shape.vertices, [[3, 0, 0]]]))
    point = replace(point, faces=np.concatenate([shape.faces, [[16, 16, 16]]]))
    assert any("a corner of a face lies" in word for word in judge(replace(good, shape=point)))


@pytest.mark.parametrize("limit", [{"max_vertices": 7}, {"max_faces": 11}, {"max_hulls": 1}])
def test_a_broken_limit_is_seen(limit: dict[str, int]) -> None:
    good = case()
    assert judge(replace(good, options={**good.options, **limit}))


def test_what_is_wrong_with_a_hull_is_reported() -> None:
    vertices, faces = arrays(creation.box())
    assert why_not_convex(vertices, faces) is None
    assert why_not_convex(vertices, faces[:, ::-1]) == "a vertex lies above a face"
    assert why_not_convex(vertices, faces[1:]) == "an edge has no twin"
    assert why_not_convex(vertices * [1, 1, 0], faces) is not None
    dented = vertices.copy()
    dented[0] *= 1 - 1e-15
    assert why_not_convex(dented, faces) is not None
    ball = creation.icosphere(3)
    assert why_not_convex(np.array(ball.vertices), np.array(ball.faces)) is None
    pushed = np.array(ball.vertices)
    pushed[0] *= 0.9
    assert why_not_convex(pushed, np.array(ball.faces)) is not None


def test_distances_are_those_of_the_brute_force_reference() -> None:
    random = np.random.default_rng(3)
    points = 2 * random.normal(size=(200, 3))
    _, expected, _ = trimesh.proximity.closest_point(trimesh.Trimesh(ELL.vertices, ELL.faces), points)
    np.testing.assert_allclose(distance_to_triangles(points, ELL.vertices[ELL.faces]), expected, atol=1e-12)
    beyond = [np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1) for low, high in CUBES]
    hulls = [cube(bounds) for bounds in CUBES]
    np.testing.assert_allclose(distance_to_union(points, hulls), np.minimum(*beyond), atol=1e-12)


CUBES = np.array([[(0, 0, 0), (1, 1, 1)], [(1, 0, 0), (3, 1, 1)]], dtype=float)


def cube(bounds: Any) -> Polytope:
    return Polytope(*arrays(creation.box(bounds=bounds)))


def test_the_farthest_point_is_that_of_trying_all() -> None:
    random = np.random.default_rng(5)
    for size in (0.01, 0.3, 2.0):
        corners = random.uniform(-1, 1, (300, 1, 3)) + size * random.normal(size=(300, 3, 3))
        points = 2 * random.normal(size=(1000, 3))
        distance = distance_to_triangles(points, corners)
        found = farthest_from_triangles(points, corners, random)
        assert found.distance == pytest.approx(distance.max(), abs=1e-12)
        np.testing.assert_array_equal(found.point, points[distance.argmax()])
    assert farthest_from_triangles(np.zeros((0, 3)), corners, random).distance == 0


@pytest.mark.parametrize("step", [0, 1e-7, -1e-7])
def test_a_seam_between_hulls_is_not_outer(step: float) -> None:
    hulls = [cube(CUBES[0]), cube(CUBES[1] + [step, 0, 0])]
    points = outer_points(hulls, 20_000, np.random.default_rng(1))
    on_seam = (np.abs(points[:, 0] - 1) < 1e-5) & (np.abs(points[:, 1:] - 0.5) < 0.49).all(axis=1)
    assert len(points) > 10_000
    assert not on_seam.any()
    apart = [hulls[0], cube(CUBES[1] + [step + 1e-3, 0, 0])]
    points = outer_points(apart, 20_000, np.random.default_rng(1))
    assert ((points[:, 0] == 1) & (np.abs(points[:, 1:] - 0.5) < 0.49).all(axis=1)).sum() > 100


@pytest.mark.parametrize("seed", [*range(40), 1047])
def test_kernels_agree_with_brute_force_on_any_soup(seed: int) -> None:
    try_seed(seed)
