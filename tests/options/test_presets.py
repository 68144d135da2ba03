"""Presets: their limits hold for real objects, the user's own options go first, and what cannot be met is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog

import rlacd
from rlacd.errors import OptionError
from rlacd.finish.report import engine_shortcomings
from rlacd.options.presets import PRESETS, find_preset
from rlacd.solid.hull import Hull


def ball() -> trimesh.Trimesh:
    """A sphere of many triangles: far above every limit."""
    return trimesh.creation.icosphere(subdivisions=2)


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.promise("presets")
def test_round_bodies_are_brought_inside_the_limits(name: str) -> None:
    preset = PRESETS[name]
    result = rlacd.decompose(ball(), preset=name, threads=1, quality="fast")
    assert max(len(hull.vertices) for hull in result) <= (preset.max_vertices or np.inf)
    assert max(len(hull.faces) for hull in result) <= (preset.max_faces or np.inf)
    assert result.report["options"]["preset"] == name
    assert result.report["warnings"] == []
    assert result.report["concavity"]["max"] <= 0.05, "the threshold holds for limited hulls too"


@pytest.mark.nightly
def test_real_objects_are_what_a_gpu_takes(corpus: Path) -> None:
    """The rule of PhysX for each hull: 64 vertices and polygons, 32 corners a polygon, 32 polygons a corner."""
    names = (corpus / "quick.txt").read_text().split()
    for name in names[:6]:
        result = rlacd.decompose(corpus / name, preset="physx-gpu", threads=1)
        thin = 0
        for hull in result:
            corners = [len(set(hull.faces[facet].ravel())) for facet in hull.facets]
            assert len(hull.vertices) <= 64
            assert len(hull.faces) <= 64
            assert max(corners, default=3) <= 32
            assert np.bincount(hull.faces.ravel()).max() <= 32
            thin += thinner_than_a_hundredth(hull)
        said = [warning for warning in result.report["warnings"] if "thinner than 1/100" in warning]
        assert bool(said) == bool(thin), name


def thinner_than_a_hundredth(hull: trimesh.Trimesh) -> bool:
    """Whether the largest ball between the planes of its faces has a radius below 1/100 of its extent."""
    corners = np.array(hull.vertices)[np.array(hull.faces)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    some = lengths > 1e-9 * lengths.max()  # a needle's normal may be anything; its neighbours have its edges
    normals = normals[some] / lengths[some, None]
    offsets = (np.array(hull.vertices) @ normals.T).max(axis=0)
    ball = linprog(
        [0, 0, 0, -1], A_ub=np.column_stack([normals, np.ones(len(normals))]), b_ub=offsets, bounds=[(None, None)] * 4
    )
    assert ball.status == 0, ball.message
    return bool(ball.x[3] < 0.01 * np.ptp(hull.vertices, axis=0).max())


def test_options_given_go_before_the_preset() -> None:
    result = rlacd.decompose(ball(), preset="newton", max_vertices=100, threads=1)
    assert 64 < max(len(hull.vertices) for hull in result) <= 100
    (warning,) = result.report["warnings"]
    assert warning.endswith("more than 64, the limit for Newton.")


def test_a_sheet_that_a_gpu_refuses_is_reported() -> None:
    sheet = trimesh.creation.box((1.0, 1.0, 0.004))
    assert rlacd.decompose(sheet, preset="physx", threads=1).report["warnings"] == []
    (warning,) = rlacd.decompose(sheet, preset="physx-gpu", threads=1).report["warnings"]
    assert warning.startswith("1 hull is thinner than 1/100")


@pytest.mark.promise("presets")
def test_every_broken_limit_is_counted() -> None:
    hulls = [Hull.of(np.asarray(trimesh.creation.icosphere(subdivisions=level).vertices)) for level in (1, 2, 3)]
    known = [hull for hull in hulls if hull is not None]
    assert engine_shortcomings(find_preset("physx-gpu"), known) == [
        "2 hulls have up to 642 vertices, more than 64, the limit for PhysX on a GPU.",
        "3 hulls have up to 1280 triangles, more than 62, the limit for PhysX on a GPU.",
    ]
    assert engine_shortcomings(find_preset("mujoco"), known[:1]) == []


def test_an_unknown_preset_lists_the_known_ones() -> None:
    with pytest.raises(OptionError, match=r"'havok'; it has to be one of mujoco, physx, physx-gpu"):
        rlacd.decompose(ball(), preset="havok")
