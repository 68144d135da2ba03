"""The learned policy: what it sees, how it is loaded, and what it refuses."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest

import rlacd
from rlacd.errors import WeightsError
from rlacd.planes.sweep import sweep
from rlacd.planes.sweep_cache import SweepCache
from rlacd.policies import make_policy
from rlacd.policies.features import MIRRORED, candidates_of, features, measures, tables
from rlacd.policies.learned import Learned, PlaneRanker
from rlacd.solid.component import Component

PER_AXIS = 25


def chair() -> manifold3d.Manifold:
    """A seat with a back on four legs: no two of its axes are alike."""
    cube = manifold3d.Manifold.cube
    solid = cube((1.0, 1.2, 0.15)).translate((0, 0, 0.8)) + cube((1.0, 0.2, 1.0)).translate((0, 0, 0.8))
    for x in (0.0, 0.8):
        for y in (0.0, 1.0):
            solid += cube((0.2, 0.2, 0.9)).translate((x, y, 0))
    return solid.translate((-0.5, -0.6, -0.9))


def seen(solid: manifold3d.Manifold, scale: float = 0.05) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    component = Component(solid)
    grid, edges = tables(sweep(component, candidates_of(component, PER_AXIS)))
    planes, singles, whole = features(grid[None], edges[None], measures(component)[None], np.array([scale]))
    return planes[0], singles[0], whole[0]


def test_features_are_finite_and_of_moderate_size() -> None:
    for solid in (chair(), chair().scale((1, 1, 0.001)), manifold3d.Manifold.sphere(1.0, 32)):
        for inputs in seen(solid):
            assert np.isfinite(inputs).all()
            assert np.abs(inputs).max() < 25


def test_features_do_not_change_when_the_solid_and_the_scale_grow_together() -> None:
    for small, large in zip(seen(chair(), 0.05), seen(chair().scale((2, 2, 2)), 0.1), strict=True):
        np.testing.assert_allclose(small, large, atol=2e-5)


def test_features_tell_the_size_of_a_solid() -> None:
    assert np.abs(seen(chair(), 0.05)[2] - seen(chair(), 0.1)[2]).max() > 0.5


def test_mirroring_the_solid_mirrors_the_features() -> None:
    planes, _, whole = seen(chair())
    mirrored, _, mirrored_whole = seen(chair().mirror((1, 0, 0)))
    np.testing.assert_allclose(mirrored[0], planes[0][list(MIRRORED), ::-1], atol=2e-5)
    np.testing.assert_allclose(mirrored[1:3], planes[1:3], atol=2e-5)
    np.testing.assert_allclose(mirrored_whole, whole, atol=2e-5)


def test_turning_the_solid_permutes_the_features_of_the_coordinate_axes() -> None:
    planes, _, whole = seen(chair())
    turned, _, turned_whole = seen(chair().transform(np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0]], float)))
    np.testing.assert_allclose(turned[:3], planes[[1, 2, 0]], atol=2e-5)
    np.testing.assert_allclose(turned_whole, whole, atol=2e-5)


def test_the_shipped_policy_ranks_every_plane_it_looks_at() -> None:
    ranker, component = PlaneRanker(), Component(chair())
    swept = sweep(component, candidates_of(component, PER_AXIS))
    q = ranker.log_parts(component, swept, 0.05)
    assert q.shape == (len(swept.candidates),)
    assert np.isfinite(q).all()
    assert 0 < np.exp(q[swept.valid()]).min() < 30


def test_scales_never_met_in_training_are_taken_to_be_the_nearest() -> None:
    ranker, component = PlaneRanker(), Component(chair())
    swept = sweep(component, candidates_of(component, PER_AXIS))
    least = ranker.about.scales[0]
    below, at = (ranker.log_parts(component, swept, scale) for scale in (least / 10, least))
    np.testing.assert_array_equal(below, at)


def test_shared_sweeps_change_nothing_and_coarser_ones_can_be_ranked() -> None:
    component = Component(chair())
    assert Learned(sweeps=SweepCache()).choose(component) == Learned().choose(component)
    coarse = SweepCache(12, 4).of(component)
    cost = Learned().rank(component, coarse)
    assert cost.shape == (len(coarse.candidates),)
    assert np.isfinite(cost).all()
    assert (cost > 0).all()


@pytest.mark.parametrize("shift", [0.0, 0.35])
def test_the_shipped_policy_cuts_an_l_and_a_t_in_two(shift: float) -> None:
    cube = manifold3d.Manifold.cube
    mesh = (cube((1.0, 1.0, 0.3)) + cube((0.3, 1.0, 1.0)).translate((shift, 0, 0))).to_mesh64()
    found = rlacd.decompose((mesh.vert_properties[:, :3], mesh.tri_verts), policy="learned", threads=1)
    assert len(found) == 2
    assert found.report["concavity"]["max"] <= 0.05


@pytest.mark.nightly
def test_the_result_does_not_depend_on_the_number_of_threads(corpus: Path) -> None:
    path = corpus / "test/vhacd/ob_chair_gothic.ply"
    one, two = (rlacd.decompose(path, policy="learned", threads=n) for n in (1, 2))
    assert len(one) == len(two)
    for a, b in zip(one.hulls, two.hulls, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)


def test_a_copy_of_the_weights_elsewhere_is_the_same_policy(tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    path.write_bytes(files("rlacd.weights").joinpath("ranker.onnx").read_bytes())
    component = Component(chair())
    assert make_policy(str(path), scale=0.05).choose(component) == make_policy("learned", scale=0.05).choose(component)


def onnx_file(path: Path, **metadata: str) -> Path:
    """A sound ONNX model that is no guide."""
    onnx = pytest.importorskip("onnx")
    value = onnx.helper.make_tensor_value_info
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Identity", ["x"], ["y"])], "g", [value("x", 1, [1])], [value("y", 1, [1])]
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=9)
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, path)
    return path


ABOUT: dict[str, Any] = {
    "kind": "guide",
    "features": 2,
    "per_axis": 25,
    "scales": [0.02, 0.1],
    "blend": 1,
    "edge_bonus": 0,
}


def bad_weights(tmp_path: Path, kind: str) -> Path:
    path = tmp_path / f"{kind}.onnx"
    if kind == "missing":
        return path
    if kind == "folder":
        path.mkdir()
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "garbage":
        path.write_bytes(bytes(range(256)) * 16)
    elif kind == "truncated":
        whole = files("rlacd.weights").joinpath("ranker.onnx").read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
    elif kind == "foreign":
        onnx_file(path)
    elif kind == "other inputs":
        onnx_file(path, rlacd=json.dumps(ABOUT))
    elif kind == "other version":
        onnx_file(path, rlacd=json.dumps(ABOUT | {"features": 99}))
    elif kind == "no version":
        onnx_file(path, rlacd=json.dumps({"kind": "guide"}))
    elif kind == "metadata of another kind":
        onnx_file(path, rlacd="[1, 2]")
    elif kind == "metadata that are no JSON":
        onnx_file(path, rlacd="{")
    elif kind == "metadata that are no text":
        path.write_bytes(onnx_file(path, rlacd="placeholder").read_bytes().replace(b"placeholder", b"\xff" * 11))
    return path


BAD = [
    "missing",
    "folder",
    "empty",
    "garbage",
    "truncated",
    "foreign",
    "other inputs",
    "other version",
    "no version",
    "metadata of another kind",
    "metadata that are no JSON",
    "metadata that are no text",
]


@pytest.mark.parametrize("kind", BAD)
def test_bad_weights_are_one_clear_error(tmp_path: Path, kind: str) -> None:
    path = bad_weights(tmp_path, kind)
    with pytest.raises(WeightsError) as error:
        Learned(path)
    message = str(error.value)
    assert path.name in message
    assert message.endswith(".")
    assert "\n" not in message


def test_decompose_says_what_is_wrong_with_the_weights(tmp_path: Path) -> None:
    mesh = chair().to_mesh64()
    with pytest.raises(WeightsError, match="cannot be read"):
        rlacd.decompose((mesh.vert_properties[:, :3], mesh.tri_verts), policy=str(tmp_path / "none.onnx"))
