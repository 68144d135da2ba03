"""The criteria `distance` and `volume`: how far surfaces lie apart, how much volume a hull adds, by other libraries."""

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
from rlacd.compat.vhacd import compute_vhacd
from rlacd.criteria.concavity import Concavity, Distance
from rlacd.errors import OptionError
from rlacd.solid.component import Component
from tests.hulls import assert_convex_hull
from tests.models import table
from tests.shapes import box, dense, to_manifold, trimesh_of

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
    assert result.report.warnings == ()


def test_no_hull_is_farther_from_its_part_than_the_threshold() -> None:
    mesh = comb()
    result = rlacd.decompose(mesh, criterion="distance", threshold=0.05, quality="fast", threads=1)
    per_part = result.report.distance.per_part
    assert len(per_part) == len(result)
    assert max(per_part) == result.report.distance.max <= 0.05
    for hull in result:  # what of it lies outside the solid lies near the solid's surface
        points = hull.sample(2000, seed=0)
        outside = points[~mesh.contains(points)]
        assert trimesh.proximity.closest_point(mesh, outside)[1].max(initial=0.0) <= 0.05 + 1e-9


def test_volumes_do_not_count() -> None:
    """Shallow grooves over half a side of a block: much volume, and nothing far from the hull."""
    block = box((-1, -1, -1), (1, 1, 1))
    for x in np.arange(-0.9, 1.0, 0.2):
        block -= box((x, -2, 0.96), (x + 0.1, 2, 2))
    part = Component(block)
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
        assert report.options["criterion"] == ("distance" if given == {"threshold_abs": 0.1} else "concavity")
        assert (report.distance is None) != (report.concavity is None)
    assert "distance at most" in said("--threshold", "100mm")
    assert "distance at most" in said("--threshold-abs", "0.1")
    assert "distance at most" in said("--threshold", "0.1", "--criterion", "distance")
    assert "concavity at most" in said("--threshold", "100mm", "--criterion", "concavity")
    assert "concavity at most" in said("--threshold", "5%")
    comb().export(path := tmp_path / "comb.stl")
    assert "its unit" in said("--threshold", "0.1mm")
    assert "(threshold 0.1 mm); hulls" in said("--threshold", "0.1mm", "--unit", "mm")


@pytest.mark.parametrize("criterion", ["concavity", "distance", "volume"])
def test_the_parts_of_all_nodes_are_measured_in_the_frame_of_the_scene(criterion: str) -> None:
    scene = trimesh.Scene({"large": comb(), "small": comb().apply_scale(0.2).apply_translation((3, 0, 0))})
    result = rlacd.decompose(scene, criterion=criterion, per_node=True, quality="fast", threads=1)  # type: ignore[arg-type]
    measured = getattr(result.report, criterion)
    assert len(measured.per_part) == len(result) > 2
    assert measured.max == max(measured.per_part) <= (0.01 if criterion == "volume" else 0.05)


def cup() -> trimesh.Trimesh:
    solid = manifold3d.Manifold.cylinder(2, 1, 1, 24) - manifold3d.Manifold.cylinder(2, 0.9, 0.9, 24).translate(
        (0, 0, 0.1)
    )
    return trimesh_of(solid)


def torus() -> trimesh.Trimesh:
    return trimesh.creation.torus(1.0, 0.3, major_sections=32, minor_sections=16)


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("shape", [table, torus, cup])
@pytest.mark.promise("volume")
def test_no_hull_adds_more_than_the_share(shape: object, tolerance: float) -> None:
    mesh: trimesh.Trimesh = shape()  # type: ignore[operator]
    result = rlacd.decompose(mesh, criterion="volume", volume_tolerance=tolerance, threads=1)
    solid = to_manifold(mesh.vertices, mesh.faces)
    least = 1e-3 * mesh.convex_hull.volume
    for hull in result:
        assert_convex_hull(hull)
        inside = (to_manifold(hull.vertices, hull.faces) ^ solid).volume()
        assert hull.volume - inside <= tolerance * max(inside, least) * (1 + 1e-6) + 1e-9
    measured = result.report.volume
    assert len(measured.per_part) == len(result)
    assert measured.max == max(measured.per_part) <= tolerance
    assert result.report.hausdorff.missed < 0.005
    assert not [warning for warning in result.report.warnings if "volume" in warning]


def test_a_tighter_share_takes_more_hulls_and_is_a_share_of_what_was_said() -> None:
    counts = [len(rlacd.decompose(torus(), criterion="volume", volume_tolerance=share)) for share in (0.5, 0.1, 0.02)]
    assert counts[0] < counts[1] < counts[2]
    of_whole = rlacd.decompose(torus(), criterion="volume", volume_tolerance=0.02, volume_of="whole")
    assert len(of_whole) < counts[2]
    added = [share * torus().volume for share in of_whole.report.volume.per_part]
    assert max(added) <= 0.02 * torus().volume
    assert of_whole.report.volume.relative_to == "whole"


def test_a_limit_on_hulls_may_exceed_the_share_and_says_by_how_much() -> None:
    result = rlacd.decompose(torus(), criterion="volume", max_hulls=6, quality="best", threads=1)
    assert len(result) <= 6
    assert result.report.search is None
    assert any("Nothing was searched" in warning for warning in result.report.warnings)
    assert result.report.volume.max > 0.01
    assert any("add more than 1% of volume" in warning for warning in result.report.warnings)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"threshold": 0.02}, "threshold"),
        ({"volume_tolerance": 0}, "volume_tolerance"),
        ({"volume_of": "all"}, "volume_of"),
    ],
)
def test_options_that_do_not_go_with_it(options: dict[str, object], named: str) -> None:
    with pytest.raises(OptionError, match=named):
        rlacd.decompose(torus(), criterion="volume", **options)  # type: ignore[arg-type]


def test_primitives_add_no_more_volume_than_hulls_may() -> None:
    legs = [trimesh.creation.box((0.1, 0.1, 1.0)).apply_translation((x, y, 0.0)) for x in (0, 1) for y in (0, 1)]
    top = trimesh.creation.box((1.3, 1.3, 0.1)).apply_translation((0.5, 0.5, 0.5))
    pole = trimesh.creation.cylinder(0.1, 1.0, sections=24).apply_translation((0.5, 0.5, 1.0))
    mesh = trimesh.boolean.union([*legs, top, pole])
    hulls = rlacd.decompose(mesh, criterion="volume", volume_tolerance=0.05, threads=1)
    result = rlacd.decompose(mesh, criterion="volume", volume_tolerance=0.05, primitives=True, threads=1)
    assert result.report.volume.max <= 0.05
    assert result.report.primitives["box"] >= 5
    assert result.report.primitives["cylinder"] == 1
    for hull, primitive in zip(hulls, result.primitives, strict=True):
        if primitive is not None:
            assert primitive.volume <= 1.05 * hull.volume + 1e-9
            assert primitive.beyond(hull.vertices) <= 1e-9


def test_v_hacds_own_word_for_it_counts() -> None:
    mesh = torus()
    coarse, fine = (
        compute_vhacd(mesh.vertices, mesh.faces, minimumVolumePercentErrorAllowed=percent) for percent in (50.0, 5.0)
    )
    assert len(coarse) < len(fine) <= 64
