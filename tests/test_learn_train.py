"""A training run: exactly repeatable, exactly resumable, exported as it is, and clear about what is wrong."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Container
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from rlacd.errors import OptionError, TrainingError, WeightsError
from rlacd.learn.meshes import list_once
from rlacd.learn.options import TRAIN_PRESETS, TrainOptions
from rlacd.policies import make_policy
from rlacd.policies.network import KIND, load_network
from rlacd.policies.plane_features import FEATURES
from rlacd.pool import Answer, Pool, Request, WorkerDiedError
from rlacd.pool.local import InProcessPool, LocalPool
from rlacd.solid.arrays import Float32Array
from rlacd.solid.component import Component
from tests.learning import small_solids, write_meshes
from tests.pool.obedient import pool_processes

TINY: dict[str, Any] = {
    "env_steps": 120,
    "learning_starts": 30,
    "batch_size": 8,
    "max_faces": 500,
    "environments": 2,
    "validation": 1,
    "validate_every": 60,
    "log_every": 20,
    "target_frequency": 10,
    "max_parts": 12,
    "buffer_size": 50,
    "checkpoint_seconds": 0.0,
}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


def run(
    meshes: Path,
    folder: Path,
    resume: bool = False,
    pool: Pool | None = None,
    say: Callable[[str], None] = lambda line: None,
    **changes: Any,
) -> Path:
    pytest.importorskip("torch", reason="needs the extra train")
    from rlacd.learn.train import train

    return train(meshes, folder, TrainOptions(**{**TINY, **changes}), resume=resume, say=say, pool=pool)


def weights(folder: Path) -> dict[str, bytes]:
    """The complete state, but for the time taken."""
    with np.load(folder / "checkpoint.npz") as arrays:
        return {name: arrays[name].tobytes() for name in arrays.files if name != "state"}


def curves(folder: Path) -> list[dict[str, float]]:
    points = [json.loads(line) for line in (folder / "curves.jsonl").read_text().splitlines()]
    return [{k: v for k, v in point.items() if k not in ("seconds", "steps_per_s")} for point in points]


def assert_same_run(one: Path, other: Path) -> None:
    assert weights(one) == weights(other)
    assert curves(one) == curves(other)
    assert (one / "policy.npz").read_bytes() == (other / "policy.npz").read_bytes()


def test_presets_are_valid_and_the_papers_is_the_papers() -> None:
    for name in TRAIN_PRESETS:
        assert isinstance(TrainOptions.preset(name), TrainOptions)
    paper = TrainOptions.preset("paper")
    assert (paper.threshold, paper.volume_reward, paper.finish_reward) == (0.04, 1000, 1000)
    assert (paper.buffer_size, paper.env_steps, paper.learning_starts) == (100_000, 1_000_000, 10_000)
    assert (paper.epsilon, paper.epsilon_decay, paper.target, paper.rotate) == (0.2, 0.99, "one-step", True)
    assert paper.max_parts >= 512
    assert TrainOptions.preset("returns", seed=3).seed == 3


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"batch_size": 0}, "batch_size is"),
        ({"batch_size": 2.5}, "batch_size is"),
        ({"threshold": float("nan")}, "threshold is"),
        ({"epsilon": 1.1}, "epsilon is"),
        ({"target": "both"}, "target is"),
        ({"rotate": 1}, "rotate is"),
        ({"seed": -1}, "seed is"),
        ({"volume_reward": 0.0, "finish_reward": 0.0}, "both 0; there is nothing to learn"),
        ({"name": "best"}, "preset is 'best'"),
    ],
)
def test_options_out_of_range_and_unknown_ones_are_reported(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(OptionError, match=told):
        TrainOptions.preset(**{"name": "returns", **changes})


def test_without_torch_every_quality_and_both_networks_decompose() -> None:
    code = """
import sys
sys.modules["torch"] = sys.modules["onnxruntime"] = None  # as if they were not installed
import trimesh
import rlacd, rlacd.cli.main
mesh = trimesh.util.concatenate([trimesh.creation.box(size) for size in ((2, 0.4, 0.4), (0.4, 0.4, 2))])
found = [{"quality": "balanced"}, {"quality": "best", "search_steps": 4}]
found += [{"quality": "fast", "policy": policy, "threshold": 0.02} for policy in ("learned", "rl-acd")]
assert all(len(rlacd.decompose(mesh, **options)) > 1 for options in found)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_weights_and_another_does_not(meshes: Path, tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        run(meshes, tmp_path / name, seed=seed, validation=0, env_steps=60)
    assert weights(tmp_path / "a") == weights(tmp_path / "b")
    assert curves(tmp_path / "a") == curves(tmp_path / "b")
    assert weights(tmp_path / "a") != weights(tmp_path / "c")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stop", "changes"),
    [
        (20, {"validate_every": 20}),  # before it learns
        (70, {}),
        (20, {"target": "return", "env_steps": 60, "validate_every": 20}),
    ],
)
def test_a_resumed_run_is_the_run_that_was_never_stopped(
    meshes: Path, tmp_path: Path, stop: int, changes: dict[str, Any]
) -> None:
    run(meshes, tmp_path / "whole", **changes)
    run(meshes, tmp_path / "halves", **{**changes, "env_steps": stop})
    (tmp_path / "halves" / "checkpoint.npz.1.part").write_bytes(b"what a crash left")
    run(meshes, tmp_path / "halves", resume=True, **changes)
    assert_same_run(tmp_path / "whole", tmp_path / "halves")


@pytest.mark.nightly
def test_a_killed_run_resumes_exactly(meshes: Path, tmp_path: Path) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    run(meshes, whole, env_steps=400)
    given = [f"--{k.replace('_', '-')}={v}" for k, v in {**TINY, "env_steps": 400, "jobs": 2}.items()]
    words = ["train", str(meshes), "--run", str(killed), "--preset", "paper"]  # the defaults
    process = subprocess.Popen([sys.executable, "-m", "rlacd", *words, *given], stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not (killed / "policy.npz").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    run(meshes, killed, env_steps=400, resume=True)
    assert_same_run(whole, killed)


@pytest.mark.nightly
def test_where_episodes_are_played_and_a_worker_that_is_killed_change_nothing(meshes: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "alone")
    killed: list[psutil.Process] = []

    def kill_one(line: str) -> None:
        if line.startswith("step") and len(killed) < 2:
            killed.append(pool_processes()[-1])
            killed[-1].kill()

    with LocalPool(2) as pool:
        run(meshes, tmp_path / "disturbed", pool=pool, say=kill_one)
    assert len({process.pid for process in killed}) == 2
    assert_same_run(tmp_path / "alone", tmp_path / "disturbed")


class Doomed(InProcessPool):
    """Of some episodes the process dies every time."""

    def __init__(self, episodes: Container[int]) -> None:
        super().__init__()
        self._episodes = episodes

    def submit(self, request: Request) -> Future[Answer]:
        if request.values["seed"][-1] not in self._episodes:
            return super().submit(request)
        died: Future[Answer] = Future()
        died.set_exception(WorkerDiedError("it took more than 600 s"))
        return died


class Boxes:
    """An encoder of one's own: a component's extents, for all 150 planes at once."""

    dim, outputs, digest = 3, 150, "boxes"

    def describe(self, component: Component) -> Float32Array:
        """Get the extents."""
        extents: Float32Array = np.ptp(component.box, axis=0).astype(np.float32)
        return extents


@pytest.mark.slow
def test_an_encoder_of_ones_own_trains_and_decides(meshes: Path, tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="needs the extra train")
    from rlacd.learn.train import load_policy, train

    options = TrainOptions(**{**TINY, "env_steps": 60})
    with LocalPool(1) as pool:
        train(meshes, tmp_path / "run", options, encoder=Boxes(), pool=pool, say=lambda line: None)
    for kept in ("", "checkpoint.npz", "policy.npz"):
        policy = load_policy(str(tmp_path / "run" / kept), Boxes())
        assert policy.choose(Component(small_solids()["cross"])) is not None
    with pytest.raises(OptionError, match=r"needs an encoder of your own \(boxes\)"):
        load_policy(tmp_path / "run")
    with pytest.raises(WeightsError, match="cannot be read"):
        load_policy(tmp_path)


@pytest.fixture
def sees_points(meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A policy that was trained with a point encoder of the least size."""
    pytest.importorskip("torch", reason="needs the extra train")
    from rlacd.policies import points

    tiny = points.Sizes((32, 16, 8), (8, 4, 4), (12, 24, 48), depth=1, heads=2, embedding=16)
    monkeypatch.setattr(points, "REDUCED", (tiny, 64))
    return run(meshes, tmp_path / "points", encoder="points", env_steps=60)


def test_a_policy_sees_points_as_its_network_did_in_training(sees_points: Path) -> None:
    from rlacd.learn.train import load_policy
    from rlacd.policies.points import PointEncoder

    named, encoder = load_policy(sees_points), PointEncoder.reduced(TrainOptions().seed)
    for solid in map(Component, small_solids().values()):
        assert named.choose(solid) == load_policy(sees_points, encoder).choose(solid)


def changed(content: bytes, **changes: Any) -> bytes:
    """A policy that says other things of its encoder."""
    file = io.BytesIO(content)
    with np.load(file) as arrays:
        held = dict(arrays)
    about = json.loads(held["about"].tobytes())
    about["encoder"].update(changes)
    held["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    file = io.BytesIO()
    np.savez(file, **held)
    return file.getvalue()


def test_damaged_encoders_are_one_sentence(sees_points: Path, tmp_path: Path) -> None:
    sound = sees_points.read_bytes()
    sizes = {"groups": [32, 16, 8], "neighbors": [8, 4, 4], "widths": [12, 24, 48], "depth": 1, "heads": 2}
    for i, changes in enumerate(
        (
            {"digest": "another"},
            {"points": 3},
            {"points": "many"},
            {"sizes": sizes},
            {"sizes": {**sizes, "embedding": 10**9}},
            {"sizes": {**sizes, "embedding": 16, "neighbors": [65, 4, 4]}},
            {"sizes": {**sizes, "embedding": 16, "heads": 5}},
        )
    ):
        (tmp_path / f"{i}.npz").write_bytes(changed(sound, **changes))
        with pytest.raises(WeightsError, match=r"is damaged or not a network of rlacd; train or fetch it again\.$"):
            make_policy(str(tmp_path / f"{i}.npz"))


def test_without_torch_a_policy_that_sees_points_says_what_to_install(meshes: Path, sees_points: Path) -> None:
    code = """
import sys
sys.modules["torch"] = None  # as if it were not installed
import rlacd.cli.main
sys.exit(rlacd.cli.main.app(["decompose", *sys.argv[1:]], standalone_mode=False))
"""
    words = [sys.executable, "-c", code, str(meshes / "cross.ply"), "--policy", str(sees_points)]
    said = subprocess.run(words, capture_output=True, text=True, check=False)
    assert said.returncode != 0
    assert "pip install 'rlacd[train] @ git+https://github.com/rlacd/rlacd'" in " ".join(said.stderr.split())
    assert "Traceback" not in said.stderr


@pytest.mark.slow
def test_an_episode_that_no_worker_can_play_is_reported_and_left_out(meshes: Path, tmp_path: Path) -> None:
    said: list[str] = []
    for name in ("a", "b"):
        run(meshes, tmp_path / name, pool=Doomed({1, 4}), say=said.append, validation=0)
    assert sum("episode 1, " in line and "left out: it took more than 600 s" in line for line in said) == 2
    assert sum(point.get("ended_lost", 0) for point in curves(tmp_path / "a")) == 2
    assert weights(tmp_path / "a") == weights(tmp_path / "b")


def test_when_no_process_can_play_that_is_one_clear_error(meshes: Path, tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"10 episodes in a row were lost.*--memory"):
        run(meshes, tmp_path / "run", pool=Doomed(range(5, 10**6)), validation=0)


@pytest.mark.slow
def test_solids_without_anything_to_cut_are_one_clear_error(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rlacd.learn.rollouts.SOLIDS_TRIED", 100)
    for path in meshes.rglob("*.ply"):
        if path.stem not in ("box", "broken"):
            path.unlink()
    with pytest.raises(TrainingError, match="none of 100 solids drawn from 1 meshes needs a cut"):
        run(meshes, tmp_path / "run", validation=0)


@pytest.mark.slow
def test_a_run_ends_with_a_policy_that_decomposes_and_a_verdict(meshes: Path, tmp_path: Path) -> None:
    said: list[str] = []
    path = run(meshes, tmp_path / "run", say=said.append)
    from rlacd.criteria import Concavity
    from rlacd.cut import CutTree
    from rlacd.learn.train import load_policy
    from rlacd.run import Run

    assert "the first 30 of 120 cuts are random" in said[1]
    assert "times greedy's parts" in said[-1]
    policy, solid = make_policy(str(path), scale=0.04), Component(small_solids()["cross"])
    assert load_policy(tmp_path / "run", shortlist=10, reflex_edges=4).choose(solid) == policy.choose(solid)
    with Run(1) as alone:
        done, left = CutTree(solid, policy, alone).cut_until(Concavity(0.04))
    # Planes of concave edges are asked too, and the least hull sum finds them: no volume is left to save.
    assert sum(c.hull.volume for c in done) == pytest.approx(solid.volume)
    assert 3 <= len(done) <= 4
    assert left == []


def test_a_run_is_not_overwritten_and_not_resumed_with_other_options(meshes: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", env_steps=40, validation=0)
    with pytest.raises(OptionError, match="holds a run already"):
        run(meshes, tmp_path / "run", validation=0)
    with pytest.raises(OptionError, match="batch_size is 9, but was 8"):
        run(meshes, tmp_path / "run", resume=True, batch_size=9, validation=0)


def test_damaged_checkpoints_and_folders_without_meshes_are_reported(meshes: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", env_steps=40, validation=0)
    broken = tmp_path / "run" / "checkpoint.npz"
    broken.write_bytes(broken.read_bytes()[:1000])
    with pytest.raises(TrainingError, match="is damaged"):
        run(meshes, tmp_path / "run", resume=True, validation=0)
    (tmp_path / "empty").mkdir()
    with pytest.raises(TrainingError, match="holds no meshes to learn on"):
        run(tmp_path / "empty", tmp_path / "other")
    with pytest.raises(TrainingError, match="there is no folder"):
        run(tmp_path / "nowhere", tmp_path / "another")


def test_a_maker_is_held_out_and_small_folders_are_learned_from(meshes: Path, tmp_path: Path) -> None:
    def split(name: str, *how: Any) -> tuple[set[str], set[str]]:
        found = list_once(meshes, tmp_path / name, *how)
        assert json.loads((tmp_path / name / "meshes.json").read_text())["unreadable"] == 1
        return set(found.training), set(found.validation)

    every = {path.relative_to(meshes).as_posix() for path in meshes.rglob("*.ply")} - {"broken.ply"}
    assert split("maker", 500, 16, "deeper", 0) == (every - {"deeper/table.ply"}, {"deeper/table.ply"})
    learned, held_out = split("all", 500, 16, "", 0)
    assert (learned | held_out, len(held_out)) == (every, len(every) // 2)
    assert split("small", 12, 0, "", 0) == ({"box.ply"}, set())
    for folder in ("deep", "nowhere"):
        with pytest.raises(TrainingError, match=f"holds no meshes in {folder} to hold out"):
            split(folder, 500, 16, folder, 0)


def test_a_policy_that_is_written_again_is_read_again(meshes: Path, tmp_path: Path) -> None:
    one, other = (run(meshes, tmp_path / str(seed), seed=seed, validation=0, env_steps=40) for seed in (0, 1))
    read = load_network(one, KIND, FEATURES, 1)
    assert load_network(one, KIND, FEATURES, 1) is read
    shutil.copy(other, one)
    assert load_network(one, KIND, FEATURES, 1).to_bytes() == other.read_bytes() != read.to_bytes()


def test_another_folder_of_meshes_is_refused_at_once_and_does_no_harm(meshes: Path, tmp_path: Path) -> None:
    run(meshes, tmp_path / "run", env_steps=40)
    shutil.rmtree(tmp_path / "run" / "solids")
    (tmp_path / "empty").mkdir()
    with pytest.raises(TrainingError, match=r"lacks .*, which the run began with; give the same folder"):
        run(tmp_path / "empty", tmp_path / "run", resume=True)
    with pytest.raises(TrainingError, match="there is no folder"):
        run(tmp_path / "nowhere", tmp_path / "run", resume=True)
    run(meshes, tmp_path / "run", resume=True)
    run(meshes, tmp_path / "whole")
    assert weights(tmp_path / "run") == weights(tmp_path / "whole")
