"""What a user can rely on: the promises of a decomposition, on known shapes and on real meshes."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType

import rlacd
from rlacd import _native
from rlacd.decompose_mesh import Memory, decompose_quietly
from rlacd.policies import POLICIES
from tests.hulls import assert_convex_hull, assert_same_hulls, strict_json
from tests.shapes import dense, depth_in, from_manifold, table, to_manifold, trimesh_of


def cup() -> trimesh.Trimesh:
    outside = Manifold.cylinder(1, 0.5, 0.5, 48)
    return trimesh_of(outside - Manifold.cylinder(1, 0.45, 0.45, 48).translate((0, 0, 0.05)))


SHAPES = {"table": table, "cup": cup, "torus": lambda: trimesh.creation.torus(1, 0.3)}


def assert_keeps_promises(result: rlacd.Decomposition, threshold: float) -> None:
    report = result.report
    assert report.complete
    assert len(result) == report.hulls == len(result.hulls) == len(report.concavity.per_part)
    assert report.triangles == sum(len(hull.faces) for hull in result)
    for hull in result:
        assert_convex_hull(hull)
    assert report.concavity.max == max(report.concavity.per_part) <= threshold
    assert report.hausdorff.missed < 0.005
    assert report.hausdorff.added < threshold + 0.005
    strict_json(result.report)


@pytest.mark.parametrize("threshold", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.promise("convex", "threshold")
def test_promises_hold_on_known_shapes(shape: str, threshold: float) -> None:
    result = rlacd.decompose(SHAPES[shape](), threshold=threshold)
    assert_keeps_promises(result, threshold)


@pytest.mark.slow
@pytest.mark.promise("convex-input", "dense")
def test_dense_convex_input_is_one_hull_that_is_simple_only_as_the_threshold_allows() -> None:
    """What a simple hull adds all around counts for CoACD's concavity: here it alone would exceed the threshold."""
    result = rlacd.decompose(trimesh.creation.icosphere(5), threshold=0.003, quality="fast")
    assert len(result) == 1
    assert result.report.concavity.max <= 0.003
    assert not result.report.warnings


@pytest.mark.parametrize(
    ("solid", "count"),
    [
        (lambda: Manifold.batch_boolean([Manifold.cube().translate((3 * i, 0, 0)) for i in range(4)], OpType.Add), 4),
        pytest.param(lambda: Manifold.sphere(1, 64) - Manifold.sphere(0.8, 64), 1, marks=pytest.mark.slow),
    ],
    ids=["far apart", "cavity"],
)
def test_bodies_apart_stay_apart_and_a_cavity_costs_nothing(solid: Callable[[], Manifold], count: int) -> None:
    assert len(rlacd.decompose(trimesh_of(solid()))) == count


@pytest.mark.promise("frame")
def test_input_frame_and_unit_are_kept() -> None:
    placed = table()
    placed.apply_scale(1000)
    placed.apply_translation([5e4, -3e3, 70])
    result, reference = rlacd.decompose(placed), rlacd.decompose(table())
    assert len(result) == len(reference)
    joint = np.concatenate([hull.vertices for hull in result])
    # A hull grows by up to 1e-8 where corners 2e-9 apart, left by reunited parts, become one.
    slack = 1e-8 * placed.extents.max()
    assert joint.min(axis=0) == pytest.approx(placed.bounds[0], abs=slack)
    assert joint.max(axis=0) == pytest.approx(placed.bounds[1], abs=slack)


@pytest.mark.parametrize("source", ["path", "trimesh", "scene", "arrays", "lists"])
def test_every_kind_of_input_gives_the_same(source: str, tmp_path) -> None:
    mesh = table()
    mesh.export(tmp_path / "table.obj", digits=17)
    given = {
        "path": tmp_path / "table.obj",
        "trimesh": mesh,
        "scene": trimesh.Scene([mesh]),
        "arrays": (mesh.vertices, mesh.faces),
        "lists": (mesh.vertices.tolist(), mesh.faces.tolist()),
    }[source]
    result, reference = rlacd.decompose(given), rlacd.decompose(mesh)
    assert len(result) == len(reference)
    for a, b in zip(result, reference, strict=True):
        assert a.vertices == pytest.approx(b.vertices)
    assert result.report.name == ("table" if source == "path" else "mesh")


FAST: list[dict[str, Any]] = [
    {"criterion": "volume", "volume_tolerance": 0.1},
    {"criterion": rlacd.NavigableSpace(0.1, 0.04)},
    {"primitives": True},
    {"overlap": 0.02},
    {"keep_open": 0.9},
    {"avoid": [trimesh.creation.cylinder(0.02, 10)]},
    {"max_hulls": 4, "max_vertices": 12},
    {"policy": "learned", "merge": False},
]


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, *({"quality": "fast", **options} for options in FAST)], ids=str)
@pytest.mark.promise("same-bytes")
def test_same_bytes_for_any_number_of_threads_and_any_run(options: dict[str, Any]) -> None:
    runs = [rlacd.decompose(SHAPES["cup"](), threads=threads, **options) for threads in (1, 1, 4)]
    assert_same_hulls(*runs)
    for other in runs[1:]:
        same = ("concavity", "volume", "navigable", "overlap", "passages", "repair", "warnings")
        assert all(other.report.as_dict().get(key) == runs[0].report.as_dict().get(key) for key in same)


@pytest.mark.slow
@pytest.mark.promise("limits")
def test_under_low_limits_parts_are_cut_on_while_hulls_are_left_and_a_warning_tells_where_none_are() -> None:
    given: dict[str, Any] = {"quality": "fast", "threads": 1, "threshold": 0.1}
    free, cut = (rlacd.decompose(cup(), max_vertices=limit, **given) for limit in (None, 8))
    few, none = (rlacd.decompose(cup(), max_vertices=8, max_hulls=len(free) + more, **given) for more in (1, 0))
    tiny = rlacd.decompose(cup(), max_vertices=5, **given)
    assert_keeps_promises(cut, 0.1)
    assert len(tiny) == len(none) == len(free) <= len(few) <= len(free) + 1 < len(cut) <= 2 * len(free)
    for result, most in ((cut, 8), (few, 8), (none, 8), (tiny, 5)):
        assert max(len(hull.vertices) for hull in result) <= most
        assert result.report.hausdorff.missed < 0.005
    assert not any("out by" in warning for warning in cut.report.warnings)
    for result in (few, none, tiny):
        assert result.report.concavity.max > 0.1
        assert any("out by up to" in warning for warning in result.report.warnings)


@pytest.mark.promise("clock")
def test_a_timeout_after_the_work_is_done_changes_nothing() -> None:
    stages: list[str] = []
    result = rlacd.decompose(cup(), progress=lambda p: stages.append(p.stage) or p.stage not in ("finish", "measure"))
    assert stages[-1] == "measure"
    assert result.report.complete


@pytest.mark.slow
@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_keeps_the_promises(policy: str) -> None:
    assert_keeps_promises(rlacd.decompose(cup(), policy=policy), 0.05)


def test_progress_names_the_stages_and_counts_parts() -> None:
    seen: list[rlacd.Progress] = []
    result = rlacd.decompose(cup(), progress=lambda p: seen.append(p))
    stages = ["load", "repair", "cut", "merge", "search", "finish", "measure"]
    assert list(dict.fromkeys(p.stage for p in seen)) == stages
    assert seen[-1].parts >= len(result)
    assert all(a.seconds <= b.seconds for a, b in itertools.pairwise(seen))


def test_merged_hulls_are_as_close_to_the_solid_as_asked_for() -> None:
    """The solid is clipped by another library, and points of both surfaces are held against each other."""
    mesh = SHAPES["torus"]()
    result = rlacd.decompose(mesh)
    scale = result.report.scale
    center = mesh.bounds.mean(axis=0)
    solid = to_manifold((mesh.vertices - center) * scale, mesh.faces)
    whole, total = from_manifold(solid), 0.0
    surface = _native.Surface(whole.vertices, whole.faces)
    for hull in result:
        points = (hull.vertices - center) * scale
        share = solid ^ to_manifold(points, hull.faces)
        inside, around = from_manifold(share), from_manifold(to_manifold(points, hull.faces))
        assert depth_in(around, dense(inside)).max() <= 0.05 + 1e-9
        on = dense(around)
        assert surface.distance(on)[surface.winding(on, 4.0) < 0.5].max(initial=0.0) <= 0.05 + 1e-9
        assert 0.3 * np.cbrt(3 * (around.volume - share.volume()) / (4 * np.pi)) <= 0.05 + 1e-9
        total += share.volume()
    assert total >= solid.volume() * (1 - 1e-9)


@pytest.mark.nightly
@pytest.mark.promise("threshold")
def test_real_meshes(corpus) -> None:
    for name in (corpus / "quick.txt").read_text().split():
        result = rlacd.decompose(corpus / name)
        report = result.report
        for hull in result:
            assert_convex_hull(hull)
        assert report.concavity.max <= 0.05, name
        assert report.hausdorff.added <= 0.055 or report.warnings, name
        assert report.hausdorff.missed <= 0.01, name


@pytest.mark.parametrize("shape", ["cup", "torus"])
def test_parts_found_once_are_finished_again_with_all_corners(shape: str) -> None:
    """As robots do where links touch: the same hulls as when all is found anew."""
    mesh, memory = SHAPES[shape](), Memory()
    simple = decompose_quietly(mesh, threshold=0.2, threads=1, quality="fast", memory=memory)
    full, anew = (
        decompose_quietly(mesh, threshold=0.2, threads=1, quality="fast", detail="full", memory=each)
        for each in (memory, None)
    )
    assert len(simple) == len(full) == len(anew) > 0
    assert sum(len(hull.vertices) for hull in full) > sum(len(hull.vertices) for hull in simple)
    for one, other in zip(full, anew, strict=True):
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()
    ours, theirs = ({**each.report.as_dict(), "seconds": None} for each in (full, anew))
    assert ours == theirs
