"""The criterion `volume`: no hull adds more than a share of volume, measured here by booleans of another library."""

from __future__ import annotations

import manifold3d
import pytest
import trimesh

import rlacd
from rlacd.compat.vhacd import compute_vhacd
from rlacd.errors import OptionError
from tests.hulls import assert_convex_hull
from tests.models import table
from tests.shapes import to_manifold, trimesh_of


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
    measured = result.report["volume"]
    assert len(measured["per_part"]) == len(result)
    assert measured["max"] == max(measured["per_part"]) <= tolerance
    assert result.report["hausdorff"]["under"] < 0.005
    assert result.report["warnings"] == []


def test_a_tighter_share_takes_more_hulls_and_is_a_share_of_what_was_said() -> None:
    counts = [len(rlacd.decompose(torus(), criterion="volume", volume_tolerance=share)) for share in (0.5, 0.1, 0.02)]
    assert counts[0] < counts[1] < counts[2]
    of_whole = rlacd.decompose(torus(), criterion="volume", volume_tolerance=0.02, volume_of="whole")
    assert len(of_whole) < counts[2]
    added = [share * torus().volume for share in of_whole.report["volume"]["per_part"]]
    assert max(added) <= 0.02 * torus().volume
    assert of_whole.report["volume"]["relative_to"] == "whole"


def test_a_limit_on_hulls_may_exceed_the_share_and_says_by_how_much() -> None:
    result = rlacd.decompose(torus(), criterion="volume", max_hulls=6, threads=1)
    assert len(result) <= 6
    assert result.report["volume"]["max"] > 0.01
    assert any("add more than 1 % of volume" in warning for warning in result.report["warnings"])


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
    assert result.report["volume"]["max"] <= 0.05
    assert result.report["primitives"]["box"] >= 5
    assert result.report["primitives"]["cylinder"] == 1
    for hull, primitive in zip(hulls, result.primitives, strict=True):
        if primitive is not None:
            assert primitive.volume <= 1.05 * hull.volume + 1e-9
            assert primitive.beyond(hull.vertices) <= 1e-9


def test_v_hacds_own_word_for_it_counts() -> None:
    mesh = torus()
    coarse, fine = (
        compute_vhacd(mesh.vertices, mesh.faces, minimumVolumePercentErrorAllowed=percent) for percent in (50.0, 10.0)
    )
    assert len(coarse) < len(fine) <= 64
