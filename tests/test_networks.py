"""Networks as policies: the paper's rule decides, and files that are no sound network are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest

import rlacd
from rlacd.errors import WeightsError
from rlacd.planes.candidates import axis_and_principal
from rlacd.policies import make_policy
from rlacd.policies.observe import observe
from rlacd.policies.q_network import KIND, METADATA, OnnxQ
from rlacd.policies.qpolicy import QPolicy, best_planes
from rlacd.solid.component import Component

onnx = pytest.importorskip("onnx", reason="the extra train is not installed")

from fuzz.networks import ABOUT, q_network  # noqa: E402


def chair() -> manifold3d.Manifold:
    """A seat with a back on four legs: no two of its axes are alike."""
    cube = manifold3d.Manifold.cube
    solid = cube((1.0, 1.2, 0.15)).translate((0, 0, 0.8)) + cube((1.0, 0.2, 1.0)).translate((0, 0, 0.8))
    for x in (0.0, 0.8):
        for y in (0.0, 1.0):
            solid += cube((0.2, 0.2, 0.9)).translate((x, y, 0))
    return solid.translate((-0.5, -0.6, -0.9))


def mesh() -> tuple[np.ndarray, np.ndarray]:
    found = chair().to_mesh64()
    return found.vert_properties[:, :3], found.tri_verts


@pytest.fixture
def network(tmp_path: Path) -> Path:
    path = tmp_path / "net.onnx"
    path.write_bytes(q_network())
    return path


def test_alone_the_valid_plane_of_greatest_value_is_taken(network: Path) -> None:
    component, values = Component(chair()), OnnxQ(network)
    candidates = axis_and_principal(component)
    seen = observe(component, candidates, 0.05, values.points)
    best = int(np.argmax(np.where(seen.mask, values(seen), -np.inf)))
    assert QPolicy(values, 0.05, values.points).choose(component) == candidates.plane(best)


def test_deployed_the_least_hulls_among_its_ten_best_and_the_edges_planes_are_taken(network: Path) -> None:
    component, values = Component(chair()), OnnxQ(network)
    candidates = axis_and_principal(component)
    seen = observe(component, candidates, 0.05, values.points)
    planes = [candidates.plane(int(i)) for i in best_planes(values(seen), seen.mask, 10)]
    edges = rlacd.SweepCache(1, 4).candidates(component)
    planes += [edges.plane(i) for i in range(6, len(edges))]
    chosen = make_policy(str(network), scale=0.05).choose(component)

    def hulls(plane: rlacd.Plane) -> float:
        return sum(side.hull.volume for side in component.cut(plane) if side is not None)

    assert chosen in planes
    assert hulls(chosen) == pytest.approx(min(hulls(plane) for plane in planes), rel=1e-9)


def test_decompose_takes_a_network(network: Path) -> None:
    one, two = (rlacd.decompose(mesh(), policy=str(network), threads=n) for n in (1, 2))
    assert one.report["concavity"]["max"] <= 0.05
    for a, b in zip(one.hulls, two.hulls, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)


def bad_network(tmp_path: Path, kind: str) -> Path:
    path = tmp_path / f"{kind}.onnx"
    if kind == "missing":
        return path
    if kind == "folder":
        path.mkdir()
        return path
    content = {
        "empty": b"",
        "garbage": bytes(range(256)) * 16,
        "truncated": q_network()[:1000],
        "of another kind": q_network({**ABOUT, "kind": "guide"}),
        "without metadata": q_network({}),
        "without a number of points": q_network({"kind": KIND, "threshold": 0.05}),
        "metadata that are no text": q_network({**ABOUT, "x": "placeholder"}).replace(b"placeholder", b"\xff" * 11),
    }
    if kind in content:
        path.write_bytes(content[kind])
        return path
    model = onnx.load_model_from_string(q_network())
    if kind == "other inputs":
        model.graph.input[0].name = "cloud"
    elif kind == "metadata that are a list":
        onnx.helper.set_model_props(model, {METADATA: json.dumps([1, 2])})
    elif kind == "metadata that are no JSON":
        onnx.helper.set_model_props(model, {METADATA: "{"})
    onnx.save(model, path)
    return path


BAD = [
    "missing",
    "folder",
    "empty",
    "garbage",
    "truncated",
    "of another kind",
    "without metadata",
    "without a number of points",
    "other inputs",
    "metadata that are a list",
    "metadata that are no JSON",
    "metadata that are no text",
]


@pytest.mark.parametrize("kind", BAD)
def test_bad_networks_are_one_clear_error_before_any_work(tmp_path: Path, kind: str) -> None:
    path = bad_network(tmp_path, kind)
    with pytest.raises(WeightsError) as error:
        rlacd.decompose("missing.stl", policy=str(path))
    message = str(error.value)
    assert path.name in message
    assert message.endswith(".")
    assert "\n" not in message


@pytest.mark.parametrize("change", [{"points": 10**9}, {"points": 0}, {"threshold": float("nan")}, {"threshold": "x"}])
def test_networks_that_ask_for_too_much_are_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    path = tmp_path / "net.onnx"
    path.write_bytes(q_network({**ABOUT, **change}))
    with pytest.raises(WeightsError, match="metadata"):
        OnnxQ(path)
