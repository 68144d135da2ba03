"""Training with the I2P-MAE encoder, from a file of weights to a policy."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from rlacd.errors import OptionError, WeightsError
from rlacd.learn.options import TrainOptions
from rlacd.solid.component import Component
from tests.learning import small_solids, write_meshes

pytest.importorskip("torch", reason="needs the extra train")

import torch

from rlacd.learn.encoders.i2p_mae import I2PMAEEncoder
from rlacd.learn.q_network import QNetwork, load_policy
from rlacd.learn.train import train
from rlacd.policies.plane_features import PLANES
from tests.encoding import TINY as TINY_SIZES
from tests.encoding import write_tiny_weights
from tests.test_learn_train import TINY
from tests.test_learn_train import weights as state

pytestmark = pytest.mark.slow

SHORT: dict[str, Any] = {
    **TINY,
    "encoder": "i2p-mae",
    "iterations": 60,
    "warmup": 20,
    "points": 64,
    "validate_every": 30,
}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("rlacd.learn.encoders.i2p_mae.Sizes", lambda: TINY_SIZES)
    return write_tiny_weights(tmp_path / "tiny.pth")


def run(meshes: Path, folder: Path, weights: Path, resume: bool = False, **changes: Any) -> Path:
    options = TrainOptions(**{**SHORT, "encoder_weights": str(weights), **changes})
    return train(meshes, folder, options, resume=resume, say=lambda line: None)


@pytest.mark.slow
def test_a_resumed_run_is_the_run_that_was_never_stopped(meshes: Path, weights: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "whole", weights)
    run(meshes, tmp_path / "halves", weights, iterations=34)
    elsewhere = shutil.copy(weights, tmp_path / "the_same.pth")
    run(meshes, tmp_path / "halves", elsewhere, resume=True)
    assert state(tmp_path / "whole") == state(tmp_path / "halves")
    assert load_policy(tmp_path / "halves").choose(Component(small_solids()["angle"])) is not None


def test_other_weights_do_not_go_on_with_a_run(meshes: Path, weights: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", weights, iterations=30, validation=0)
    other = write_tiny_weights(tmp_path / "other.pth", seed=1)
    with pytest.raises(OptionError, match=r"other\.pth holds other weights than the run began with"):
        run(meshes, tmp_path / "run", other, resume=True, validation=0)


def test_too_few_points_and_unusable_files_are_reported_before_a_run_begins(
    meshes: Path, weights: Path, tmp_path: Path
) -> None:
    with pytest.raises(OptionError, match="16 points; this encoder needs at least 32"):
        run(meshes, tmp_path / "run", weights, points=16)
    weights.write_bytes(weights.read_bytes()[:500])
    with pytest.raises(WeightsError, match="damaged"):
        run(meshes, tmp_path / "run", weights)
    assert not (tmp_path / "run" / "checkpoint.npz").exists()


def test_the_paper_preset_sees_what_the_paper_sees() -> None:
    paper = TrainOptions.preset("paper")
    assert (paper.encoder, paper.points) == ("i2p-mae", 2048)
    network = QNetwork(I2PMAEEncoder().dim, PLANES)
    widths = [layer.out_features for layer in network.layers if isinstance(layer, torch.nn.Linear)]
    assert widths == [1024, 512, 256, 128, 150]
    assert network.layers[0].in_features == 384 + 384
