"""Whatever primitives are thrown together, the promises hold.

The same examples every time; RLACD_FUZZ=500 tries that many new ones per test.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from trimesh import creation

import rlacd
from tests.hulls import assert_convex_hull
from tests.shapes import Floats

UNCOVERED = 5e-3
"""A vertex farther from every hull than this (frame units) has to be in the report."""

KINDS = ("box", "cylinder", "sphere", "needle", "plate", "wedge")
FAULTS = ("none", "flip some", "flip all", "drop some", "double some", "jitter", "degenerate")


def primitive(kind: str, size: tuple[int, int, int]) -> trimesh.Trimesh:
    """A closed solid whose box has the lower corner 0 and whole-numbered sides."""
    solid = {
        "box": lambda: creation.box(),
        "cylinder": lambda: creation.cylinder(0.5, 1, sections=9),
        "sphere": lambda: creation.icosphere(1),
        "needle": lambda: creation.cylinder(0.01, 1, sections=4),
        "plate": lambda: creation.box((1, 1, 0.004)),
        "wedge": lambda: creation.cylinder(0.5, 1, sections=3),
    }[kind]()
    solid.apply_translation(-solid.bounds[0])
    solid.apply_scale(np.array(size) * np.where(solid.extents < 0.05, 1, 1 / solid.extents))
    return solid


def damaged(mesh: trimesh.Trimesh, fault: str, share: float, seed: int) -> tuple[Floats, Any]:
    rng = np.random.default_rng(seed)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    some = rng.random(len(faces)) < share
    if fault == "flip some":
        faces[some] = faces[some, ::-1]
    elif fault == "flip all":
        faces = faces[:, ::-1]
    elif fault == "drop some":
        faces = faces[~some] if not some.all() else faces[:1]
    elif fault == "double some":
        faces = np.concatenate([faces, faces[some, ::-1], faces[some]])
    elif fault == "jitter":  # a soup of triangles whose corners nearly coincide
        vertices = vertices[faces].reshape(-1, 3) * (1 + 1e-12 * rng.standard_normal((3 * len(faces), 1)))
        faces = np.arange(len(vertices)).reshape(-1, 3)
    elif fault == "degenerate":
        faces = np.concatenate([faces, faces[some][:, [0, 0, 1]], faces[some][:, [0, 1, 0]]])
    return vertices, faces


@st.composite
def soups(draw: st.DrawFn) -> tuple[Floats, Any]:
    """One to four damaged primitives on a grid of whole numbers: many share faces, edges and corners, or overlap."""
    vertices, faces, count = [], [], 0
    for _ in range(draw(st.integers(1, 4))):
        side = st.integers(1, 4)
        solid = primitive(draw(st.sampled_from(KINDS)), (draw(side), draw(side), draw(side)))
        place = st.integers(0, 4)
        solid.apply_translation([draw(place), draw(place), draw(place)])
        fault = draw(st.sampled_from(FAULTS))
        v, f = damaged(solid, fault, draw(st.sampled_from([0.1, 0.5])), draw(st.integers(0, 9)))
        vertices.append(v)
        faces.append(f + count)
        count += len(v)
    points = np.concatenate(vertices)
    if draw(st.booleans()):
        points = points @ trimesh.transformations.euler_matrix(0.3, 0.7, draw(st.sampled_from([0.2, 1e-9])))[:3, :3].T
    scale = draw(st.sampled_from([1.0, 1e-9, 1e9, 0.3]))
    offset = draw(st.sampled_from([0.0, 0.0, 10.0, 1e6]))
    return points * scale + offset * scale, np.concatenate(faces)


def check_promises(mesh: tuple[Floats, Any], **options: Any) -> rlacd.Decomposition:
    result = rlacd.decompose(mesh, **options)
    report = result.report
    assert report["parts"] == len(result) >= 1
    json.dumps(report, allow_nan=False)
    for hull in result:
        assert_convex_hull(hull)
        assert hull.vertices.dtype == np.float64

    # Concavity: what was asked for, or a sentence that says it is not.
    threshold = report["options"]["threshold"]
    assert len(report["concavity"]["per_part"]) == len(result)
    if report["concavity"]["max"] > threshold:
        assert any("exceed the concavity" in sentence for sentence in report["warnings"])

    # Coverage: every corner of a face lies in a hull, or the report names what was given up.
    vertices, faces = np.asarray(mesh[0]), np.asarray(mesh[1])
    corners = vertices[np.unique(faces)]
    missed = distance_to_hulls(result.hulls, corners).max() * report["scale"]
    if missed > UNCOVERED:
        assert max(body["deviation"] for body in report["repair"]) > 0.9 * missed - UNCOVERED
        assert any("outside the hulls" in sentence or "from the hulls" in sentence for sentence in report["warnings"])

    # Nothing is invented: but for a slab's half thickness, a wrap's gap and a limit on corners, hulls stay in the box.
    if options.get("max_vertices") is not None:
        return result
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    beyond = max(max((lower - h.bounds[0]).max(), (h.bounds[1] - upper).max()) for h in result)
    assert beyond * report["scale"] < 0.03
    return result


def distance_to_hulls(hulls: list[trimesh.Trimesh], points: Floats) -> Floats:
    """Distances [N] to the nearest hull, bounded from above by how far a point lies over the facets' planes.

    In a hull's own unit, so that neither 1e-9 nor 1e9 matters; sliver facets have no say.
    """
    center, size = points.mean(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-300)
    best = np.full(len(points), np.inf)
    for hull in hulls:
        corners = (hull.vertices[hull.faces] - center) / size
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        usable = lengths > 1e-14
        normals = normals[usable] / lengths[usable, None]
        offsets = (((hull.vertices - center) / size) @ normals.T).max(axis=0)
        best = np.minimum(best, (((points - center) / size) @ normals.T - offsets).max(axis=1, initial=0))
    return best * size


def same(first: rlacd.Decomposition, second: rlacd.Decomposition, factor: float = 1.0) -> None:
    assert len(first) == len(second)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.vertices * factor, b.vertices)
        np.testing.assert_array_equal(a.faces, b.faces)


EXAMPLES = int(os.environ.get("RLACD_FUZZ", "0"))
CAREFUL = settings(
    max_examples=EXAMPLES or 25,
    derandomize=not EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


@pytest.mark.nightly
@CAREFUL
@given(soups(), st.sampled_from([0.05, 0.05, 0.2]))
@pytest.mark.promise("any-mesh", "covered")
def test_promises_hold_for_any_soup(mesh: tuple[Floats, Any], threshold: float) -> None:
    one = check_promises(mesh, threshold=threshold, threads=1, timeout=20)
    if one.report["complete"]:
        same(one, rlacd.decompose(mesh, threshold=threshold, threads=2))


@pytest.mark.nightly
@CAREFUL
@given(soups(), st.integers(-40, 40))
def test_scaling_by_a_power_of_two_scales_the_hulls(mesh: tuple[Floats, Any], exponent: int) -> None:
    factor = 2.0**exponent
    vertices, faces = mesh
    one = rlacd.decompose((vertices, faces), threshold=0.2, timeout=20)
    if one.report["complete"]:
        same(one, rlacd.decompose((vertices * factor, faces), threshold=0.2), factor)


@pytest.mark.nightly
@CAREFUL
@given(soups(), st.integers(1, 3), st.sampled_from([None, 4, 8, 32]))
def test_limits_are_kept(mesh: tuple[Floats, Any], max_hulls: int, max_vertices: int | None) -> None:
    result = check_promises(mesh, threshold=0.2, max_hulls=max_hulls, max_vertices=max_vertices, threads=1, timeout=20)
    if result.report["complete"]:
        assert len(result) <= max_hulls
    assert all(len(hull.vertices) <= (max_vertices or np.inf) for hull in result)
