"""The I2P-MAE encoder: the official features to the digit, clear words about unusable files, and training with it."""

from __future__ import annotations

import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rlacd.errors import OptionError, WeightsError

pytest.importorskip("torch", reason="needs the extra train")

import torch
from benchmarks.learned.i2p_mae import published_network

from rlacd.learn.dqn import pick_device, q_network
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import train
from rlacd.policies.plane_features import PLANES
from rlacd.policies.points import PointEncoder, PointNetwork, Sizes
from rlacd.solid.component import Component
from tests.learning import small_solids, write_meshes
from tests.scripts import script
from tests.test_learn_train import TINY as TINY_RUN

pytestmark = pytest.mark.nightly


TINY = Sizes((32, 16, 8), (8, 4, 4), (12, 24, 48), depth=1, heads=2, embedding=16)


def clouds(count: int, points: int = 128, seed: int = 0) -> torch.Tensor:
    """Clouds [count, points, 3] in the unit ball, each of another shape."""
    rng = np.random.default_rng(seed)
    found = rng.standard_normal((count, points, 3)) * rng.uniform(0.2, 1, (count, 1, 3))
    found /= np.linalg.norm(found, axis=2).max(axis=1)[:, None, None]
    return torch.from_numpy(found.astype(np.float32))


def tiny_encoder(seed: int = 0) -> PointNetwork:
    """An encoder of the least size whose batch norms are no identities."""
    torch.manual_seed(seed)
    encoder = PointNetwork(TINY)
    for name, value in encoder.state_dict().items():
        if name.endswith("running_var"):
            value.uniform_(0.5, 1.5)
        elif name.endswith("running_mean"):
            value.normal_(0, 0.1)
    return encoder


@pytest.fixture(scope="session")
def reference() -> Path:
    """The folder of official features: $RLACD_I2P_MAE, or ../shared/i2p_mae beside the checkout."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "i2p_mae"
    folder = Path(os.environ.get("RLACD_I2P_MAE", beside))
    if not (folder / "reference_features.npz").is_file():
        pytest.skip(f"no reference of the official encoder at {folder} (set RLACD_I2P_MAE)")
    return folder


@pytest.fixture(scope="session")
def stand_in(reference: Path) -> dict[str, torch.Tensor]:
    """Weights of the published names and shapes."""
    module = script(reference / "stand_in_weights.py")
    shapes = json.loads((reference / "parameter_shapes.json").read_text())
    state = module.stand_in_state({name: tuple(shape) for name, shape in shapes.items()})
    return {name: torch.from_numpy(np.asarray(value)) for name, value in state.items()}


def published(state: dict[str, torch.Tensor], path: Path) -> Path:
    """A checkpoint as it is published: wrapped, prefixed, and with more in it than the encoder."""
    held = {f"module.{name}": value for name, value in state.items()} | {"module.h_decoder.0.bias": torch.zeros(3)}
    torch.save({"base_model": held, "epoch": 300, "metrics": {"acc": np.float64(92.3)}}, path)
    return path


@pytest.fixture(scope="session")
def official(stand_in: dict[str, torch.Tensor], tmp_path_factory: pytest.TempPathFactory) -> PointNetwork:
    return published_network(published(stand_in, tmp_path_factory.mktemp("weights") / "i2p_mae.pth"))


@pytest.fixture(scope="session")
def features(reference: Path) -> tuple[torch.Tensor, np.ndarray]:
    with np.load(reference / "reference_features.npz") as held:
        return torch.from_numpy(held["points"]), held["features"]


def test_features_are_those_of_the_official_code(
    official: PointNetwork, features: tuple[torch.Tensor, np.ndarray]
) -> None:
    points, expected = features
    with torch.inference_mode():
        assert np.abs(official.features(points).numpy() - expected).max() < 1e-4
        for i in range(len(points)):
            assert np.abs(official.features(points[i : i + 1]).numpy() - expected[i]).max() < 1e-4


# As an encoder of components


def test_features_ignore_size_and_place_and_are_the_same_each_time() -> None:
    encoder = PointEncoder(tiny_encoder(), 512)
    solid = small_solids()["table"]
    one = encoder.describe(Component(solid))
    moved = encoder.describe(Component(solid.scale([0.25] * 3).translate([0.5, -0.25, 2])))
    assert one.shape == (encoder.dim,)
    assert one == pytest.approx(moved, abs=0.05)
    assert np.abs(encoder.describe(Component(small_solids()["angle"])) - one).max() > 0.2
    assert np.array_equal(encoder.describe(Component(solid)), one)


# Files


def test_files_of_weights_that_lack_something_or_are_something_else_are_one_error(tmp_path: Path) -> None:
    path, tiny, full = tmp_path / "weights.pth", dict(tiny_encoder().state_dict()), dict(PointNetwork().state_dict())
    names = list(full)
    first = r"h_encoder\.token_embed\.0\.first_conv\.0\.weight"
    for state, says in (
        ({name: full[name] for name in names[:40] + names[43:]}, f"{names[40]} is missing"),
        (tiny, r"first_conv\.0\.weight has shape \[8, 3, 1\], not \[128, 3, 1\]"),
        ({**full, names[40]: full[names[40]] + torch.nan}, f"{names[40]} holds values that are not finite"),
    ):
        with pytest.raises(WeightsError, match=says):
            published_network(published(state, path))
    whole = published(tiny, path).read_bytes()
    for content, says in ((b"", first), (whole[:-100], first), (pickle.dumps([1, 2]), "not a file of weights")):
        path.write_bytes(content)
        with pytest.raises(WeightsError, match=says):
            published_network(path)
    with pytest.raises(WeightsError, match="there is no file"):
        published_network(tmp_path / "nowhere.pth")


class Harmful:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (Path.touch, (self.path,))


def test_nothing_in_a_checkpoint_is_run(tmp_path: Path) -> None:
    torch.save(
        {"base_model": dict(tiny_encoder().state_dict()), "extra": Harmful(tmp_path / "ran")}, tmp_path / "w.pth"
    )
    with pytest.raises(WeightsError, match="not a file of weights"):
        published_network(tmp_path / "w.pth")
    assert not (tmp_path / "ran").exists()


# Training: from a file of weights to a policy


SHORT: dict[str, Any] = {**TINY_RUN, "env_steps": 60, "learning_starts": 20, "validate_every": 30}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


def run(meshes: Path, folder: Path, seed: int = 0, points: int = 64, resume: bool = False, **changes: Any) -> Path:
    encoder, options = PointEncoder(tiny_encoder(seed), points), TrainOptions(**{**SHORT, **changes})
    return train(meshes, folder, options, resume=resume, encoder=encoder, say=lambda line: None)


def test_other_weights_do_not_go_on_with_a_run(meshes: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", env_steps=30, validation=0)
    with pytest.raises(OptionError, match="has other weights than the run began with"):
        run(meshes, tmp_path / "run", seed=1, resume=True, validation=0)


def test_too_few_points_are_reported_before_a_run_begins(meshes: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="16 points; this encoder needs at least 32"):
        run(meshes, tmp_path / "run", points=16)


def test_the_papers_network_sees_what_the_paper_sees() -> None:
    network = q_network(PointNetwork().dim, PLANES)
    widths = [layer.out_features for layer in network.modules() if isinstance(layer, torch.nn.Linear)]
    assert widths == [1024, 512, 256, 128, 150]
    assert next(network.parameters()).shape == (1024, 384 + 384)


def test_a_gpu_is_taken_where_it_pays_or_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    taken = {
        (name, large)
        for name in ("auto", "cpu", "cuda")
        for large in (False, True)
        if pick_device(name, large).type == "cuda"
    }
    assert taken == {("auto", True), ("cuda", False), ("cuda", True)}
