"""Presets: their limits hold for real objects, the user's own options go first, and what cannot be met is said."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

import rlacd
from fuzz.geometry import Polytope
from rlacd.extras.finish.limits import engine_shortcomings
from rlacd.options.presets import PRESETS, find_preset
from rlacd.solid.hull import Hull


def ball() -> trimesh.Trimesh:
    """A sphere of many triangles: far above every limit."""
    return trimesh.creation.icosphere(subdivisions=2)


def barrel() -> trimesh.Trimesh:
    height, angle = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(0, 2 * np.pi, 48, endpoint=False))
    radius = 0.75 - 0.2 * height**2
    corners = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return trimesh.PointCloud(corners.reshape(-1, 3)).convex_hull


def cloud(points: int) -> trimesh.Trimesh:
    return trimesh.PointCloud(np.random.default_rng(points).normal(size=(points, 3))).convex_hull


CONVEX = {
    "box": trimesh.creation.box(),
    "ball": trimesh.creation.icosphere(subdivisions=3),
    "coarse ball": ball(),
    "barrel": barrel(),
    "capsule": trimesh.creation.capsule(1.0, 0.5),
    "cloud of 100": cloud(100),
    "cloud of 500": cloud(500),
}
CROSSING_BALLS = trimesh.creation.icosphere(4) + trimesh.creation.icosphere(4).apply_translation((1.2, 0.1, 0.05))
"""Hulls of 2,300 corners: too dear to be cut on for the limit."""

LIMITS: list[dict[str, Any]] = [*({"preset": name} for name in PRESETS), {"max_vertices": 7}, {"max_faces": 4}]


@pytest.mark.slow
@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.promise("presets", "convex-input")
def test_a_convex_body_is_one_hull_within_any_limits_and_a_warning_tells_how_far_it_sticks_out(name: str) -> None:
    body = CONVEX[name]
    for limits in LIMITS:
        (hull,) = result = rlacd.decompose(body, threads=1, quality="fast", **limits)
        preset = PRESETS.get(limits.get("preset", ""))
        assert len(hull.vertices) <= (limits.get("max_vertices") or (preset and preset.max_vertices) or np.inf)
        assert len(hull.faces) <= (limits.get("max_faces") or (preset and preset.max_faces) or np.inf)
        assert Polytope(hull.vertices, hull.faces).height(np.asarray(body.vertices)).max() <= 1e-9
        out = trimesh.proximity.closest_point(body, hull.vertices)[1].max() * 2 / body.extents.max()
        told = [warning for warning in result.report.warnings if "sticks out by up to" in warning]
        assert len(told) == (out > 0.0501) or out > 0.0499
        assert result.report.hausdorff.added == pytest.approx(out, abs=0.003)


RING = trimesh.creation.torus(1.0, 0.35, 48, 32)


def test_limits_on_corners_are_not_blamed_for_what_one_on_hulls_does() -> None:
    warnings = rlacd.decompose(RING, threads=1, quality="fast", max_vertices=32, max_hulls=3).report.warnings
    assert any("3 of 3 parts exceed" in warning for warning in warnings)
    assert not any("out by up to" in warning for warning in warnings)


@pytest.fixture(scope="module", params=[RING, CROSSING_BALLS], ids=["ring", "balls"])
def unlimited(request: pytest.FixtureRequest) -> tuple[trimesh.Trimesh, rlacd.Decomposition]:
    return request.param, rlacd.decompose(request.param, threads=1, quality="fast")


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.promise("presets")
def test_a_preset_takes_at_most_twice_the_hulls(
    name: str, unlimited: tuple[trimesh.Trimesh, rlacd.Decomposition]
) -> None:
    preset, (mesh, free) = PRESETS[name], unlimited
    result = rlacd.decompose(mesh, preset=name, threads=1, quality="fast")
    assert max(len(hull.vertices) for hull in result) <= (preset.max_vertices or np.inf)
    assert max(len(hull.faces) for hull in result) <= (preset.max_faces or np.inf)
    assert result.report.options["preset"] == name
    assert len(free) <= len(result) <= (len(free) if mesh is CROSSING_BALLS else 2 * len(free))
    over = result.report.concavity.max > 0.05
    assert over == any("stick" in warning for warning in result.report.warnings)


def test_options_given_go_before_the_preset() -> None:
    result = rlacd.decompose(ball(), preset="newton", max_vertices=100, threads=1)
    assert 64 < max(len(hull.vertices) for hull in result) <= 100
    (warning,) = result.report.warnings
    assert warning.endswith("more than 64, the limit for Newton.")


def test_a_sheet_that_a_gpu_refuses_is_reported() -> None:
    sheet = trimesh.creation.box((1.0, 1.0, 0.004))
    assert rlacd.decompose(sheet, preset="physx", threads=1).report.warnings == ()
    (warning,) = rlacd.decompose(sheet, preset="physx-gpu", threads=1).report.warnings
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
