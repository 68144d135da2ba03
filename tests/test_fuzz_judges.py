"""The judges of the geometric fuzzer see what is wrong, and nothing where all is well."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh import creation

import rlacd
from fuzz.geometry import why_not_convex
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


SPACE = {"criterion": rlacd.NavigableSpace(0.1, 0.04)}


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
    report = {**(whole if options else good).report, "hulls": 1, **said}
    wrong = replace(good, hulls=(good if count else whole).hulls[:1], options=options or good.options, report=report)
    assert any(seen in word for word in judge(wrong))


def test_no_warning_excuses_what_lies_outside_where_repair_dropped_nothing() -> None:
    good = case()
    told = {**good.report, "hulls": 1, "warnings": ["Some of the surface lies outside the hulls: repair dropped it."]}
    wrong = replace(good, hulls=good.hulls[:1], report=told)
    assert any("without a reason" in word for word in judge(wrong))
    rows = [{**body, "step": "capped"} for body in told["repair"]]
    assert not any("without a reason" in word for word in judge(replace(wrong, report={**told, "repair": rows})))


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


@pytest.mark.parametrize("seed", [*range(40), 1047])
def test_kernels_agree_with_brute_force_on_any_soup(seed: int) -> None:
    try_seed(seed)
