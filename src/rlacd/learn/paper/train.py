"""RL-ACD's training, from top to bottom as in the paper: cut, store, and learn from the children of each cut.

Deep soft Q-learning on the dual-state Bellman equation (`rlacd.learn.paper.loss`), with components as states
(`rlacd.learn.paper.mdp`). A pool of processes plays episodes (`rlacd.learn.paper.rollouts`), and this process learns
from them. On CPU the same meshes, options and seed give the same weights bit for bit, wherever episodes are played and
whether or not the run was interrupted: a checkpoint holds the complete state.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save as save_tensors

from rlacd.criteria import Concavity
from rlacd.errors import OptionError, TrainingError
from rlacd.fields import require_same
from rlacd.learn.checkpoint import Checkpoint, adam_state, load_checkpoint, restore_adam, save_checkpoint
from rlacd.learn.curves import Curves
from rlacd.learn.device import pick_device
from rlacd.learn.encoders import AnyEncoder, I2PMAEEncoder, make_encoder
from rlacd.learn.meshes import MeshList, Solids, list_once
from rlacd.learn.paper.export import export_policy
from rlacd.learn.paper.loss import bellman_loss, cost_loss, dual_state_target, soft_value
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.learn.paper.record import Record, whole_returns
from rlacd.learn.paper.replay import Replay
from rlacd.learn.paper.rollouts import Acting, Rollouts
from rlacd.learn.paper.torch_policy import torch_policy
from rlacd.learn.parts import Score, count_parts
from rlacd.policies import Greedy
from rlacd.policies.observe import SCALE_INPUTS
from rlacd.pool import InProcessPool, Pool, ProcessLimits, Shared

Say = Callable[[str], None]

MOST_PARTS = 64
"""Maximum number of parts of a solid in validation: early in training some policies never finish."""


def train(
    meshes: Path,
    run: Path,
    options: TrainOptions,
    *,
    resume: bool = False,
    say: Say = print,
    pool: Pool | None = None,
    limits: ProcessLimits | None = None,
) -> Path:
    """Train a Q network on a folder of meshes.

    Parameters
    ----------
    meshes : Path
        Folder of mesh files, searched to any depth.
    run : Path
        Folder for the curves (``curves.jsonl``, ``tensorboard/``), the checkpoint and the exported policy.
    options : TrainOptions
    resume : bool
        Continue exactly from the checkpoint in `run`; without one, start afresh.
    say : callable
        Receives lines of progress.
    pool : Pool, optional
        Where episodes are played; in this process by default. It affects only the time taken.
    limits : Limits, optional
        Limits of one episode.

    Returns
    -------
    Path
        The exported policy, ``run/policy.onnx``.

    Raises
    ------
    OptionError
        `run` holds another run, or the options do not match the run to be resumed.
    TrainingError
        There are no usable meshes, the checkpoint is damaged, or episodes cannot be played.
    """
    torch.set_num_threads(options.threads)
    checkpoint = load_checkpoint(run / "checkpoint")
    if checkpoint is not None and not resume:
        raise OptionError(f"{run} holds a run already; use --resume to go on with it, or another folder.")
    encoder = _encoder(options)
    listed = list_once(meshes, run, options.max_faces, options.validation, options.seed)
    if not (run / "options.json").exists():
        (run / "options.json").write_text(json.dumps(dataclasses.asdict(options), indent=1), encoding="utf-8")
    say(
        f"{len(listed.training)} meshes to learn on, {len(listed.validation)} to validate with; "
        f"{listed.unreadable} cannot be read, {listed.too_large} are too large"
    )
    with ExitStack() as stack:
        where, solids = pool or stack.enter_context(InProcessPool()), Solids(meshes, run / "solids")
        rollouts = Rollouts(where, solids, listed.training, options, limits or ProcessLimits(), say)
        training = Training(run, options, listed, encoder, solids, rollouts, say)
        stack.callback(training.close)
        if checkpoint is None:
            training.begin()
        else:
            training.restore(checkpoint)
            say(f"resuming at cut {training.cuts}")
        training.run()
        return training.export()


class Training:
    """The state of a run, and the loop."""

    def __init__(
        self,
        run: Path,
        options: TrainOptions,
        listed: MeshList,
        encoder: AnyEncoder,
        solids: Solids,
        rollouts: Rollouts,
        say: Say,
    ) -> None:
        self.options = options
        self.folder = run
        self.say = say
        self.device = pick_device(options.device)
        self.encoder = encoder
        self.inputs = self.encoder.dim + (SCALE_INPUTS if options.scale_input else 0)
        torch.manual_seed(options.seed)
        self.network = QNetwork.of(self.inputs, options).to(self.device)
        self.target = QNetwork.of(self.inputs, options).to(self.device)
        self.target.copy_from(self.network)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=options.learning_rate, fused=True)
        self.replay = Replay(options.replay, self.inputs, self.network.outputs)
        self.rng = np.random.default_rng([options.seed, 0])
        self.solids = solids
        self.rollouts = rollouts
        self.listed = listed
        self.cuts = 0
        self.learned = 0
        self.seconds = 0.0
        self.sums: dict[str, float] = {}
        self.best = np.inf
        self.baseline: Score | None = None
        self.shown: tuple[int, Shared] | None = None  # number of steps and weights of the network last shared
        self.curves = Curves(run)

    # The algorithm

    def run(self) -> None:
        """Play episodes and learn from them until the last iteration."""
        options, started, saved, before = self.options, time.perf_counter(), time.perf_counter(), self.seconds
        while self.cuts < options.iterations:
            self.rollouts.begin(self.acting())
            cuts_before = self.cuts
            self.learn_from(self.rollouts.take())
            self.seconds = before + time.perf_counter() - started
            if self._passed(cuts_before, options.log_every):
                self.log()
            if self.listed.validation and self._passed(cuts_before, options.validate_every):
                self.validate()
            if time.perf_counter() - saved >= options.checkpoint_seconds:
                self.save()
                saved = time.perf_counter()
        self.save()

    def acting(self) -> Acting:
        """Return how new episodes are played: at random at first, then by the current network."""
        options = self.options
        if self.cuts < options.warmup:
            return Acting(None, 1.0)
        if self.shown is None or self.shown[0] != self.learned:
            weights = {name: tensor.detach().cpu().contiguous() for name, tensor in self.network.state_dict().items()}
            self.shown = (self.learned, Shared({"weights": save_tensors(weights)}))
        epsilon = options.epsilon * options.epsilon_decay ** ((self.cuts - options.warmup) // 1000)
        return Acting(self.shown[1], epsilon)

    def learn_from(self, record: Record) -> None:
        """Add an episode to the replay buffer cut by cut, and learn after each."""
        rows, options = self._keep(record), self.options
        cuts = record.transitions(options.static_discount if options.discount == "static" else None)
        rewards = [record.reward(k).worth(options) for k in range(record.cuts)]
        targets = list(zip(rewards, [cut.children for cut in cuts], strict=True))
        if options.returns == "monte-carlo":
            targets = whole_returns(cuts, rewards)
        for k, (cut, (gained, children)) in enumerate(zip(cuts, targets, strict=True)):
            left = [rows[child] for child in children]
            self.replay.add(rows[cut.state], int(record.planes[k]), gained, left, list(children.values()))
            self._add("reward", rewards[k])
            if np.isfinite(record.values[k]):
                self._add("value", float(record.values[k]))
            self.cuts += 1
            if self.cuts > self.options.warmup and self.cuts % self.options.learn_every == 0:
                self.learn()
        for row in rows:
            self.replay.release(row)
        if record.cuts:
            self._add("episode_parts", float(record.parts))
        self._add(f"ended_{record.how}", 1.0)

    def learn(self) -> None:
        """Take a gradient step on the dual-state Bellman loss of one batch."""
        options = self.options
        batch = self.replay.sample(options.batch, self.rng)
        with torch.no_grad():
            q = self.target(self._tensor(batch.child_features))
            values = soft_value(q, self._tensor(batch.child_masks), options.temperature)
            target = dual_state_target(
                self._tensor(batch.rewards), values, self._tensor(batch.child_discounts), self._tensor(batch.owner)
            )
        q = self.network(self._tensor(batch.features))
        planes = self._tensor(batch.planes)
        loss = cost_loss(q[:, 0], target) if self.network.costs else bellman_loss(q, planes, target, options.unit)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.learned += 1
        if self.learned % options.target_every == 0:
            self.target.copy_from(self.network)
        self._add("loss", float(loss.detach()))
        self._add("target", float(target.mean()))

    # Logging and validation

    def log(self) -> None:
        """Append a point to the curves: means since the last one."""
        counts = {name[2:]: n for name, n in self.sums.items() if name.startswith("n ")}
        means = {name: self.sums[name] / n for name, n in counts.items() if not name.startswith("ended_")}
        means |= {name: self.sums[name] for name in counts if name.startswith("ended_")}
        self.sums = {}
        self.curves.add(self.cuts, {**means, "replay": len(self.replay)}, self.seconds)
        self.say(f"cut {self.cuts}  " + "  ".join(f"{k} {v:.4g}" for k, v in means.items()) + f"  {self.seconds:.0f} s")

    def validate(self) -> None:
        """Count the parts of the held-out solids; the network with the fewest after merging is kept as the best."""
        criterion = Concavity(self.options.threshold)
        solids = [s for name in self.listed.validation if (s := self.solids.get(name)) is not None]
        if not solids:
            raise TrainingError("none of the meshes held out for validation can be repaired; hold out more.")
        if self.baseline is None:
            self.baseline = count_parts(Greedy("hull-sum"), solids, criterion, MOST_PARTS)
        score = count_parts(torch_policy(self.network, self.encoder, self.options), solids, criterion, MOST_PARTS)
        values = score.against(self.baseline)
        if not self.options.lookahead:
            short = torch_policy(self.network, self.encoder, self.options, shortlist=10)
            deployed = count_parts(short, solids, criterion, MOST_PARTS).against(self.baseline)
            values |= {f"deployed_{k}": v for k, v in deployed.items()}
        self.curves.add(self.cuts, {f"validation_{k}": v for k, v in values.items()}, self.seconds)
        self.say(f"cut {self.cuts}  validation: " + "  ".join(f"{k} {v:.3f}" for k, v in values.items()))
        if values["merged_ratio"] <= self.best:
            self.best = values["merged_ratio"]
            self._save_weights("best.safetensors")

    # Start, checkpoint, resume, finish

    def begin(self) -> None:
        """Initialise a new run."""
        self.curves.restart(0)

    def save(self) -> None:
        """Write a checkpoint."""
        weights = {f"network.{k}": v for k, v in self.network.state_dict().items()}
        weights |= {f"target.{k}": v for k, v in self.target.state_dict().items()}
        weights |= adam_state(self.optimizer)
        state = {
            "options": dataclasses.asdict(self.options),
            "encoder": _digest(self.encoder),
            "cuts": self.cuts,
            "learned": self.learned,
            "seconds": self.seconds,
            "sums": self.sums,
            "best": self.best,
            "baseline": None if self.baseline is None else dataclasses.asdict(self.baseline),
            "generator": self.rng.bit_generator.state,
        }
        checkpoint = Checkpoint(weights, self.replay.state(), state, self.rollouts.state())
        save_checkpoint(self.folder / "checkpoint", checkpoint)

    def restore(self, checkpoint: Checkpoint) -> None:
        """Restore a checkpoint."""
        state = checkpoint.state
        require_same(state["options"], self.options, MAY_CHANGE)
        if state.get("encoder", "") != _digest(self.encoder):
            raise OptionError(
                f"{self.options.encoder_weights} holds other weights than the run began with; give the same "
                "--encoder-weights, or begin another run."
            )
        for name, network in (("network.", self.network), ("target.", self.target)):
            network.load_state_dict({k[len(name) :]: v for k, v in checkpoint.weights.items() if k.startswith(name)})
        restore_adam(self.optimizer, checkpoint.weights)
        self.replay.restore(checkpoint.replay)
        self.cuts, self.learned, self.seconds = state["cuts"], state["learned"], state["seconds"]
        self.sums, self.best = dict(state["sums"]), state["best"]
        self.baseline = None if state["baseline"] is None else Score(**state["baseline"])
        self.rng.bit_generator.state = state["generator"]
        self.rollouts.restore(checkpoint.rollouts)
        self.curves.restart(self.cuts)

    def export(self) -> Path:
        """Export the best network, or the current one if none was validated; of lookahead, only the weights."""
        from safetensors.torch import load_file

        best = self.folder / "best.safetensors"
        if not best.exists():
            self._save_weights("best.safetensors")
        if self.options.lookahead:
            return best
        network = QNetwork.of(self.inputs, self.options)
        network.load_state_dict(load_file(best))
        return export_policy(self.folder / "policy.onnx", self.encoder, network, self.options)

    def close(self) -> None:
        """Close the curves."""
        self.curves.close()

    def _keep(self, record: Record) -> list[int]:
        """Rows in the replay buffer of all components of an episode, in the order of the record."""
        return [self.replay.add_component(*seen) for seen in zip(record.features, record.masks, strict=True)]

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(array).to(self.device)

    def _add(self, name: str, value: float) -> None:
        self.sums[name] = self.sums.get(name, 0.0) + value
        self.sums[f"n {name}"] = self.sums.get(f"n {name}", 0) + 1

    def _passed(self, before: int, every: int) -> bool:
        return self.cuts // every > before // every

    def _save_weights(self, name: str) -> None:
        from safetensors.torch import save_file

        partial = self.folder / (name + ".new")
        save_file({k: v.detach().cpu().contiguous() for k, v in self.network.state_dict().items()}, partial)
        partial.replace(self.folder / name)


MAY_CHANGE = frozenset(
    {
        "iterations",
        "checkpoint_seconds",
        "log_every",
        "validate_every",
        "device",
        "threads",
        "encoder_weights",
    }
)
"""Options that may change when a run is resumed: its length, its logging, its place and files."""


def _encoder(options: TrainOptions) -> AnyEncoder:
    encoder = make_encoder(options.encoder, options.encoder_weights, pick_device(options.device))
    if isinstance(encoder, I2PMAEEncoder):
        encoder.require_points(options.points)
    return encoder


def _digest(encoder: AnyEncoder) -> str:
    """Identify an encoder's weights; encoders without a weights file always have the same."""
    return encoder.digest() if isinstance(encoder, I2PMAEEncoder) else ""


__all__: Sequence[str] = ("Training", "train")
