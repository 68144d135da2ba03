"""The criterion `distance`: surfaces of parts and hulls lie at most the threshold apart, and volumes do not count."""

from __future__ import annotations

import math
from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

import rlacd
from rlacd import _native
from rlacd.cli.main import app
from rlacd.criteria.concavity import Concavity, Distance
from tests.shapes import box, dense, from_manifold, trimesh_of

RADIUS = 1 / 3  # of the hole, where the block's longest side is 2


def bored() -> trimesh.Trimesh:
    """A block of 60 x 60 x 30 with a round hole of 20 through it."""
    hole = manifold3d.Manifold.cylinder(40, 10, 10, 128).translate((0, 0, -20))
    return trimesh_of(box((-30, -30, -15), (30, 30, 15)) - hole)


def comb() -> trimesh.Trimesh:
    return trimesh_of(
        box((-1, -1, -1), (1, 1, 1)) - box((-0.5, -2, -0.5), (0.6, 2, 2)) - box((-2, -0.3, 0.2), (2, 0.4, 2))
    )


@pytest.mark.parametrize(
    "tolerance", [1.5, 0.6, 0.3, pytest.param(0.15, marks=pytest.mark.slow), pytest.param(0.1, marks=pytest.mark.slow)]
)
def test_a_round_hole_takes_few_more_hulls_than_its_tolerance_takes_chords(tolerance: float) -> None:
    chords = math.ceil(math.pi / math.acos(1 - tolerance / 10))
    result = rlacd.decompose(bored(), threshold_abs=tolerance, quality="fast", threads=1)
    assert chords / 1.15 <= len(result) <= 1.4 * chords  # a polygon of 128 sides allows slightly longer chords
    assert result.report["warnings"] == []


def test_no_hull_is_farther_from_its_part_than_the_threshold() -> None:
    mesh = comb()
    result = rlacd.decompose(mesh, criterion="distance", threshold=0.05, quality="fast", threads=1)
    per_part = result.report["distance"]["per_part"]
    assert len(per_part) == len(result)
    assert max(per_part) == result.report["distance"]["max"] <= 0.05
    for hull in result:  # what of it lies outside the solid lies near the solid's surface
        points = hull.sample(2000, seed=0)
        outside = points[~mesh.contains(points)]
        assert trimesh.proximity.closest_point(mesh, outside)[1].max(initial=0.0) <= 0.05 + 1e-9


def test_volumes_do_not_count() -> None:
    """Shallow grooves over half a side of a block: much volume, and nothing far from the hull."""
    block = box((-1, -1, -1), (1, 1, 1))
    for x in np.arange(-0.9, 1.0, 0.2):
        block -= box((x, -2, 0.96), (x + 0.1, 2, 2))
    part = from_manifold(block)
    assert Distance(0.05).is_met(part)
    assert not Concavity(0.05).is_met(part)
    measured = Distance().measure(part, 1e-4)
    samples = _native.Surface(part.vertices, part.faces).distance(dense(part.hull)).max()
    assert samples - 1e-9 <= measured.value[1]
    assert measured.value[0] <= 0.04 + 1e-9 <= measured.value[1] + 2e-4
    assert measured.volume_radius == 0


def test_a_length_is_a_distance_unless_the_criterion_is_named(tmp_path: Path) -> None:
    path = tmp_path / "comb.glb"
    comb().export(path)

    def said(*words: str) -> str:
        return " ".join(CliRunner().invoke(app, ["decompose", str(path), "--quality", "fast", *words]).output.split())

    for given in ({"threshold_abs": 0.1}, {"threshold_abs": 0.1, "criterion": "concavity"}, {"threshold": 0.1}):
        report = rlacd.decompose(path, quality="fast", threads=1, **given).report  # type: ignore[arg-type]
        assert report["options"]["criterion"] == ("distance" if given == {"threshold_abs": 0.1} else "concavity")
        assert ("distance" in report) != ("concavity" in report)
    assert "max distance" in said("--threshold", "100mm")
    assert "max distance" in said("--threshold-abs", "0.1")
    assert "max distance" in said("--threshold", "0.1", "--criterion", "distance")
    assert "max concavity" in said("--threshold", "100mm", "--criterion", "concavity")
    assert "max concavity" in said("--threshold", "5%")
    comb().export(path := tmp_path / "comb.stl")
    assert "its unit" in said("--threshold", "0.1mm")
    assert "(threshold 0.1); hulls" in said("--threshold", "0.1mm", "--unit", "mm")


@pytest.mark.parametrize("criterion", ["concavity", "distance", "volume"])
def test_the_parts_of_all_nodes_are_measured_in_the_frame_of_the_scene(criterion: str) -> None:
    scene = trimesh.Scene({"large": comb(), "small": comb().apply_scale(0.2).apply_translation((3, 0, 0))})
    result = rlacd.decompose(scene, criterion=criterion, per_node=True, quality="fast", threads=1)  # type: ignore[arg-type]
    measured = result.report[criterion]
    assert len(measured["per_part"]) == len(result) > 2
    assert measured["max"] == max(measured["per_part"]) <= (0.01 if criterion == "volume" else 0.05)
