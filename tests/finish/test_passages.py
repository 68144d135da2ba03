"""Passages: those that hulls narrow are told, and `keep_open` keeps them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import rlacd
from fuzz.geometry import Polytope, distance_to_union
from rlacd import _native
from rlacd.errors import OptionError
from rlacd.options import Options
from rlacd.solid.passages import passage_balls
from tests.shapes import Closed, Floats, box, from_manifold, point_to_triangles, trimesh_of


def bore(radius: float, x: float, y: float, sides: int = 64) -> Manifold:
    return Manifold.cylinder(4, radius, radius, sides, True).translate((x, y, 0))


def plate(*bores: Manifold) -> Manifold:
    """2 wide: its frame is its own."""
    solid = box((-1, -0.6, -0.1), (1, 0.6, 0.1))
    for one in bores:
        solid -= one
    return solid


def clearance(hulls: list[trimesh.Trimesh], points: Floats) -> Floats:
    """Distance of each point from the nearest hull, 0 inside, by all its triangles and planes."""
    return distance_to_union(points, [Polytope(np.array(hull.vertices), np.array(hull.faces)) for hull in hulls])


SECTIONS = {"round": 16, "square": 4, "slot": 8}


def perforated(
    kind: str, side: int, radius: float, thickness: float, turn: bool = False
) -> tuple[trimesh.Trimesh, Floats, float]:
    """A plate 2 wide with side x side equal holes; points on their axes [N, 5, 3], and the radius that is free."""
    places = (np.arange(side) + 0.5) * 2 / side - 1
    sections = SECTIONS[kind]
    hole = Manifold.cylinder(1, radius, radius, sections, True).rotate((0, 0, 180 / sections))
    if kind == "slot":
        hole = Manifold.batch_hull([hole.translate((x, 0, 0)) for x in (-radius, radius)])
    solid = box((-1, -1, -thickness / 2), (1, 1, thickness / 2))
    solid -= Manifold.compose([hole.translate((x, y, 0)) for x in places for y in places])
    mesh = trimesh_of(solid)
    axes = np.array([[(x, y, z * thickness) for z in np.linspace(-0.4, 0.4, 5)] for x in places for y in places])
    if turn:
        turned = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
        mesh.apply_transform(turned)
        axes = axes @ turned[:3, :3].T
    return mesh, axes, radius * float(np.cos(np.pi / sections))


PLATES = [
    ("round", 4, 0.01, False),
    ("round", 5, 0.4, False),
    ("square", 5, 0.01, True),
    ("square", 4, 0.4, True),
    ("slot", 4, 0.01, False),
    ("slot", 5, 0.1, True),
]


def axis(x: float, y: float) -> Floats:
    return np.column_stack([np.full(9, x), np.full(9, y), np.linspace(-0.09, 0.09, 9)])


HOLES = [(0.3, -0.5, 0.0), (0.12, 0.3, 0.3), (0.06, 0.7, -0.3)]
"""Radius and place."""


def found_in(solid: Manifold, least: float = 0.01) -> tuple[Closed, Floats, Floats]:
    closed = from_manifold(solid)
    surface = _native.Surface(closed.vertices, closed.faces)
    balls = passage_balls((closed.vertices, closed.faces), surface, (least, 1.0), 2000, 0.25, 1)
    return closed, balls.centres, balls.radii


def test_the_balls_of_a_passage_are_free_and_as_large_as_its_walls_allow() -> None:
    closed, centres, radii = found_in(plate(*(bore(*hole) for hole in HOLES)))
    assert point_to_triangles(centres, closed.vertices, closed.faces) == pytest.approx(radii, abs=1e-12)
    for radius, x, y in HOLES:
        own = np.hypot(centres[:, 0] - x, centres[:, 1] - y) < radius
        apothem = radius * np.cos(np.pi / 64)
        assert own.any()
        assert 0.98 * apothem <= radii[own].min() <= radii[own].max() <= apothem + 1e-9
        assert np.abs(centres[own, 2]).max() < 0.12
    assert sum(np.hypot(centres[:, 0] - x, centres[:, 1] - y) < r for r, x, y in HOLES).all(), "no other passages"


@pytest.mark.parametrize(
    "solid",
    [
        box((-1, -1, -1), (1, 1, 1)),
        Manifold.sphere(1, 64),
        box((-1, -1, -1), (1, 1, 0)) + box((-1, -1, -1), (0, 1, 1)),  # a step
        box((-1, -1, -0.5), (1, 1, 0.5)) - Manifold.sphere(2, 128).translate((0, 0, 2.2)),  # a shallow bowl
    ],
)
def test_what_walls_do_not_hold_between_them_is_no_passage(solid: Manifold) -> None:
    assert len(found_in(solid)[2]) == 0


@pytest.mark.promise("passages")
@pytest.mark.parametrize(("kind", "side", "thickness", "turn"), PLATES)
@pytest.mark.parametrize("radius", [0.03, 0.08])
def test_of_equal_holes_each_is_listed_once_and_only_wide_ones_are_warned_of(
    kind: str, side: int, thickness: float, turn: bool, radius: float
) -> None:
    mesh, axes, free = perforated(kind, side, radius, thickness, turn)
    result = rlacd.decompose(mesh, quality="fast", threads=1, max_hulls=1)  # all close
    report, size = result.report, result.report.scale
    away = [np.linalg.norm(np.array(p.at_abs) - axes, axis=-1).min(axis=1) for p in report.passages]
    assert sorted(int(one.argmin()) for one in away) == list(range(side * side))
    assert max(one.min() for one in away) <= max(1.05 * radius, 0.1 * thickness)
    for passage in report.passages:
        assert passage.radius_abs == pytest.approx(free, rel=0.02)
        assert passage.left_abs == 0
    told = [said for said in report.warnings if "passage" in said]
    if free * size < 0.05:
        assert told == []
    else:
        assert told[0].startswith(f"{side * side} passages narrow by over half, {side * side} to nothing: near (")


@pytest.mark.promise("passages")
def test_what_is_left_of_each_hole_is_measured() -> None:
    places = [(x, y) for x in (-0.75, -0.25, 0.25, 0.75) for y in (-0.3, 0.3)]
    scale = 50.0
    mesh = trimesh_of(plate(*(bore(0.1, x, y) for x, y in places))).apply_scale(scale)
    result = rlacd.decompose(mesh, threshold=0.09, max_hulls=10, quality="fast", threads=1)
    listed = result.report.passages
    seen = {min(range(8), key=lambda i: np.hypot(*(np.array(p.at_abs[:2]) / scale - places[i]))) for p in listed}
    lost = [clearance(result.hulls, scale * axis(x, y)).min() < 0.85 * 5 for x, y in places]
    assert len(listed) == len(seen)
    assert seen.issuperset(np.flatnonzero(lost).tolist())
    assert len(seen) > 4
    shares = [passage.left_abs / passage.radius_abs for passage in listed]
    assert shares == sorted(shares)
    for passage in listed:
        assert 0.97 * 5 <= passage.radius_abs <= 5
        assert passage.left_abs == pytest.approx(clearance(result.hulls, np.array([passage.at_abs]))[0], abs=1e-6)
    (warning,) = (said for said in result.report.warnings if "passages" in said)
    assert f"{sum(share < 1 / 2 for share in shares)} passages narrow by over half" in warning
    assert warning.endswith("; --keep-open, or a smaller threshold, keeps more open.")
    result = rlacd.decompose(mesh, criterion="volume", volume_tolerance=1.0, quality="fast", threads=1)
    assert result.report.warnings[-1].endswith("; --keep-open, or a smaller tolerance, keeps more open.")


def lugs(gap: float) -> Manifold:
    """Two plates on one axis, each with a hole 10 wide."""
    lug = Manifold.cube((40, 30, 10), True) - Manifold.cylinder(20, 5, 5, 48, True)
    return lug + lug.translate((0, 0, 10 + gap))


def slotted() -> Manifold:
    """A block with a slot of 190 x 4 right through between two rows of holes."""
    holes = [(10 + 10 * i, y) for i in range(19) for y in (8, 32)]
    one = Manifold.cylinder(40, 3, 3, 48, True)
    holed = box((0, 0, 0), (200, 40, 10)) - Manifold.compose([one.translate((x, y, 0)) for x, y in holes])
    return holed - box((5, 18, -1), (195, 22, 11))


@pytest.mark.promise("passages")
@pytest.mark.parametrize(
    ("solid", "threshold", "listed"),
    [(lugs(6), 0.2, 2), (lugs(40), 0.1, 2), (slotted(), 0.02, 39), (slotted(), 0.05, 39)],
    ids=["near lugs", "lugs", "the slot's ends close", "all closes"],
)
def test_each_passage_is_listed_once_however_long_and_holes_on_one_axis_are_two(
    solid: Manifold, threshold: float, listed: int
) -> None:
    report = rlacd.decompose(trimesh_of(solid), threshold=threshold, quality="fast", threads=1).report
    assert len(report.passages) == listed


@pytest.mark.promise("passages")
@pytest.mark.parametrize("minor", [0.1, 0.3])
@pytest.mark.parametrize(("around", "across"), [(64, 32), (16, 8), (12, 6), (8, 4)])
def test_the_hole_of_a_ring_is_a_passage_and_stays_open(around: int, across: int, minor: float) -> None:
    """Its walls turn away from each other: a ball in it is held across it only."""
    ring = trimesh.creation.torus(1.0, minor, major_sections=around, minor_sections=across)
    radius = (1 - minor) * np.cos(np.pi / around)
    (passage,) = rlacd.decompose(ring, quality="fast", max_hulls=1, threads=1).report.passages
    assert passage.radius_abs == pytest.approx(radius, rel=0.02)
    assert passage.left_abs == 0
    kept = rlacd.decompose(ring, quality="fast", threshold=0.4, keep_open=0.8, threads=1)
    assert clearance(kept.hulls, np.zeros((1, 3)))[0] > 0.78 * radius


@pytest.mark.promise("passages")
def test_a_slot_that_closes_is_one_passage_and_named() -> None:
    block = box((0, 0, 0), (100, 40, 30)) - box((5, 19, 10), (95, 21, 40))  # wider than slits that are filled
    report = rlacd.decompose(trimesh_of(block), quality="fast", threads=1).report
    (slot,) = report.passages
    assert (slot.radius_abs, slot.left_abs) == pytest.approx((1.0, 0.0), abs=0.01)
    assert report.warnings == ()
    report = rlacd.decompose(trimesh_of(block), threshold=0.005, max_hulls=1, quality="fast", threads=1).report
    assert any(
        said.startswith("1 passage narrows by")
        and "1 to nothing" in said
        and "from a radius of 1 units to 0 units;" in said
        for said in report.warnings
    )
    assert rlacd.decompose(trimesh_of(block), threshold_abs=0.05, quality="fast", threads=1).report.passages == ()


CRITERIA: list[dict[str, Any]] = [
    {},
    {"criterion": "distance"},
    {"criterion": "volume", "volume_tolerance": 0.1},
    {"criterion": rlacd.NavigableSpace(0.1, 0.16)},
    {"max_vertices": 32},
    {"overlap": 0.02},
    {"primitives": True},
]


@pytest.mark.promise("keep-open")
@pytest.mark.parametrize("given", CRITERIA, ids=str)
def test_a_share_of_every_wide_hole_stays_open_whatever_decides_the_hulls(given: dict[str, Any]) -> None:
    mesh, wide = trimesh_of(plate(*(bore(*hole) for hole in HOLES))), [hole for hole in HOLES if hole[0] > 0.05]
    result = rlacd.decompose(mesh, keep_open=0.9, quality="fast", threads=1, **given)
    for radius, x, y in wide:
        assert clearance(result.hulls, axis(x, y)).min() >= 0.985 * 0.9 * radius * np.cos(np.pi / 64)
    assert not any("Passage" in said for said in result.report.warnings)


@pytest.mark.slow
@pytest.mark.promise("keep-open")
@pytest.mark.parametrize(("kind", "side", "thickness", "turn"), PLATES)
def test_of_equal_holes_each_keeps_its_share(kind: str, side: int, thickness: float, turn: bool) -> None:
    mesh, axes, free = perforated(kind, side, 0.09, thickness, turn)
    result = rlacd.decompose(mesh, threshold=0.04, keep_open=0.9, quality="fast", threads=1)
    assert clearance(result.hulls, axes.reshape(-1, 3)).min() >= 0.885 * free
    assert not any("passage" in said for said in result.report.warnings)


@pytest.mark.promise("keep-open")
def test_a_long_slot_keeps_its_share_all_along() -> None:
    block = box((0, 0, 0), (100, 40, 30)) - box((5, 16, 10), (95, 24, 40)) - box((50, 30, 20), (60, 40, 30))
    result = rlacd.decompose(trimesh_of(block), threshold=0.06, keep_open=0.9, quality="fast", threads=1)
    points = np.array([(x, 20, z) for x in np.linspace(12, 88, 60) for z in (16, 20, 24)])
    assert clearance(result.hulls, points).min() >= 0.87 * 4


@pytest.mark.promise("keep-open")
def test_a_ball_of_a_given_radius_still_passes_and_narrower_holes_may_close() -> None:
    mesh = trimesh_of(plate(*(bore(*hole) for hole in HOLES))).apply_scale(50.0)
    given: dict[str, Any] = {"threshold": 0.3, "quality": "fast", "threads": 1}
    free, kept = rlacd.decompose(mesh, **given), rlacd.decompose(mesh, keep_open_abs=5.8, **given)
    at = [50 * axis(x, y) for _, x, y in HOLES]
    assert clearance(free.hulls, at[1]).min() < 5.8 <= clearance(kept.hulls, at[1]).min()
    assert clearance(kept.hulls, at[0]).min() >= 5.8
    assert clearance(kept.hulls, at[2]).min() < 2.9


def test_where_a_limit_forbids_it_a_warning_says_so() -> None:
    mesh = trimesh_of(plate(bore(0.3, 0, 0)))
    report = rlacd.decompose(mesh, keep_open=0.95, max_hulls=2, quality="fast", threads=1).report
    (passage,) = report.passages
    at = ", ".join(f"{x:.4g}" for x in passage.at_abs)
    size = f"from a radius of {passage.radius_abs:.4g} units to {passage.left_abs:.4g} units"
    assert any(
        said.startswith("1 passage narrows by more than --keep-open allows")
        and said.endswith(f"near ({at}) {size}; limits on the hulls leave no other way.")
        for said in report.warnings
    )


def test_a_share_and_a_radius_are_told_apart() -> None:
    assert {Options.of({"keep_open": given}).keep_open for given in (0.9, "0.9", "90%")} == {0.9}
    assert Options.of({"keep_open": "2mm"}).in_unit(1.0, "mesh").keep_open_abs == 0.002
    with pytest.raises(
        OptionError, match=r"keep_open_abs \(--keep-open as a length\) is 0\.1% .* between 0\.2% and 100%"
    ):
        rlacd.decompose(trimesh.creation.box(), keep_open_abs=0.001)
    with pytest.raises(OptionError, match="keep_open_abs, a length"):
        rlacd.decompose(trimesh.creation.box(), keep_open=0.9, keep_open_abs=0.1)
