"""RL-ACD's training (the paper's 3.5 and 4.1), from top to bottom: cut, store, learn from the children of each cut.

A pool of processes plays episodes (`rlacd.learn.rollouts`), and this process learns from them. On CPU the same meshes,
options and seed give the same weights bit for bit, wherever episodes are played and whether or not the run was
interrupted: a checkpoint holds the complete state. The options, and the command of each published result:
`rlacd.learn.options`.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.errors import OptionError, TrainingError
from rlacd.io.write.atomic import write_file
from rlacd.learn.checkpoint import adam_state, load_checkpoint, restore_adam, save_checkpoint, tensors
from rlacd.learn.encoders import Encoder, make_encoder, pick_device
from rlacd.learn.episodes import Episode
from rlacd.learn.meshes import MeshList, Solids, list_once
from rlacd.learn.options import TrainOptions
from rlacd.learn.q_network import QNetwork, bellman_loss, dual_state_target, policy_of, soft_value
from rlacd.learn.replay import Replay, Transition
from rlacd.learn.rollouts import Rollouts
from rlacd.policies import Policy, make_policy
from rlacd.policies.greedy import RandomShortlist
from rlacd.policies.network import KIND, SHORTLIST
from rlacd.pool import Pool, ProcessLimits, Shared
from rlacd.pool.local import InProcessPool
from rlacd.run import Run

LEAST_EXCESS = 1e-6
"""Share of the solid's hull: components with less excess have the same unit."""


def train(
    meshes: Path,
    run: Path,
    options: TrainOptions,
    *,
    resume: bool = False,
    say: Callable[[str], None] = print,
    pool: Pool | None = None,
    limits: ProcessLimits | None = None,
) -> Path:
    """Train a Q network on a folder of meshes.

    Parameters
    ----------
    meshes : Path
        Folder of mesh files, searched to any depth.
    run : Path
        Folder for ``curves.jsonl``, the checkpoint and the policy.
    options : TrainOptions
    resume : bool
        Continue exactly from the checkpoint in `run`; without one, start afresh.
    say : callable
        Receives lines of progress.
    pool : Pool, optional
        Where episodes are played; in this process by default. It affects only the time taken.
    limits : ProcessLimits, optional
        Limits of one episode.

    Returns
    -------
    Path
        The best network so far, ``run/policy.npz``.

    Raises
    ------
    OptionError
        `run` holds another run, or the options do not match the run to be resumed.
    TrainingError
        There are no usable meshes, the checkpoint is damaged, or episodes cannot be played.
    """
    torch.set_num_threads(options.threads)
    if (run / "checkpoint.npz").exists() and not resume:
        raise OptionError(f"{run} holds a run already; use --resume to go on with it, or another folder.")
    listed = list_once(meshes, run, options.max_faces, options.validation, options.seed)
    write_file(run / "options.json", json.dumps(dataclasses.asdict(options), indent=1).encode())
    left_out = f"{listed.unreadable} cannot be read, {listed.too_large} are too large"
    say(f"{len(listed.training)} meshes to learn from, {len(listed.validation)} to validate with; {left_out}")
    with ExitStack() as stack:
        where, solids = pool or stack.enter_context(InProcessPool()), Solids(meshes, run / "solids")
        rollouts = Rollouts(where, solids, listed.training, options, limits or ProcessLimits(), say)
        training = Training(run, options, rollouts, Validation(listed, solids, options), say)
        training.restore()
        training.run()
    return run / "policy.npz"


class Training:
    """The state of a run, and the loop."""

    def __init__(
        self,
        folder: Path,
        options: TrainOptions,
        rollouts: Rollouts,
        validation: Validation,
        say: Callable[[str], None],
    ) -> None:
        self.folder, self.options, self.rollouts, self.validation, self.say = folder, options, rollouts, validation, say
        self.encoder = make_encoder(options)
        self.device = pick_device(options)
        torch.manual_seed(options.seed)
        self.network, self.target = (
            QNetwork(self.encoder.dim, self.encoder.outputs, options.networks).to(self.device) for _ in range(2)
        )
        self.target.load_state_dict(self.network.state_dict())
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=options.learning_rate, fused=True)
        self.replay = Replay(
            options.buffer_size, options.max_parts, options.objective == "rewards" and options.n_step != 0
        )
        self.rng = np.random.default_rng([options.seed, 0])
        self.cuts = self.learned = 0
        self.best = np.inf
        self.seconds = 0.0
        self.seen: dict[str, list[float]] = {}  # since the last point of the curves

    # The algorithm

    def run(self) -> None:
        """Play episodes and learn from them until the last iteration."""
        options, saved, before = self.options, time.perf_counter(), time.perf_counter() - self.seconds
        while self.cuts < options.env_steps:
            cuts = self.cuts
            self.rollouts.begin(*self.acting())
            self.learn_from(self.rollouts.take())
            self.seconds = time.perf_counter() - before
            if self.cuts // options.log_every > cuts // options.log_every:
                self.log()
            if self.cuts // options.validate_every > cuts // options.validate_every:
                self.validate()
            if time.perf_counter() - saved >= options.checkpoint_seconds:
                self.save()
                saved = time.perf_counter()
        if not np.isfinite(self.best):
            self.validate()
        self.save()
        self.say(self.validation.verdict(self.best, self.folder, options))

    def acting(self) -> tuple[Shared | None, float]:
        """How new episodes are played (4.1): at random at first, then epsilon-greedily; see `Rollouts.begin`."""
        if self.cuts < self.options.learning_starts:
            return None, 1.0
        thousands = (self.cuts - self.options.learning_starts) // 1000
        network = Shared({"network": self.playing.plain({"threshold": 1.0}).to_bytes()})
        return network, self.options.epsilon * self.options.epsilon_decay**thousands

    @property
    def playing(self) -> QNetwork:
        """The network that plays and is validated: the average, if there is one."""
        return self.target if self.options.tau else self.network

    def learn_from(self, episode: Episode) -> None:
        """Add an episode to the replay buffer cut by cut, and learn after each."""
        seen = [self.replay.seen(*pair) for pair in zip(episode.features, episode.masks, strict=True)]
        rewards, leaves = episode.returns(1 if self.options.objective == "fewest-cuts" else self.options.n_step)
        excess = episode.excess.tolist()
        left = [tuple((seen[child], d, excess[child]) for child, d in children.items()) for children in leaves]
        cuts = list(zip(episode.state.tolist(), episode.planes.tolist(), rewards.tolist(), left, strict=True))
        if self.options.objective == "fewest-cuts":
            self.replay.count([(seen[state], children) for state, _, _, children in cuts])
        for state, plane, reward, children in cuts:
            features = episode.features[state] if self.encoder.outputs > 1 else episode.features[state, plane]
            self.replay.add(Transition(seen[state], plane, features.copy(), reward, children, excess[state]))
            self.cuts += 1
            if self.cuts > self.options.learning_starts and self.cuts % self.options.train_frequency == 0:
                self.learn()
        if len(episode.planes):
            self._add(reward=float(episode.rewards.mean()), parts=float(episode.parts))
        self._add(**{f"ended_{episode.ended}": 1.0})

    def learn(self) -> None:
        """Take a gradient step on one batch: the dual-state Bellman loss (eq. 8), or that to the fewest cuts seen."""
        options, batch = self.options, self.replay.sample(self.options.batch_size, self.rng)
        tensor = {name: torch.from_numpy(array).to(self.device) for name, array in batch.items()}
        target = self.targets(tensor) if options.objective == "rewards" else -tensor["cuts"].log()
        loss = bellman_loss(self.network(tensor["features"]), tensor["planes"], target, options.huber)
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.learned += 1
        if options.tau:
            with torch.no_grad():
                for mean, new in zip(self.target.parameters(), self.network.parameters(), strict=True):
                    mean.lerp_(new, options.tau)
        elif self.learned % options.target_frequency == 0:
            self.target.load_state_dict(self.network.state_dict())
        self._add(loss=float(loss.detach()), target=float(target.mean()))

    @torch.no_grad()
    def targets(self, batch: Mapping[str, Tensor]) -> Tensor:
        """Right-hand side of eq. 8 [B], in the unit of each component's values."""
        options, most = self.options, self.options.volume_reward * batch["child_excess"] + self.options.finish_reward
        sums = batch["rewards"]
        if options.n_step:
            q = self.target(batch["child_features"]) * self.unit(batch["child_excess"])[:, None]
            values = soft_value(q.amin(dim=0), batch["child_masks"], options.temperature)
            values = torch.minimum(values.clamp(min=0), most) if options.clip else values
            sums = dual_state_target(sums, values, batch["child_discounts"], batch["owner"])
        return sums / self.unit(batch["excess"])

    def unit(self, excess: Tensor) -> Tensor:
        """What the network's outputs for components of such an excess are multiplied by."""
        options, weight = self.options, max(self.options.volume_reward, self.options.finish_reward)
        if options.value_unit == "weight":
            return torch.full_like(excess, weight)
        return weight * excess.clamp(min=LEAST_EXCESS)

    # Curves, validation, checkpoints

    def log(self) -> None:
        """Append a point to the curves: means since the last one; for ways to end, counts."""
        self._point({k: sum(v) if k.startswith("ended_") else sum(v) / len(v) for k, v in self.seen.items()})
        self.seen = {}

    def validate(self) -> None:
        """Count the parts of the validation's solids; the network with the fewest is kept as the best."""
        ratios = self.validation.ratios(self.playing, self.encoder)
        self._point({f"validation_{name}": value for name, value in ratios.items()})
        if ratios["own_plane"] <= self.best:
            self.best = ratios["own_plane"]
            about = {"kind": KIND, "threshold": self.options.threshold, "encoder": self.options.encoder}
            write_file(self.folder / "policy.npz", self.playing.plain(about).to_bytes())

    def save(self) -> None:
        """Write a checkpoint."""
        arrays = {"network": self.network.state_dict(), "target": self.target.state_dict()}
        arrays |= {"adam": adam_state(self.optimizer), "replay": self.replay.state(), "rollouts": self.rollouts.state()}
        state = {name: getattr(self, name) for name in ("cuts", "learned", "seconds", "seen", "best")}
        state |= {"options": dataclasses.asdict(self.options), "encoder": self.encoder.digest}
        save_checkpoint(self.folder / "checkpoint.npz", arrays, {**state, "generator": self.rng.bit_generator.state})

    def restore(self) -> None:
        """Go on from the checkpoint, if there is one; the curves after it are dropped and will be computed again."""
        curves = self.folder / "curves.jsonl"
        found = load_checkpoint(self.folder / "checkpoint.npz")
        if found is None:
            curves.write_text("", encoding="utf-8")
            return
        arrays, state = found
        for name, value in dataclasses.asdict(self.options).items():
            if name not in MAY_CHANGE and (was := state["options"][name]) != value:
                raise OptionError(
                    f"{name} is {value!r}, but was {was!r} when the run began: give that, or begin another run."
                )
        if state["encoder"] != self.encoder.digest:
            raise OptionError(f"{self.options.encoder_weights} holds other weights than the run began with.")
        self.network.load_state_dict(tensors(arrays["network"]))
        self.target.load_state_dict(tensors(arrays["target"]))
        restore_adam(self.optimizer, tensors(arrays["adam"]))
        self.replay.restore(arrays["replay"])
        self.rollouts.restore(arrays["rollouts"])
        self.cuts, self.learned, self.seconds, self.best = (state[k] for k in ("cuts", "learned", "seconds", "best"))
        self.seen, self.rng.bit_generator.state = state["seen"], state["generator"]
        kept = [line for line in curves.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
        curves.write_text("".join(x for x in kept if json.loads(x)["cuts"] <= self.cuts), encoding="utf-8")
        self.say(f"resuming at cut {self.cuts}")

    def _point(self, values: dict[str, float]) -> None:
        with open(self.folder / "curves.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps({"cuts": self.cuts, **values, "seconds": round(self.seconds, 3)}) + "\n")
        self.say("  ".join([f"cut {self.cuts}", *(f"{k} {v:.4g}" for k, v in values.items()), f"{self.seconds:.0f} s"]))

    def _add(self, **values: float) -> None:
        for name, value in values.items():
            self.seen.setdefault(name, []).append(value)


class Validation:
    """Raw parts of a few solids, as geometric means of their ratios to greedy's over the 150 planes alone."""

    def __init__(self, listed: MeshList, solids: Solids, options: TrainOptions) -> None:
        names = listed.validation or listed.training[: TrainOptions.validation]
        self._solids = [solid for name in names if (solid := solids.get(name)) is not None]
        if not self._solids:
            raise TrainingError("none of the meshes held out for validation can be repaired; hold out more.")
        self._held_out = bool(listed.validation)
        self._criterion, self._most = Concavity(options.threshold), options.max_parts
        self._greedy = self._parts(make_policy("greedy-hull-sum"))
        self._random = mean_ratio(self._parts(RandomShortlist(1, concave_edges=0)), self._greedy)

    def ratios(self, network: QNetwork, encoder: Encoder) -> dict[str, float]:
        """Ratios of the network's own plane, its ten best, and of random planes."""
        own, ten = (self._parts(policy_of(network, encoder, shortlist=n)) for n in (1, SHORTLIST))
        ratios = {"own_plane": mean_ratio(own, self._greedy), "ten_best": mean_ratio(ten, self._greedy)}
        return {"parts": sum(own) / len(own), **ratios, "random": self._random}

    def _parts(self, policy: Policy) -> list[int]:
        """Count the parts of each solid, without merging; a decomposition stops where an episode would."""
        with Run(1) as run:
            trees = [CutTree(solid, policy, run) for solid in self._solids]
            cuts = [cut_and_merge(tree, self._criterion, run, merge=False, most=self._most) for tree in trees]
        return [len(one.pieces) for one in cuts]

    def verdict(self, best: float, folder: Path, options: TrainOptions) -> str:
        """Say what the run has reached, and the next command."""
        where = "solids it has not seen" if self._held_out else "the solids it learned from"
        text = f"On {where}, the network's plane leaves {best:.3f} times greedy's parts (random: {self._random:.3f}). "
        if best > 1:
            return f"{text}Greedy is better: go on with  --resume --env-steps {2 * options.env_steps}  in {folder}."
        if options.encoder == "i2p-mae":
            return f"{text}Use it in Python:  rlacd.learn.q_network.load_policy({str(folder)!r}, shortlist=10)."
        return f"{text}Use it:  rlacd decompose MESH --policy {folder / 'policy.npz'}"


def mean_ratio(counts: Sequence[int], others: Sequence[int]) -> float:
    """Get the geometric mean of the ratios; a count of 0 is taken as 1."""
    return float(np.exp(np.mean(np.log(np.maximum(counts, 1) / np.maximum(others, 1)))))


MAY_CHANGE = ["env_steps", "checkpoint_seconds", "log_every", "validate_every", "device", "threads", "encoder_weights"]
"""Options that may change when a run is resumed: its length, its logging, its place and files."""
