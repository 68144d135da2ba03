"""Training with the I2P-MAE encoder, from a file of weights to a policy that `decompose` runs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

import rlacd
from rlacd.errors import OptionError, WeightsError
from rlacd.learn.paper.options import TrainOptions
from rlacd.policies import make_policy
from rlacd.pool import LocalPool, Pool
from rlacd.solid.component import Component
from tests.learning import small_solids, write_meshes
from tests.shapes import from_manifold

pytest.importorskip("torch", reason="needs the extra train")

import torch
from manifold3d import Manifold, Mesh64

from rlacd.learn.encoders import I2PMAEEncoder, make_encoder
from rlacd.learn.paper import train as training
from rlacd.learn.paper.export import PointsToValues, export_policy
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.planes.candidates import axis_and_principal
from rlacd.policies.observe import observe
from rlacd.policies.q_network import OnnxQ
from rlacd.policies.qpolicy import QPolicy
from tests.encoding import write_tiny_weights

pytestmark = pytest.mark.slow

SHORT: dict[str, Any] = {
    "encoder": "i2p-mae",
    "iterations": 60,
    "warmup": 20,
    "batch": 8,
    "points": 64,
    "max_faces": 500,
    "environments": 2,
    "validation": 1,
    "validate_every": 30,
    "log_every": 20,
    "max_parts": 12,
    "replay": 50,
    "checkpoint_seconds": 0.0,
}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    return write_tiny_weights(tmp_path / "tiny.safetensors")


def run(
    meshes: Path,
    folder: Path,
    weights: Path,
    resume: bool = False,
    export: bool = False,
    pool: Pool | None = None,
    **changes: Any,
) -> Path:
    """Train; exporting takes longer than all the rest."""
    options = TrainOptions(**{**SHORT, "encoder_weights": str(weights), **changes})
    if export:
        return training.train(meshes, folder, options, resume=resume, say=lambda line: None, pool=pool)
    with mock.patch.object(training, "export_policy"):
        return training.train(meshes, folder, options, resume=resume, say=lambda line: None, pool=pool)


def learned(folder: Path) -> bytes:
    return (folder / "checkpoint" / "weights.safetensors").read_bytes()


@pytest.mark.nightly
def test_a_run_ends_with_one_file_that_decompose_runs(meshes: Path, weights: Path, tmp_path: Path) -> None:
    path = run(meshes, tmp_path / "run", weights, export=True)
    lines = [json.loads(line) for line in (tmp_path / "run" / "curves.jsonl").read_text().splitlines()]
    validated = [line["cuts"] for line in lines if "validation_merged_ratio" in line]
    assert [cuts // 30 for cuts in validated] == [1, 2]  # with the episode in which the 30th and 60th cut are made
    moved = shutil.move(path, tmp_path / "alone.onnx")  # nothing else is needed
    mesh = from_manifold(small_solids()["cross"])
    one, two = (
        rlacd.decompose((mesh.vertices, mesh.faces), policy=str(moved), threshold=0.04, threads=threads)
        for threads in (1, 2)
    )
    # Planes of concave edges are asked too, and the least hull sum finds them: two beams, and nothing else is filled.
    assert len(one.hulls) == 2
    beams = [Manifold(Mesh64(np.array(h.vertices), np.array(h.faces, dtype=np.uint64))) for h in one.hulls]
    assert (beams[0] + beams[1]).volume() == pytest.approx(small_solids()["cross"].volume(), rel=1e-6)
    assert [h.vertices.tobytes() for h in one.hulls] == [h.vertices.tobytes() for h in two.hulls]


@pytest.mark.nightly
def test_the_exported_file_computes_what_torch_does(weights: Path, tmp_path: Path) -> None:
    encoder = make_encoder("i2p-mae", weights)
    torch.manual_seed(0)
    network = QNetwork(encoder.dim, 1000.0)
    options = TrainOptions(encoder="i2p-mae", encoder_weights=str(weights), points=128, threshold=0.07)
    path = export_policy(tmp_path / "q.onnx", encoder, network, options)
    module, exported = PointsToValues(encoder, network, False), OnnxQ(path)
    components = [Component(solid) for solid in small_solids().values()]
    seen = [observe(c, axis_and_principal(c), 0.04, 128) for c in components]
    arrays = [np.stack([getattr(o, field) for o in seen]) for field in ("points", "directions", "scale")]
    with torch.inference_mode():
        expected = module(*(torch.from_numpy(a) for a in arrays)).numpy()
    assert np.ptp(expected, axis=0).max() > 5
    assert exported.run(*arrays) == pytest.approx(expected, abs=0.05)
    assert exported(seen[1]) == pytest.approx(expected[1], abs=0.05)
    assert (exported.points, exported.threshold) == (128, 0.07)
    policy = make_policy(str(path))
    assert isinstance(policy, QPolicy)
    assert policy.choose(components[0]) is not None
    check_that_the_file_carries_nothing_of_this_machine(path)
    check_that_damage_is_said(path)


def check_that_the_file_carries_nothing_of_this_machine(path: Path) -> None:
    content = path.read_bytes()
    assert str(Path(__file__).resolve().parents[1]).encode() not in content
    assert b"site-packages" not in content


def check_that_damage_is_said(path: Path) -> None:
    import onnx

    whole = path.read_bytes()
    model = onnx.load_from_string(whole)
    for about, said in (
        ({"kind": "q"}, "metadata"),
        ({"kind": "q", "points": "many", "threshold": 0.1}, "metadata"),
        ({"kind": "q", "points": -3, "threshold": 0.1}, "metadata"),
        ({"kind": "other"}, "not a policy of rlacd"),
        ([], "damaged"),
    ):
        del model.metadata_props[:]
        onnx.helper.set_model_props(model, {"rlacd": json.dumps(about)})
        other = path.with_name(f"{abs(hash(json.dumps(about)))}.onnx")
        other.write_bytes(model.SerializeToString())
        with pytest.raises(WeightsError, match=said):
            make_policy(str(other))
    short = path.with_name("short.onnx")
    short.write_bytes(whole[: len(whole) // 2])
    for opened in (lambda: make_policy(str(short)), lambda: OnnxQ(short)):
        with pytest.raises(WeightsError, match="damaged or no ONNX file"):
            opened()
    with pytest.raises(WeightsError, match="cannot be read"):
        OnnxQ(path.with_name("nowhere.onnx"))


@pytest.mark.slow
def test_a_resumed_run_is_the_run_that_was_never_stopped(meshes: Path, weights: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "whole", weights)
    run(meshes, tmp_path / "halves", weights, iterations=34)
    elsewhere = shutil.copy(weights, tmp_path / "the_same.safetensors")
    run(meshes, tmp_path / "halves", elsewhere, resume=True)
    assert learned(tmp_path / "whole") == learned(tmp_path / "halves")
    assert (tmp_path / "whole" / "best.safetensors").read_bytes() == (
        tmp_path / "halves" / "best.safetensors"
    ).read_bytes()


def test_other_weights_do_not_go_on_with_a_run(meshes: Path, weights: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", weights, iterations=30, validation=0)
    other = write_tiny_weights(tmp_path / "other.safetensors", seed=1)
    with pytest.raises(OptionError, match=r"other\.safetensors holds other weights than the run began with"):
        run(meshes, tmp_path / "run", other, resume=True, validation=0)


@pytest.mark.nightly
def test_worker_processes_change_nothing(meshes: Path, weights: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "alone", weights)
    with LocalPool(2) as pool:
        run(meshes, tmp_path / "spread", weights, pool=pool)
    assert learned(tmp_path / "alone") == learned(tmp_path / "spread")


def test_too_few_points_and_unusable_files_are_reported_before_a_run_begins(
    meshes: Path, weights: Path, tmp_path: Path
) -> None:
    with pytest.raises(OptionError, match="16 points; this encoder needs at least 32"):
        run(meshes, tmp_path / "run", weights, points=16)
    weights.write_bytes(weights.read_bytes()[:500])
    with pytest.raises(WeightsError, match="damaged"):
        run(meshes, tmp_path / "run", weights)
    assert not (tmp_path / "run").exists()


def test_the_paper_preset_sees_what_the_paper_sees() -> None:
    paper = TrainOptions.preset("paper")
    assert (paper.encoder, paper.points) == ("i2p-mae", 2048)
    network = QNetwork(I2PMAEEncoder().dim)
    widths = [layer.out_features for layer in network.layers if isinstance(layer, torch.nn.Linear)]
    assert widths == [1024, 512, 256, 128, 150]
    assert network.layers[0].in_features == 384 + 384
