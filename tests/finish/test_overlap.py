"""`overlap`: hulls overlap where they touch, so that needles pushed at a seam do not slip between them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from manifold3d import Manifold

import rlacd
from fuzz.geometry import Polytope
from rlacd import _native
from rlacd.compat import coacd
from rlacd.criteria import Concavity
from rlacd.errors import OptionError
from rlacd.extras.finish.overlap import overlap_parts
from rlacd.options import Options
from rlacd.report import Overlap
from rlacd.solid.component import Component, Plane
from rlacd.solid.frame import Frame
from tests.hulls import assert_convex_hull
from tests.shapes import trimesh_of

Array = npt.NDArray[np.float64]

OVERLAP = 0.04


def ell() -> trimesh.Trimesh:
    """An L whose longest side is 2: it is cut in two."""
    return trimesh_of(Manifold.cube((2.0, 0.6, 0.5)) + Manifold.cube((0.5, 0.6, 1.5)))


def stool() -> trimesh.Trimesh:
    """A seat on four legs, with a rail that crosses two of them."""
    legs = [Manifold.cube((0.2, 0.2, 1.5)).translate((x, y, 0.0)) for x in (0.0, 1.8) for y in (0.0, 1.0)]
    rail = Manifold.cube((1.7, 0.1, 0.2)).translate((0.15, 0.05, 0.5))
    seat = Manifold.cube((2.0, 1.2, 0.2)).translate((0.0, 0.0, 1.5))
    return trimesh_of(legs[0] + legs[1] + legs[2] + legs[3] + rail + seat)


def depths(hulls: list[trimesh.Trimesh], points: Array) -> Array:
    """How deep points lie in each hull [H, N]."""
    return np.array([-Polytope(np.array(hull.vertices), np.array(hull.faces)).height(points) for hull in hulls])


def needles(mesh: trimesh.Trimesh, hulls: list[trimesh.Trimesh], far: float) -> tuple[Array, Array]:
    """Places on seams [N, 3], on two hulls and inside none, and how deep each lies in the solid, at least `far`."""
    places = np.concatenate([trimesh.sample.sample_surface(hull, 2000, seed=1)[0] for hull in hulls])
    deepest = np.sort(depths(hulls, places), axis=0)
    places = np.ascontiguousarray(places[(deepest[-2] > -1e-6) & (deepest[-1] < 1e-6)])
    surface = _native.Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, np.int32))
    deep = np.where(surface.winding(places) > 0.5, surface.distance(places), 0.0)
    return places[deep >= far], deep[deep >= far]


def slips(hulls: list[trimesh.Trimesh], places: Array, deep: Array, overlap: float) -> float:
    """The share of needles that no hull pushes back: where the nearest way out of every hull is sideways."""
    return float((depths(hulls, places).max(axis=0) < 0.5 * np.minimum(deep, overlap / 2)).mean())


OPTIONS: list[dict[str, Any]] = [
    {},
    {"max_vertices": 8},
    {"primitives": True},
    {"detail": "full"},
    {"criterion": "volume", "volume_tolerance": 0.1},
    {"criterion": rlacd.NavigableSpace(radius=0.4, tolerance=0.1)},
    {"max_hulls": 4},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda given: "+".join(given) or "default")
def test_no_needle_slips_between_hulls_that_overlap(options: dict[str, Any]) -> None:
    mesh = stool()
    flush = rlacd.decompose(mesh, quality="fast", threads=1, **options)
    result = rlacd.decompose(mesh, quality="fast", threads=1, overlap=OVERLAP / 2, **options)
    overlap = OVERLAP / result.report.scale
    places, deep = needles(mesh, flush.hulls, overlap / 10)
    assert len(places) > 100
    assert slips(flush.hulls, places, deep, overlap) > 0.9
    assert slips(result.hulls, places, deep, overlap) == 0.0
    assert result.report.overlap.short == 0
    assert result.report.overlap.seams >= 3
    assert result.report.warnings == flush.report.warnings
    for hull in result:
        assert_convex_hull(hull)
        assert len(hull.vertices) <= options.get("max_vertices", np.inf)


@pytest.mark.promise("overlap")
def test_the_threshold_holds_and_each_hull_contains_its_own() -> None:
    flush, result = (rlacd.decompose(stool(), quality="fast", threads=1, overlap=depth / 2) for depth in (0.0, OVERLAP))
    assert len(flush) == len(result)
    assert result.report.concavity.max <= 0.05
    assert result.report.hausdorff.added <= 0.05
    for before, after in zip(flush, result, strict=True):
        assert depths([after], before.vertices).min() > -1e-9
    assert sum(hull.volume for hull in result) > sum(hull.volume for hull in flush)


FRAME = Frame(np.zeros(3), 1.0)


def halves(height: float = 1.0) -> tuple[Component, list[Component]]:
    """A box two units wide, cut in its middle."""
    box = Component(Manifold.cube((2.0, 1.0, height), center=True))
    below, above = box.cut(Plane((1.0, 0.0, 0.0), 0.0))
    return box, [below, above]


@pytest.mark.parametrize("overlap", [0.001, 0.02, 0.3])
def test_two_halves_of_a_box_overlap_by_exactly_that_much(overlap: float) -> None:
    box, parts = halves()
    grown, seams = overlap_parts(parts, box, Concavity(0.05), overlap, FRAME)
    assert (seams.seams, seams.short) == (1, 0)
    reach = grown[0].hull.box[1, 0] - grown[1].hull.box[0, 0]
    assert reach == pytest.approx(overlap, abs=1e-9)
    assert sum(part.hull.volume for part in grown) == pytest.approx(2.0 + overlap, abs=1e-9)


def test_parts_that_do_not_touch_or_share_only_an_edge_stay_as_they_are() -> None:
    first = Manifold.cube((1.0, 1.0, 1.0))
    for apart in ((1.5, 0.0, 0.0), (1.0, 1.0, 0.0)):
        second = first.translate(apart)
        parts = [Component(first), Component(second)]
        whole = Component(first + second.translate((1e-3, 0, 0)))
        grown, seams = overlap_parts(parts, whole, Concavity(0.05), 0.1, FRAME)
        assert seams.seams == 0
        assert all(before is after for before, after in zip(parts, grown, strict=True))


@pytest.mark.promise("overlap")
def test_a_seam_without_room_is_told() -> None:
    """Two blocks of a stair: what either takes in of the other spans the step between them."""
    mesh = trimesh_of(Manifold.cube((1.0, 1.0, 1.0)) + Manifold.cube((1.0, 1.0, 1.0)).translate((1.0, 0.5, 0.5)))
    result = rlacd.decompose(mesh, threshold=0.003, overlap=0.2, quality="fast", threads=1)
    overlap = result.report.overlap
    assert overlap.short > 0
    (told,) = (warning for warning in result.report.warnings if "seams" in warning)
    assert f"{overlap.short} of {overlap.seams} seams" in told
    assert len(overlap.short_seams) == overlap.short
    for seam in overlap.short_seams:
        place = np.array([seam.at_abs])
        between = depths([result[part] for part in seam.hulls], place)
        assert between.max() == pytest.approx(seam.depth_abs, abs=1e-3)
        assert between.min() > -0.003 / result.report.scale, "a place on both hulls"
        assert seam.depth_abs < 0.1 / result.report.scale
    assert result.report.concavity.max <= 0.003


def test_nodes_that_move_do_not_overlap_each_other() -> None:
    scene = trimesh.Scene()
    scene.add_geometry(ell(), node_name="frame", geom_name="frame")
    door = trimesh.creation.box(bounds=[(0.5, 0.0, 0.5), (2.0, 0.6, 1.5)])  # lies on the frame
    scene.add_geometry(door, node_name="door", geom_name="door")
    result = rlacd.decompose(scene, per_node=True, overlap_abs=0.04, quality="fast", threads=1)
    (own,) = (hull for hull in result if hull.metadata["node"] == "door")
    np.testing.assert_allclose(own.bounds, door.bounds, atol=1e-9)
    frame = [hull for hull in result if hull.metadata["node"] == "frame"]
    flush = rlacd.decompose(ell(), quality="fast", threads=1)
    assert sum(hull.volume for hull in frame) > sum(hull.volume for hull in flush)
    assert result.report.overlap == Overlap(1, 0, ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"),
    [("lamp.ply", 0.03), ("ob_chair_gothic.ply", 0.03), pytest.param("al.ply", 0.15, marks=pytest.mark.nightly)],
)
def test_few_needles_slip_between_hulls_of_real_objects(corpus: Path, name: str, least: float) -> None:
    """Those that do slip at seams that are told to be short."""
    mesh = corpus / "test" / "vhacd" / name
    flush = rlacd.decompose(mesh, quality="fast", threads=1, detail="full")
    result = rlacd.decompose(mesh, quality="fast", threads=1, overlap=0.02)
    overlap = 0.02 / result.report.scale
    places, deep = needles(flush.source, flush.hulls, overlap / 10)
    assert slips(flush.hulls, places, deep, overlap) > 0.9
    assert slips(result.hulls, places, deep, overlap) < least
    assert result.report.concavity.max <= 0.05


def test_coacd_extrudes_the_same_way() -> None:
    mesh = ell()
    flush = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces))
    grown = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), extrude=True, extrude_margin=0.02)
    volumes = [sum(trimesh.Trimesh(*hull).volume for hull in hulls) for hulls in (flush, grown)]
    assert len(flush) == len(grown) == 2
    assert volumes[1] > volumes[0] + 0.5 * 0.04 * 0.3


def test_lengths_are_given_like_the_threshold() -> None:
    assert Options(overlap_abs=0.5).at_scale(0.1).overlap == pytest.approx(0.05)
    assert Options(overlap=0.1).for_node(1.0, 2.0).overlap == pytest.approx(0.2)
    assert Options(overlap=0.1, relative_to="node").for_node(1.0, 2.0).overlap == 0.1
    assert Options(overlap_abs=0.1, relative_to="node").for_node(1.0, 2.0).overlap == pytest.approx(0.2)
    assert Options.of({"overlap": "2mm"}).in_unit(1e-3, "mesh").overlap_abs == pytest.approx(2.0)
    with pytest.raises(OptionError, match="overlap_abs"):
        rlacd.decompose(trimesh.creation.box(), overlap_abs=0.3)
    for wrong in (-0.1, 0.6, float("nan"), "thick", None):
        with pytest.raises(OptionError, match="overlap"):
            Options(overlap=wrong)  # type: ignore[arg-type]
