"""What `benchmarks` says of hulls, against shapes with known answers and against an independent reference."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh
from benchmarks.metrics import COVERED, TOLERANCE, Metrics, is_valid, measure
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import rlacd
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.report import Hausdorff
from tests.shapes import box, dense, from_manifold, point_to_triangles

# The input of most tests: its longest side is 2 and it is centred, so that lengths are the frame's.
SLAB = ((-1.0, -0.5, -0.25), (1.0, 0.5, 0.25))


def hulls_of(*solids: Any) -> list[tuple[Any, Any]]:
    return [(mesh.vertices, mesh.faces) for mesh in map(from_manifold, solids)]


def measured(shape: Any, *solids: Any, promised: float | None = None) -> Metrics:
    mesh = from_manifold(shape)
    return measure(repair(load_mesh((mesh.vertices, mesh.faces))), hulls_of(*solids), promised)


def near(value: float, truth: float) -> bool:
    return truth - 1e-6 <= value <= truth + TOLERANCE + 1e-6


def test_overlap_is_what_lies_in_several_hulls() -> None:
    """Halves of a slab that overlap by a tenth of its length, and a third hull in one of them."""
    halves = box(SLAB[0], (0.1, 0.5, 0.25)), box((-0.1, -0.5, -0.25), SLAB[1])
    found = measured(box(*SLAB), *halves)
    assert (found.parts, found.uncovered, found.invalid, found.empty) == (2, 0, 0, 0)
    assert near(found.hausdorff, 0)
    assert near(found.concavity, 0)
    assert found.overlap == pytest.approx(0.1)
    assert found.volume == pytest.approx(1.1)
    inner = box((-0.9, -0.5, -0.25), (-0.7, 0.5, 0.25))
    assert measured(box(*SLAB), *halves, inner).overlap == pytest.approx(0.2)
    found = measured(box(*SLAB), box(*SLAB), box((1.5, 0, 0), (1.7, 0.1, 0.1)))
    assert (found.overlap, found.empty) == (0, 1), "a hull that holds nothing"


@pytest.mark.parametrize("by", [0.01, 0.1])
def test_a_fattened_hull(by: float) -> None:
    fat = tuple(x - by for x in SLAB[0]), tuple(x + by for x in SLAB[1])
    found = measured(box(*SLAB), box(*fat), promised=0.02)  # type: ignore[arg-type]
    assert near(found.over, by * 3**0.5)
    assert near(found.under, 0)
    assert found.volume == pytest.approx((2 + 2 * by) * (1 + 2 * by) * (0.5 + 2 * by))
    added = 3 * ((2 + 2 * by) * (1 + 2 * by) * (0.5 + 2 * by) - 1) / (4 * np.pi)
    assert near(found.concavity, max(by * 3**0.5, 0.3 * added ** (1 / 3)))
    assert found.exceeding == (found.concavity > 0.021)


def test_numbers_do_not_depend_on_the_unit_and_the_place() -> None:
    def at(scale: float, shift: float) -> Metrics:
        def there(solid: Any) -> Any:
            return solid.scale((scale, scale, scale)).translate((shift, shift, shift))

        return measured(there(box(*SLAB)), there(box(SLAB[0], (0.5, 0.5, 0.3))), promised=0.05)

    one, other = at(1, 0).as_plain(), at(1000, 10).as_plain()
    assert one == pytest.approx(other, abs=1e-3)


def test_invalid_hulls_are_counted() -> None:
    good = from_manifold(box(*SLAB))
    assert is_valid(good.vertices, good.faces)
    soup = good.vertices[good.faces].reshape(-1, 3)
    assert is_valid(soup, np.arange(len(soup)).reshape(-1, 3)), "triangles with corners of their own"
    assert not is_valid(good.vertices, good.faces[:, ::-1]), "inside out"
    assert not is_valid(good.vertices, good.faces[1:]), "open"
    assert not is_valid(good.vertices, np.vstack([good.faces[:-1], good.faces[-1:, ::-1]])), "one face turned"
    dented = from_manifold(box(*SLAB) - box((0.2, 0.2, 0.1), (0.4, 0.4, 1.0)))
    assert not is_valid(dented.vertices, dented.faces), "not convex"
    assert not is_valid(np.full_like(good.vertices, np.nan), good.faces)
    assert not is_valid(good.vertices, good.faces + 1), "corners that do not exist"
    flat = good.vertices * (1, 1, 0)
    assert not is_valid(flat, good.faces), "no volume"


boxes = st.tuples(*[st.floats(-1.2, 1.0)] * 3, *[st.floats(0.1, 1.0)] * 3)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.lists(boxes, min_size=1, max_size=4))
def test_distances_agree_with_a_boolean_union_and_samples(some: list[tuple[float, ...]]) -> None:
    """The surface of the union as the mesh boolean makes it, and brute force over dense samples of both."""
    shape = box((-1, -1, -1), (1, 0, 0.2)) + box((-1, -1, 0), (0, 0.5, 1))
    solids = [box(b[:3], tuple(x + s for x, s in zip(b[:3], b[3:], strict=True))) for b in some]  # type: ignore[arg-type]
    found = measured(shape, *solids)
    union = from_manifold(manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add))
    surface = from_manifold(shape)
    over = point_to_triangles(dense(union, 6000), surface.vertices, surface.faces).max()
    points = dense(surface, 6000)
    inside = np.any([((points >= b[:3]) & (points <= np.add(b[:3], b[3:]))).all(axis=1) for b in some], axis=0)
    away = np.where(inside, 0, point_to_triangles(points, union.vertices, union.faces))
    spacing = 0.1  # of the samples, about
    assert over - 2e-3 <= found.over <= over + spacing
    assert away.max() - 2e-3 <= found.under <= away.max() + spacing
    assert found.uncovered == pytest.approx((away > COVERED).mean(), abs=0.03)
    assert found.hausdorff == max(found.over, found.under)


def test_the_report_of_a_decomposition_says_the_same(corpus: Path) -> None:
    path = corpus / "test/vhacd/ob_chair_gothic.ply"
    result = rlacd.decompose(path, threads=1)
    found = measure(repair(load_mesh(path)), [(h.vertices, h.faces) for h in result], 0.05)
    assert found.parts == result.report.hulls
    assert found.faces == result.report.triangles
    assert found.over == pytest.approx(result.report.hausdorff.added, abs=3e-3)
    assert found.under == pytest.approx(result.report.hausdorff.missed, abs=3e-3)
    assert found.exceeding == found.invalid == found.empty == 0
    # What of the solid lies in a hull may be more than the part it was made for, so this is no less by definition.
    assert found.concavity <= result.report.concavity.max + 2 * TOLERANCE


@pytest.mark.promise("report-true")
@pytest.mark.parametrize("how", [{"threshold": 1.0}, {"threshold": 0.1}, {"threshold_abs": 0.1}])
def test_the_length_that_is_said_is_within_one_per_cent(how: dict[str, float]) -> None:
    """Against places of the hulls' outer surface, which climb to where it is farthest from the input."""
    ring = trimesh.creation.torus(1, 0.4, major_sections=48, minor_sections=20)
    result = rlacd.decompose(ring, **how, quality="fast", threads=1)
    planes = [ConvexHull(hull.vertices).equations for hull in result]
    corners = np.concatenate([hull.triangles for hull in result])
    whose = np.repeat(np.arange(len(result)), [len(hull.faces) for hull in result])
    rng, best = np.random.default_rng(0), [0.0]
    facets, weights = np.repeat(np.arange(len(corners)), 4), rng.dirichlet((1, 1, 1), 4 * len(corners))
    for step in 0.5 ** np.arange(9):
        points = (corners[facets] * weights[:, :, None]).sum(axis=1)
        heights = np.array([(points @ each[:, :3].T + each[:, 3]).max(axis=1) for each in planes])
        heights[whose[facets], np.arange(len(points))] = np.inf  # its own hull hides nothing
        away = np.where((heights > 1e-6).all(axis=0), point_to_triangles(points, ring.vertices, ring.faces), -1.0)
        farthest = np.argsort(away)[-8:]
        best.append(float(away[farthest[-1]]))
        facets, near = np.repeat(facets[farthest], 60), np.repeat(weights[farthest], 60, axis=0)
        weights = np.maximum(near + 0.2 * step * rng.normal(size=near.shape), 0) + 1e-12
        weights /= weights.sum(axis=1, keepdims=True)
    said = re.search(r"hulls reach ([\d.]+) units beyond the input and cover it", result.report.fit_words())
    assert said is not None
    length = float(said[1])
    assert max(best) <= 1.0002 * length <= 1.01 * max(best)


def test_of_the_shortest_lengths_only_a_bound_is_said() -> None:
    report = rlacd.decompose(trimesh.creation.icosphere(3), detail="full", threads=1).report
    assert re.search(r"concavity at most .*; hulls reach nowhere beyond the input and cover it", report.fit_words())
    words = dataclasses.replace(report, hausdorff=Hausdorff(5e-4, 0.0)).fit_words()
    assert re.search(r"; hulls reach at most 0.000\d+ units beyond the input and cover it", words)
