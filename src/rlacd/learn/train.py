"""A run of `rlacd.learn.dqn`: its folder, curves, validation and checkpoints.

On CPU the same meshes, options and seed give the same weights bit for bit, wherever episodes are played and whether or
not the run was interrupted: a checkpoint holds the complete state.
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
from torch import nn

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.errors import OptionError, TrainingError
from rlacd.io.write.atomic import write_file
from rlacd.learn.checkpoint import load_checkpoint, save_checkpoint
from rlacd.learn.dqn import DQN, plain
from rlacd.learn.episodes import Episode
from rlacd.learn.meshes import MeshList, Solids, list_once
from rlacd.learn.options import TrainOptions
from rlacd.learn.rollouts import Rollouts
from rlacd.policies import Policy, make_policy
from rlacd.policies.encoder import Encoder, SweepEncoder
from rlacd.policies.greedy import RandomShortlist
from rlacd.policies.network import SHORTLIST, Network, QPolicy, q_values
from rlacd.policies.points import PointEncoder
from rlacd.pool import Pool, ProcessLimits
from rlacd.pool.local import InProcessPool
from rlacd.run import Run


def train(
    meshes: Path,
    run: Path,
    options: TrainOptions,
    *,
    resume: bool = False,
    say: Callable[[str], None] = print,
    encoder: Encoder | None = None,
    pool: Pool | None = None,
    limits: ProcessLimits | None = None,
) -> Path:
    """Train a Q network on a folder of meshes, searched to any depth.

    Parameters
    ----------
    run : Path
        Folder for ``curves.jsonl``, the checkpoint and the policy.
    resume : bool
        Continue exactly from the checkpoint in `run`; without one, start afresh.
    say : callable
        Receives lines of progress.
    encoder : Encoder, optional
        What the network sees, in place of the options' encoder; it must be picklable.
    pool, limits : Pool, ProcessLimits, optional
        Where episodes are played, in this process by default, and limits of one. They affect only the time taken.

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
    how = options.max_faces, options.validation, options.held_out, options.seed
    listed = list_once(meshes, run, *how)
    write_file(run / "options.json", json.dumps(dataclasses.asdict(options), indent=1).encode())
    left_out = f"{listed.unreadable} cannot be read, {listed.too_large} are too large"
    say(f"{len(listed.training)} meshes to learn from, {len(listed.validation)} to validate with; {left_out}")
    say(f"the first {options.learning_starts} of {options.env_steps} cuts are random; learning begins after them")
    with ExitStack() as stack:
        where, solids = pool or stack.enter_context(InProcessPool()), Solids(meshes, run / "solids", say)
        points = options.encoder == "points"
        sees = encoder or (PointEncoder.reduced(options.seed) if points else SweepEncoder(options.threshold))
        rollouts = Rollouts(where, solids, listed.training, options, sees, limits or ProcessLimits(), say)
        agent = DQN(options, sees)
        training = Training(run, agent, rollouts, Validation(listed, solids, options), say)
        training.restore()
        training.run()
    return run / "policy.npz"


class Training:
    """A run: the agent, its curves, validation and checkpoints."""

    def __init__(
        self, folder: Path, agent: DQN, rollouts: Rollouts, validation: Validation, say: Callable[[str], None]
    ) -> None:
        self.folder, self.agent, self.rollouts, self.validation, self.say = folder, agent, rollouts, validation, say
        self.options, self.best, self.seconds = agent.options, np.inf, 0.0
        self.seen: dict[str, list[float]] = {}  # since the last point of the curves
        self.logged = 0, 0.0  # cuts and seconds at that point

    def run(self) -> None:
        """Train until the last step."""
        options, before = self.options, time.perf_counter() - self.seconds
        saved, steps = time.perf_counter(), self.agent.env_steps
        for episode in self.agent.train(self.rollouts):
            self.see(episode)
            done, self.seconds = self.agent.env_steps, time.perf_counter() - before
            if done // options.log_every > steps // options.log_every:
                self.log()
            if done // options.validate_every > steps // options.validate_every:
                self.validate()
            if time.perf_counter() - saved >= options.checkpoint_seconds:
                self.save()
                saved = time.perf_counter()
            steps = done
        if not np.isfinite(self.best):
            self.validate()
        self.save()
        self.say(self.validation.verdict(self.best, self.folder / "policy.npz"))

    def see(self, episode: Episode) -> None:
        """Note what an episode adds to the next point of the curves."""
        for step in self.agent.learned:
            self._add(**step)
        if len(episode.planes):
            self._add(reward=float(episode.rewards.mean()), parts=float(episode.parts))
        self._add(**{f"ended_{episode.ended}": 1.0})

    def log(self) -> None:
        """Append a point to the curves: means since the last one; for ways to end, counts."""
        means = {k: sum(v) if k.startswith("ended_") else sum(v) / len(v) for k, v in self.seen.items()}
        (steps, seconds), self.logged, self.seen = self.logged, (self.agent.env_steps, self.seconds), {}
        pace = (self.agent.env_steps - steps) / max(self.seconds - seconds, 1e-9)
        self._point({**means, "epsilon": self.agent.epsilon, "steps_per_s": round(pace, 3)})

    def validate(self) -> None:
        """Count the parts of the validation's solids; the network with the fewest is kept as the best."""
        ratios = self.validation.ratios(self.agent.playing, self.agent.encoder)
        self._point({f"validation_{name}": value for name, value in ratios.items()})
        if ratios["own_plane"] <= self.best:
            self.best = ratios["own_plane"]
            write_file(self.folder / "policy.npz", self.agent.stored().to_bytes())

    def save(self) -> None:
        """Write a checkpoint."""
        arrays, plain = self.agent.state()
        state = {"seconds": self.seconds, "seen": self.seen, "best": self.best, "encoder": self.agent.encoder.digest}
        state |= {"options": dataclasses.asdict(self.options), "agent": plain}
        save_checkpoint(self.folder / "checkpoint.npz", {**arrays, "rollouts": self.rollouts.state()}, state)

    def restore(self) -> None:
        """Go on from the checkpoint, if there is one; the curves after it are dropped and will be computed again."""
        curves = self.folder / "curves.jsonl"
        found = load_checkpoint(self.folder / "checkpoint.npz")
        if found is None:
            curves.write_text("", encoding="utf-8")
            return
        arrays, state = found
        for name, value in dataclasses.asdict(self.options).items():
            if name not in MAY_CHANGE and (was := state["options"].get(name, value)) != value:
                raise OptionError(
                    f"{name} is {value!r}, but was {was!r} when the run began: give that, or begin another run."
                )
        if state["encoder"] != self.agent.encoder.digest:
            raise OptionError("the encoder has other weights than the run began with.")
        self.agent.restore(arrays, state["agent"])
        self.rollouts.restore(arrays["rollouts"])
        self.seconds, self.seen, self.best = state["seconds"], state["seen"], state["best"]
        self.logged = self.agent.env_steps, self.seconds
        kept = [line for line in curves.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
        done = self.agent.env_steps
        curves.write_text("".join(x for x in kept if json.loads(x)["env_steps"] <= done), encoding="utf-8")
        self.say(f"resuming at step {done}")

    def _point(self, values: dict[str, float]) -> None:
        done, seconds = self.agent.env_steps, self.seconds
        with open(self.folder / "curves.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps({"env_steps": done, **values, "seconds": round(seconds, 3)}) + "\n")
        self.say("  ".join([f"step {done}", *(f"{k} {v:.4g}" for k, v in values.items()), f"{seconds:.0f} s"]))

    def _add(self, **values: float) -> None:
        for name, value in values.items():
            self.seen.setdefault(name, []).append(value)


def policy_of(network: Network, encoder: Encoder, **deployment: int) -> QPolicy:
    """Make a policy of a network; `deployment` is `QPolicy`'s shortlist and reflex_edges."""
    return QPolicy(lambda component: network(encoder.describe(component)).reshape(-1), **deployment)


def load_policy(run: str | Path, encoder: Encoder | None = None, **deployment: int) -> QPolicy:
    """Get the best network of a run, its folder its checkpoint or its policy's file, as a policy.

    `encoder` is your own that it was trained with, if any; `deployment` as in `policy_of`.
    """
    path = Path(run) / "policy.npz" if Path(run).is_dir() else Path(run)
    path = path.with_name("policy.npz") if path.name == "checkpoint.npz" else path
    return QPolicy(q_values(str(path), encoder=encoder), **deployment)


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
        self._random = mean_ratio(self._parts(RandomShortlist(1, reflex_edges=0)), self._greedy)

    def ratios(self, network: nn.Module, encoder: Encoder) -> dict[str, float]:
        """Ratios of the network's own plane, its ten best, and of random planes."""
        fixed = plain(network)
        own, ten = (self._parts(policy_of(fixed, encoder, shortlist=n)) for n in (1, SHORTLIST))
        ratios = {"own_plane": mean_ratio(own, self._greedy), "ten_best": mean_ratio(ten, self._greedy)}
        return {"parts": sum(own) / len(own), **ratios, "random": self._random}

    def _parts(self, policy: Policy) -> list[int]:
        """Count the parts of each solid, without merging; a decomposition stops where an episode would."""
        with Run(1) as run:
            trees = [CutTree(solid, policy, run) for solid in self._solids]
            cuts = [cut_and_merge(tree, self._criterion, run, merge=False, most=self._most) for tree in trees]
        return [len(one.pieces) for one in cuts]

    def verdict(self, best: float, policy: Path) -> str:
        """Say what the run has reached, and the next command."""
        where = "solids it has not seen" if self._held_out else "the solids it learned from"
        text = f"On {where}, the network's plane leaves {best:.3f} times greedy's parts (random: {self._random:.3f})."
        return f"{text} Use it:  rlacd decompose MESH --policy {policy}"


def mean_ratio(counts: Sequence[int], others: Sequence[int]) -> float:
    """Get the geometric mean of the ratios; a count of 0 is taken as 1."""
    return float(np.exp(np.mean(np.log(np.maximum(counts, 1) / np.maximum(others, 1)))))


MAY_CHANGE = ["env_steps", "checkpoint_seconds", "log_every", "validate_every", "device", "threads"]
"""Options that may change when a run is resumed: its length, its logging, its place."""
