"""Meshes that hulls avoid: no hull enters them, whatever else changes hulls; where that cannot be, it is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from rlacd.errors import OptionError
from rlacd.report import Avoids

RING = trimesh.creation.torus(1.0, 0.25)
DENSE = trimesh.creation.torus(1.0, 0.25, major_sections=160, minor_sections=60)


def rod(radius: float) -> trimesh.Trimesh:
    """Stands in the ring, whose hole has a radius of 0.75."""
    return trimesh.creation.cylinder(radius, 2, sections=64)


def deepest(hulls: list[trimesh.Trimesh], obstacle: trimesh.Trimesh) -> float:
    """How deep points of a surface lie in hulls, by the planes of their facets."""
    points = np.concatenate([trimesh.sample.sample_surface(obstacle, 100_000, seed=0)[0], obstacle.vertices])
    offsets = [(hull.face_normals * hull.triangles[:, 0]).sum(axis=1) for hull in hulls]
    depths = [(d - points @ hull.face_normals.T).min(axis=1) for d, hull in zip(offsets, hulls, strict=True)]
    return float(np.max(depths))


@pytest.mark.parametrize(
    "options",
    [
        {"criterion": "concavity"},
        {"criterion": "distance"},
        {"criterion": "distance", "quality": "balanced"},
        {"criterion": "concavity", "primitives": True},
        {"criterion": "concavity", "overlap": 0.02},
        {"criterion": rlacd.NavigableSpace(radius_abs=0.3)},
        {"criterion": "volume", "volume_tolerance": 0.2},
    ],
    ids=lambda options: " ".join(map(str, options.values())),
)
@pytest.mark.promise("avoid")
def test_no_hull_enters_what_it_is_to_avoid(options: dict[str, Any]) -> None:
    given: dict[str, Any] = {"threshold": 0.1} if options["criterion"] in ("concavity", "distance") else {}
    given = {"quality": "fast", "threads": 1, **given, **options}
    free, clear = rlacd.decompose(RING, **given), rlacd.decompose(RING, avoid=[rod(0.7)], **given)
    assert deepest(free.hulls, rod(0.7)) > 0.005
    assert deepest(clear.hulls, rod(0.7)) <= 1e-6
    assert len(clear) <= 2.5 * len(free)
    assert clear.report.avoid == Avoids((), ())
    assert clear.report.warnings == ()


@pytest.mark.slow
@pytest.mark.promise("avoid")
def test_hulls_of_a_dense_mesh_avoid_what_its_simpler_copy_may_cross() -> None:
    noisy = DENSE.copy()
    noisy.vertices += np.random.default_rng(0).normal(scale=0.001, size=noisy.vertices.shape)
    near = rod(0.742)
    done = rlacd.decompose(noisy, threshold=0.1, avoid=[near], quality="fast", threads=1)
    assert deepest(done.hulls, near) <= 1e-6
    assert done.report.warnings == ()


def test_parts_far_from_what_they_avoid_stay_as_coarse_as_asked() -> None:
    """A rod beside the ring is in the way of a few parts only."""
    beside = trimesh.creation.cylinder(
        0.1, 2, sections=32, transform=trimesh.transformations.translation_matrix([0.62, 0, 0])
    )
    free = rlacd.decompose(RING, threshold=0.1, quality="fast", threads=1)
    clear = rlacd.decompose(RING, threshold=0.1, avoid=[beside], quality="fast", threads=1)
    assert deepest(clear.hulls, beside) <= 1e-6
    assert len(free) <= len(clear) <= len(free) + 3


@pytest.mark.promise("avoid")
def test_what_the_input_itself_crosses_is_said_and_the_rest_is_avoided() -> None:
    box = trimesh.creation.box((1, 1, 1))
    floor = trimesh.creation.box((100, 100, 0.2), transform=trimesh.transformations.translation_matrix([0, 0, -0.5]))
    done = rlacd.decompose(box, avoid=[floor], quality="fast")
    assert len(done) == 1
    assert done.report.warnings == ("The input itself crosses a mesh, so hulls are not kept out of it there.",)
    arch = trimesh.boolean.difference([trimesh.creation.box((2, 1, 2)), trimesh.creation.box((1.8, 2, 1.8))])
    # It stands through a floor under its foot; a beam in its opening is avoided all the same.
    beam = trimesh.creation.box((1.7, 3, 1.7))
    low = trimesh.creation.box((100, 100, 0.02), transform=trimesh.transformations.translation_matrix([0, 0, -0.95]))
    done = rlacd.decompose(arch, threshold=0.5, avoid=[low, beam], quality="fast")
    assert deepest(done.hulls, beam) <= 1e-6
    assert [warning.split(",")[0] for warning in done.report.warnings] == ["The input itself crosses a mesh"]


def test_what_hulls_may_touch_is_not_entered() -> None:
    """A box that stands on a floor of large triangles is one hull."""
    floor = trimesh.Trimesh([[-1e3, -1e3, -0.5], [1e3, -1e3, -0.5], [0, 1e3, -0.5]], [[0, 1, 2]])
    done = rlacd.decompose(trimesh.creation.box(), avoid=[floor], quality="fast")
    assert (len(done), done.report.warnings) == (1, ())


@pytest.mark.promise("avoid")
def test_limits_that_leave_no_way_are_said() -> None:
    done = rlacd.decompose(RING, threshold=0.1, max_hulls=4, avoid=[rod(0.7)], quality="fast", threads=1)
    depth = deepest(done.hulls, rod(0.7))
    (entered,) = done.report.avoid.entered
    assert entered.hulls == len(done) == 4
    assert entered.depth_abs == pytest.approx(depth, rel=0.01)
    assert any(f"4 hulls enter a mesh, up to {entered.depth_abs:.4g} units deep" in w for w in done.report.warnings)


def test_lengths_and_scale_are_those_of_the_input(tmp_path: Path) -> None:
    rod(0.7).export(tmp_path / "rod.obj")
    done = rlacd.decompose(
        RING, threshold=0.1, avoid=[str(tmp_path / "rod.obj")], scale=1000.0, quality="fast", threads=1
    )
    large = rod(0.7)
    large.apply_scale(1000)
    assert deepest(done.hulls, large) <= 1e-3
    assert done.report.options["avoid"] == ["rod.obj"]


@pytest.mark.parametrize("given", ["rod.obj", 3, [3], (np.zeros((3, 3)), np.array([[0, 1, 2]]))])
def test_what_is_no_list_of_meshes_is_refused(given: Any) -> None:
    with pytest.raises(OptionError, match="a list of meshes or of paths of meshes"):
        rlacd.decompose(RING, avoid=given)


@pytest.mark.promise("timeout")
def test_a_mesh_with_others_to_avoid_is_covered_when_time_is_over_before_the_work() -> None:
    other = trimesh.creation.icosphere(subdivisions=5).apply_translation((3, 0, 0))
    result = rlacd.decompose(trimesh.creation.torus(1.0, 0.3), avoid=[other], timeout=1e-6, threads=1)
    assert not result.report.complete
    assert len(result) == 1
