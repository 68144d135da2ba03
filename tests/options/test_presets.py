"""Presets: their limits hold for real objects, the user's own options go first, and what cannot be met is said."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rlacd
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
