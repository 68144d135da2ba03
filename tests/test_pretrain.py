"""Pretraining of the encoder: nothing hidden is seen, the same seed gives the same weights, a stopped run goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rlacd.cli.main import app
from rlacd.errors import OptionError, TrainingError
from rlacd.learn.pretrain.options import PretrainOptions
from tests.learning import write_meshes

pytest.importorskip("torch", reason="needs the extra train")

import torch

from rlacd.learn.encoders import I2PMAEEncoder
from rlacd.learn.encoders.i2p_mae import seen_below
from rlacd.learn.pretrain.clouds import Clouds, augmented, epoch_rows
from rlacd.learn.pretrain.masked import MaskedAutoencoder, chamfer, encode_seen, interpolated, seen_groups
from rlacd.learn.pretrain.run import learning_rate, pretrain
from tests.encoding import TINY, clouds

SHORT: dict[str, Any] = {
    "size": "tiny",
    "points": 64,
    "batch": 4,
    "steps": 12,
    "validation": 1,
    "log_every": 4,
    "validate_every": 6,
    "checkpoint_seconds": 0.0,
}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


def run(meshes: Path, out: Path, resume: bool = False, **changes: Any) -> Path:
    return pretrain(meshes, out, PretrainOptions(**{**SHORT, **changes}), resume=resume, say=lambda line: None)


def curves(out: Path) -> list[dict[str, float]]:
    lines = (out.with_suffix(".run") / "curves.jsonl").read_text().splitlines()
    return [{k: v for k, v in json.loads(line).items() if k != "seconds"} for line in lines]


def hidden_and_seen() -> tuple[MaskedAutoencoder, torch.Tensor, torch.Tensor]:
    torch.manual_seed(0)
    chances = torch.rand(3, TINY.groups[-1], generator=torch.Generator().manual_seed(1))
    return MaskedAutoencoder(TINY).eval(), clouds(3), seen_groups(chances, 0.75)


def test_with_nothing_hidden_it_is_the_encoder_itself() -> None:
    model, points, _ = hidden_and_seen()
    pyramid = model.encoder.h_encoder
    with torch.no_grad():
        scales = pyramid.pyramid(points)
        tokens = encode_seen(pyramid, scales, seen_below(scales, torch.ones(3, TINY.groups[-1])))[-1]
        assert tokens.reshape(3, TINY.groups[-1], -1) == pytest.approx(pyramid(points), abs=1e-5)


def test_what_is_hidden_is_not_seen_and_what_is_seen_matters() -> None:
    model, points, top = hidden_and_seen()
    pyramid = model.encoder.h_encoder
    with torch.no_grad():
        scales = pyramid.pyramid(points)
        seen = seen_below(scales, top)
        before = encode_seen(pyramid, scales, seen)
        for level, visible in enumerate(seen):
            assert len(before[level]) == int(visible.sum())
            scales[level].centers[visible == 0] = 7.0
            scales[level].offsets[visible == 0] = 7.0
        assert all(torch.equal(a, b) for a, b in zip(before, encode_seen(pyramid, scales, seen), strict=True))
        scales[0].offsets[seen[0] > 0] *= 1.1
        assert not torch.allclose(before[-1], encode_seen(pyramid, scales, seen)[-1])


@pytest.mark.parametrize(("hidden", "count"), [(0.8, 2), (0.5, 4), (0.01, 7), (0.99, 1)])
def test_as_many_groups_are_seen_in_every_cloud(hidden: float, count: int) -> None:
    seen = seen_groups(torch.rand(5, 8), hidden)
    assert seen.sum(dim=1).tolist() == [count] * 5
    assert set(seen.unique().tolist()) == {0, 1}


def test_chamfer_is_the_distance_of_sets() -> None:
    found, true = torch.rand(6, 5, 3), torch.rand(6, 7, 3)
    expected = 0.0
    for a, b in zip(found.numpy(), true.numpy(), strict=True):
        gaps = ((a[:, None] - b[None]) ** 2).sum(-1)
        expected += (gaps.min(axis=1).mean() + gaps.min(axis=0).mean()) / 6
    assert float(chamfer(found, true)) == pytest.approx(expected, rel=1e-5)
    assert float(chamfer(true, true.flip(1))) == 0


def test_interpolation_keeps_what_is_constant_and_what_is_at_a_centre() -> None:
    at, tokens = clouds(2, 20), torch.rand(2, 20, 4)
    assert interpolated(torch.ones(2, 20, 4), at, clouds(2, 9, seed=5)) == pytest.approx(torch.ones(2, 9, 4))
    assert interpolated(tokens, at, at[:, 3:8]) == pytest.approx(tokens[:, 3:8], abs=1e-3)


def test_gradients_reach_every_scale() -> None:
    model, points, _ = hidden_and_seen()
    model.train()
    model(points, torch.rand(3, TINY.groups[-1]), 0.75).backward()
    unused = {name for name, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0}
    # The finest scale speaks through the next one only; a bias in front of a batch norm is taken off again.
    assert {name for name in unused if not name.endswith("conv.0.bias")} <= {
        "encoder.h_encoder.encoder_norms.0.weight",
        "encoder.h_encoder.encoder_norms.0.bias",
    }


def test_every_cloud_is_seen_once_before_any_comes_again() -> None:
    rows = [row for step in range(10) for row in epoch_rows(20, 6, step, seed=3)]
    for epoch in range(3):
        assert sorted(rows[20 * epoch : 20 * (epoch + 1)]) == list(range(20))
    assert rows[:20] != rows[20:40]


def test_clouds_lie_on_the_surface_in_the_unit_ball(tmp_path: Path, meshes: Path) -> None:
    names = ("box.ply", "angle.ply", "broken.ply")
    held = Clouds(meshes, names, tmp_path / "kept.npy")
    assert held.names == ("box.ply", "angle.ply")
    box = held.draw([0], 500, np.random.default_rng(0))[0]
    sides = np.array([1, 2, 3]) / np.linalg.norm([1, 2, 3])
    assert (np.abs(np.abs(box) - sides).min(axis=1) < 0.02).all()
    assert (np.abs(box) < sides + 0.02).all()
    assert np.array_equal(Clouds(meshes, names, tmp_path / "kept.npy").draw([0], 500, np.random.default_rng(0))[0], box)
    rng = np.random.default_rng(1)
    changed = augmented(np.repeat(box[None], 20, axis=0), rotate=True, stretch=1.5, rng=rng)
    assert np.linalg.norm(changed, axis=2).max(axis=1) == pytest.approx(np.ones(20), abs=1e-5)
    with pytest.raises(TrainingError, match="no mesh"):
        Clouds(meshes, ("broken.ply",), tmp_path / "none.npy")


def test_the_rate_rises_and_falls() -> None:
    options = PretrainOptions(steps=100, rise=0.1, learning_rate=1.0)
    rates = [learning_rate(options, step) for step in range(100)]
    assert rates[:11] == sorted(rates[:11])
    assert rates[10:] == sorted(rates[10:], reverse=True)
    assert max(rates) == 1
    assert rates[-1] < 0.01
    assert learning_rate(PretrainOptions(steps=1, rise=1.0), 0) <= 1e-3


@pytest.mark.slow
def test_the_same_seed_gives_the_same_weights_and_another_does_not(meshes: Path, tmp_path: Path) -> None:
    a, b = run(meshes, tmp_path / "a.safetensors"), run(meshes, tmp_path / "b.safetensors")
    assert a.read_bytes() == b.read_bytes()
    assert curves(a) == curves(b)
    c = run(meshes, tmp_path / "c.safetensors", seed=1)
    assert I2PMAEEncoder.from_checkpoint(a).digest() != I2PMAEEncoder.from_checkpoint(c).digest()


def test_a_stopped_run_goes_on_as_if_it_never_was(meshes: Path, tmp_path: Path) -> None:
    from unittest import mock

    from rlacd.learn.pretrain import run as module

    whole = run(meshes, tmp_path / "whole.safetensors")
    halves = tmp_path / "halves.safetensors"
    learn = module.Pretraining.learn

    def stopped(self: module.Pretraining) -> float:
        if self.step == 7:
            raise KeyboardInterrupt
        return learn(self)

    with mock.patch.object(module.Pretraining, "learn", stopped), pytest.raises(KeyboardInterrupt):
        run(meshes, halves)
    assert not halves.exists()
    with pytest.raises(OptionError, match="holds a run already"):
        run(meshes, halves)
    with pytest.raises(OptionError, match="batch is 5, but was 4"):
        run(meshes, halves, resume=True, batch=5)
    run(meshes, halves, resume=True)
    assert whole.read_bytes() == halves.read_bytes()
    assert curves(whole) == curves(halves)


def blind(kept: Path) -> float:
    """The loss of the best answer that is the same for all groups."""
    points = torch.from_numpy(np.load(kept)[:, :256].copy())
    offsets = MaskedAutoencoder(TINY).encoder.h_encoder.pyramid(points)[-2].offsets
    true = (offsets / offsets.square().sum(-1).mean(dim=(1, 2)).sqrt()[:, None, None, None]).flatten(0, 1)
    answer = torch.randn(true.shape[1:], generator=torch.Generator().manual_seed(0)).requires_grad_()
    optimizer = torch.optim.Adam([answer], lr=0.03)
    for _ in range(300):
        loss = chamfer(answer.expand_as(true), true)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return float(loss.detach())


@pytest.mark.nightly
def test_the_loss_falls(meshes: Path, tmp_path: Path) -> None:
    changes = {"points": 256, "steps": 400, "batch": 8, "rotate": False, "stretch": 1.0}
    out = run(meshes, tmp_path / "w.safetensors", log_every=40, checkpoint_seconds=1e6, **changes)
    losses = [point["loss"] for point in curves(out) if "loss" in point]
    assert losses[-1] < 0.9 * blind(tmp_path / "w.run" / "training.npy")
    assert losses[-1] < losses[4] < losses[0]


@pytest.mark.parametrize(
    ("name", "value"), [("size", "huge"), ("hidden", 1.0), ("batch", 1), ("steps", 0), ("stretch", 0.5)]
)
def test_options_out_of_range_are_reported(name: str, value: Any) -> None:
    with pytest.raises(OptionError, match=f"{name} is"):
        PretrainOptions(**{name: value})


def test_what_cannot_be_done_is_reported(meshes: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"has to end in \.safetensors"):
        run(meshes, tmp_path / "w.pth")
    with pytest.raises(OptionError, match="size small needs at least 256"):
        run(meshes, tmp_path / "w.safetensors", size="small")
    with pytest.raises(TrainingError, match="no folder"):
        run(tmp_path / "nowhere", tmp_path / "w.safetensors")
    (tmp_path / "empty").mkdir()
    with pytest.raises(TrainingError, match="holds 0 meshes"):
        run(tmp_path / "empty", tmp_path / "v.safetensors")


def test_the_command_makes_weights_that_the_encoder_reads(meshes: Path, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    given = [f"--{k.replace('_', '-')}={v}" for k, v in SHORT.items()]
    shown = CliRunner().invoke(app, ["pretrain", str(meshes), "--out", str(out), *given])
    assert shown.exit_code == 0, shown.output
    assert "step 12 of 12  loss" in shown.output
    assert I2PMAEEncoder.from_checkpoint(out).sizes == TINY
    again = CliRunner().invoke(app, ["pretrain", str(meshes), "--out", str(out), *given])
    assert again.exit_code == 2
    assert "--resume" in again.output


def test_the_loss_is_reported_on_held_out_meshes(meshes: Path, tmp_path: Path) -> None:
    out = run(meshes, tmp_path / "w.safetensors")
    assert [point["step"] for point in curves(out) if "validation_loss" in point] == [6, 12]
    listed = json.loads((out.with_suffix(".run") / "meshes.json").read_text())
    assert len(listed["validation"]) == 1
    assert len(listed["training"]) == 4
    assert not set(listed["validation"]) & set(listed["training"])
