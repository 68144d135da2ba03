"""The bound from below on the number of hulls: what it proves holds for every decomposition."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

import rlacd
from rlacd import _native
from rlacd.cli.terminal import summary
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.run import Run
from rlacd.search.at_least import UNCOVERED, at_least
from rlacd.solid.component import Component, Plane
from tests.shapes import Closed, Floats, box, depth_in, trimesh_of

REACH = 0.05


def comb(teeth: int) -> Manifold:
    """A bar with teeth: no two of them, nor a tooth and the far end of the bar, fit a hull."""
    solid = box((-1, -0.1, -0.1), (1, 0.1, 0.1))
    for x in np.linspace(-0.9, 0.9, teeth):
        solid += box((x - 0.05, -0.1, 0.05), (x + 0.05, 0.1, 0.9))
    return solid


def apart(solid: Component, points: Floats, reach: float = REACH + UNCOVERED) -> Floats:
    return points[_native.apart_points(solid.against.surface, points, reach, len(points))]


def points_of(solid: Component, count: int = 120) -> Floats:
    corners = solid.vertices[np.unique(solid.faces)]
    return np.concatenate([corners[:count], _native.sample_surface(solid.vertices, solid.faces, count, 3)[0]])


@pytest.mark.promise("lower-bound")
@pytest.mark.parametrize("teeth", [2, 3, 5])
def test_a_comb_needs_a_hull_for_every_tooth(teeth: int) -> None:
    result = rlacd.decompose(trimesh_of(comb(teeth)), threads=1)
    assert teeth <= result.report.lower_bound <= len(result)
    solid, slices = Component(comb(teeth)), []
    for x in np.linspace(-0.8, 0.8, 15).tolist():
        below, solid = solid.cut(Plane((1.0, 0.0, 0.0), x))
        slices.append(below)
    proved = at_least(Component(comb(teeth)), [*slices, solid], REACH, Run(threads=1))
    assert teeth <= proved <= len(result), "however many parts it begins with"


def test_convex_solids_and_criteria_without_a_distance_prove_nothing() -> None:
    cube = Component(box((-1, -1, -1), (1, 1, 1)))
    assert len(apart(cube, points_of(cube))) == 1
    parts = Component(comb(3)).pieces() * 2
    assert at_least(Component(comb(3)), parts, np.inf, Run(threads=1)) == 1


def test_pairs_that_are_apart_pass_a_place_that_is_far_from_the_solid() -> None:
    solid = Component(comb(4))
    found = apart(solid, points_of(solid))
    assert len(found) >= 4
    for a, b in itertools.combinations(found, 2):
        between = a + np.linspace(0, 1, 400)[:, None] * (b - a)
        outside = solid.against.surface.winding(between) < 0.5
        assert (solid.against.surface.distance(between)[outside] > REACH + UNCOVERED).any()


def test_what_lies_in_a_cavity_is_not_open_to_the_outside() -> None:
    shell = Component(box((-1, -1, -1), (1, 1, 1)) - box((-0.8, -0.8, -0.8), (0.8, 0.8, 0.8)))
    assert len(apart(shell, points_of(shell))) == 1


@pytest.mark.promise("lower-bound")
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["vhacd/hornbug.ply", "ikea_assembled/chair_ivar_0668.ply", "coacd_examples/Kettle.ply"]
)
def test_no_valid_hull_of_a_real_mesh_holds_two_of_the_points(corpus: Path, name: str) -> None:
    """Also none of coarser policies, other seeds and tighter thresholds."""
    mesh = corpus / "test" / name
    solid = repair(load_mesh(mesh), resolution=100, threads=1)
    root = Component(solid.shape)
    found = apart(root, points_of(root, 200))
    assert len(found) > 3
    for options in ({}, {"quality": "fast"}, {"threshold": 0.03}, {"seed": 5}, {"policy": "navacd", "quality": "fast"}):
        for hull in rlacd.decompose(mesh, threads=1, **options):
            inside = depth_in(Closed(solid.frame.to_frame(hull.vertices), np.asarray(hull.faces)), found) > -UNCOVERED
            assert inside.sum() <= 1


def test_the_summary_says_what_is_proved() -> None:
    result = rlacd.decompose(trimesh_of(comb(3)), threads=1)
    least = result.report.lower_bound
    words = "hulls" if least == len(result) else f"than {least} hulls"
    assert f"no decomposition to this tolerance has fewer {words}" in summary(result, "x.obj")
    assert rlacd.decompose(trimesh_of(comb(3)), quality="fast", threads=1).report.lower_bound is None
