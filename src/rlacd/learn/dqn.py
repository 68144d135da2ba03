"""Deep Q-learning of cuts (the paper's 3.3, 3.5 and 4.1), from top to bottom: network, replay buffer, loss, agent.

The environment is `rlacd.learn.environment`; a run with its curves, validation and checkpoints is `rlacd.learn.train`.
"""

from __future__ import annotations

import copy
import dataclasses
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from rlacd.errors import OptionError, RlacdError
from rlacd.learn.checkpoint import adam_state, restore_adam, tensors
from rlacd.learn.episodes import Episode
from rlacd.learn.options import TrainOptions
from rlacd.learn.rollouts import Rollouts
from rlacd.policies.encoder import Encoder
from rlacd.policies.network import KIND, Network
from rlacd.policies.points import PointEncoder
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array

HIDDEN, SHARED = (1024, 512, 256, 128), (128, 128)
"""Widths of the paper's layers, and of a network that values planes one by one: 22,000 weights."""

TAU = 0.01
"""Share of the network that its average takes up each gradient step, where targets are returns."""

LEAST_EXCESS = 1e-6
"""Share of the solid's hull: components with less excess have the same unit."""


def q_network(inputs: int, outputs: int) -> nn.Sequential:
    """Multilayer perceptron with ReLU: Q(p, m) [B, outputs] of features [B, inputs] of the component.

    With one output, planes have features of their own, and all share the network: [B, 150, 1] of [B, 150, inputs].
    """
    widths = (inputs, *(SHARED if outputs == 1 else HIDDEN), outputs)
    layers = [layer for before, after in pairwise(widths) for layer in (nn.Linear(before, after), nn.ReLU())]
    return nn.Sequential(*layers[:-1])


def plain(network: nn.Module, **about: Any) -> Network:
    """Copy a network as `rlacd.policies.network` takes it."""
    linear = [layer for layer in network.modules() if isinstance(layer, nn.Linear)]
    layers = [(x.weight.detach().cpu().numpy(), x.bias.detach().cpu().numpy()) for x in linear]
    return Network(layers, about or {"threshold": 1.0})


@dataclass(frozen=True, eq=False)
class Experience:
    """What is kept of an episode: T cuts, and the C children that targets ask for, in the order of the cuts."""

    taken: NDArray[np.float16]
    """[T, D]: what the network sees of each cut, features of the plane or of the component."""
    planes: Int64Array
    rewards: FloatArray
    excess: FloatArray
    owner: Int64Array
    """[C]: the cut of each child."""
    discounts: FloatArray
    features: NDArray[np.float16]
    """[C, D] or [C, A, D]"""
    masks: BoolArray

    @classmethod
    def of(cls, episode: Episode, target: str, per_plane: bool) -> Experience:
        """Keep of an episode what targets of this kind ask for: returns in place of rewards need no children."""
        state, planes, kept = episode.state, episode.planes, slice(0 if target == "return" else None)
        rewards, child = episode.returns() if target == "return" else episode.rewards, episode.child[kept]
        taken = episode.features[state, planes] if per_plane else episode.features[state]
        below = episode.owner[kept], episode.discounts[kept], episode.features[child], episode.masks[child]
        return cls(taken, planes, rewards, episode.excess[state], *below)


class ReplayBuffer:
    """The last cuts, in whole episodes: the oldest is dropped as soon as the others hold `capacity` cuts."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._held: deque[Experience] = deque()
        self._ends = np.zeros(0, np.int64)

    def __len__(self) -> int:
        return int(self._ends[-1]) if self._held else 0

    def add(self, experience: Experience) -> None:
        """Add an episode."""
        self._held.append(experience)
        self._count()
        while len(self) - len(self._held[0].planes) >= self.capacity:
            self._held.popleft()
            self._count()

    def sample(self, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        """Draw B = `count` cuts uniformly, with replacement.

        Returns
        -------
        dict of arrays
            features float32 [B, D], planes int64 [B], rewards and excess float32 [B]. Of C children: owner int64 [C],
            their row; child_features float32 [C, D] or [C, A, D]; child_masks bool [C, A], never all False in a row;
            child_discounts float32 [C].
        """
        if not self._held:
            raise RlacdError("there is nothing to learn from yet; let `learning_starts` be at least 1.")
        drawn = rng.integers(len(self), size=count)
        places = np.searchsorted(self._ends, drawn, side="right")
        cuts = [(e := self._held[i], n - self._ends[i] + len(e.planes)) for i, n in zip(places, drawn, strict=True)]
        left = [(e, slice(*np.searchsorted(e.owner, (t, t + 1)).tolist())) for e, t in cuts]
        return {
            "features": np.stack([e.taken[t] for e, t in cuts]).astype(np.float32),
            "planes": np.array([e.planes[t] for e, t in cuts]),
            "rewards": np.array([e.rewards[t] for e, t in cuts], np.float32),
            "excess": np.array([e.excess[t] for e, t in cuts], np.float32),
            "owner": np.repeat(np.arange(count), [s.stop - s.start for _, s in left]),
            "child_features": np.concatenate([e.features[s] for e, s in left]).astype(np.float32),
            "child_masks": np.concatenate([e.masks[s] for e, s in left]),
            "child_discounts": np.concatenate([e.discounts[s] for e, s in left]).astype(np.float32),
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a checkpoint."""
        arrays = {f.name: [getattr(e, f.name) for e in self._held] for f in dataclasses.fields(Experience)}
        sizes = np.array([(len(e.planes), len(e.owner)) for e in self._held], np.int64).reshape(-1, 2)
        return {name: np.concatenate(of_all) for name, of_all in arrays.items() if of_all} | {"sizes": sizes}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._held, begin = deque(), np.zeros(2, np.int64)
        for end in np.cumsum(arrays["sizes"][:, :2], axis=0):
            rows = [slice(*ends) for ends in zip(begin.tolist(), end.tolist(), strict=True)]
            self._held.append(Experience(*(arrays[f.name][rows[i >= PER_CUT]].copy() for i, f in enumerate(FIELDS))))
            begin = end
        self._count()

    def _count(self) -> None:
        self._ends = np.cumsum([len(experience.planes) for experience in self._held])


FIELDS, PER_CUT = dataclasses.fields(Experience), 4
"""The first four hold a row a cut, the others a row a child."""


def dual_state_target(reward: Tensor, values: Tensor, discounts: Tensor, owner: Tensor) -> Tensor:
    """Right-hand side of eq. 8 [B]: rewards [B], plus the discounted values [C] of each cut's unfinished children.

    `owner` [C] is the transition of each child. Finished children have value 0 and are not listed.
    """
    return reward.index_add(0, owner, discounts * values)


def bellman_loss(q: Tensor, planes: Tensor, target: Tensor) -> Tensor:
    """Half the mean squared error of Q(p, m), q [B, A], of the planes taken, int64 [B]; q [B, 1] is already theirs."""
    taken = q[:, 0] if q.shape[1] == 1 else q.gather(1, planes[:, None])[:, 0]
    return (0.5 * (taken - target).square()).mean()


class DQN:
    """The agent: plays episodes, keeps them, and learns from them."""

    def __init__(self, options: TrainOptions, encoder: Encoder) -> None:
        self.options, self.encoder = options, encoder
        self.device = pick_device(options.device, large=encoder.outputs > 1)
        torch.manual_seed(options.seed)
        self.network = q_network(encoder.dim, encoder.outputs).to(self.device)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=options.learning_rate, fused=True)
        self.replay = ReplayBuffer(options.buffer_size)
        self.rng = np.random.default_rng([options.seed, 0])
        self.env_steps = self.updates = 0
        self.learned: list[dict[str, float]] = []  # what the curves show of each gradient step of the last episode
        self.returns = options.target == "return"
        self.target_network = copy.deepcopy(self.network)  # eq. 8 asks it
        self.playing = copy.deepcopy(self.network) if self.returns else self.network  # an average; it is validated

    def train(self, rollouts: Rollouts) -> Iterator[Episode]:
        """Play episodes and learn from them until the last step."""
        while self.env_steps < self.options.env_steps:
            rollouts.begin(*self.acting())
            episode = rollouts.take()
            self.learn_from(episode)
            yield episode

    @property
    def epsilon(self) -> float:
        """Share of random cuts in new episodes (4.1): all at first."""
        thousands = (self.env_steps - self.options.learning_starts) // 1000
        return 1.0 if thousands < 0 else self.options.epsilon * self.options.epsilon_decay**thousands

    def acting(self) -> tuple[bytes | None, float]:
        """How new episodes are played; see `Rollouts.begin`."""
        if self.env_steps < self.options.learning_starts:
            return None, self.epsilon
        return plain(self.playing).to_bytes(), self.epsilon

    def learn_from(self, episode: Episode) -> None:
        """Keep an episode, and learn as often as its cuts ask for."""
        self.learned = []
        if len(episode.planes):
            self.replay.add(Experience.of(episode, self.options.target, self.encoder.outputs == 1))
        for _ in range(len(episode.planes)):
            self.env_steps += 1
            if self.env_steps > self.options.learning_starts and self.env_steps % self.options.train_frequency == 0:
                self.update()

    def update(self) -> None:
        """Take a gradient step on one batch by the dual-state Bellman loss (eq. 8)."""
        drawn = self.replay.sample(self.options.batch_size, self.rng)
        batch = {name: torch.from_numpy(array).to(self.device) for name, array in drawn.items()}
        target = self.targets(batch)
        q = self.network(batch["features"])
        loss = bellman_loss(q, batch["planes"], target)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.updates += 1
        if self.returns:
            with torch.no_grad():
                for mean, new in zip(self.playing.parameters(), self.network.parameters(), strict=True):
                    mean.lerp_(new, TAU)
        elif self.updates % self.options.target_frequency == 0:
            self.target_network.load_state_dict(self.network.state_dict())
        found = {"loss": loss, "target": target.mean(), "q_mean": q.mean(), "q_max": q.max()}
        self.learned.append({name: float(value.detach()) for name, value in found.items()})

    @torch.no_grad()
    def targets(self, batch: Mapping[str, Tensor]) -> Tensor:
        """Right-hand side of eq. 8 [B], in units of the greater reward's weight.

        Or the return, limited to what is possible (the excess volume bounds r1), in units of the component's excess.
        """
        volume, finish = self.options.volume_reward, self.options.finish_reward
        weight = max(volume, finish)
        if self.returns:
            possible = torch.minimum(batch["rewards"].clamp(min=0), volume * batch["excess"] + finish)
            return possible / (weight * batch["excess"].clamp(min=LEAST_EXCESS))
        mask = batch["child_masks"]
        q = self.target_network(batch["child_features"]).reshape(mask.shape) * weight
        values = q.masked_fill(~mask, -torch.inf).amax(dim=1)  # eq. 7
        return dual_state_target(batch["rewards"], values, batch["child_discounts"], batch["owner"]) / weight

    def stored(self) -> Network:
        """The network that plays, as a file holds it: with its encoder, or the name of one's own."""
        sees, about = self.encoder, {"kind": KIND, "threshold": self.options.threshold}
        if isinstance(sees, PointEncoder):
            return Network(plain(self.playing).layers, {**about, "encoder": sees.about()}, sees.weights())
        return plain(self.playing, **about, **({"encoder": sees.digest} if sees.digest else {}))

    def state(self) -> tuple[dict[str, Mapping[str, Any]], dict[str, Any]]:
        """Everything, for a checkpoint: arrays or tensors by owner and name, and plain values."""
        networks = {name: network.state_dict() for name, network in self._networks().items()}
        plain = {"env_steps": self.env_steps, "updates": self.updates, "generator": self.rng.bit_generator.state}
        return {**networks, "replay": self.replay.state(), "adam": adam_state(self.optimizer)}, plain

    def _networks(self) -> dict[str, nn.Module]:
        """The networks that a checkpoint keeps: the second is the one that follows the first."""
        return {"network": self.network, "target": self.playing if self.returns else self.target_network}

    def restore(self, arrays: Mapping[str, dict[str, NDArray[Any]]], plain: Mapping[str, Any]) -> None:
        """Restore the result of `state`."""
        for name, network in self._networks().items():
            saved = tensors(arrays[name]).values()
            network.load_state_dict(dict(zip(network.state_dict(), saved, strict=True)))
        restore_adam(self.optimizer, tensors(arrays.get("adam", {})))
        self.replay.restore(arrays["replay"])
        self.env_steps, self.updates = plain["env_steps"], plain["updates"]
        self.rng.bit_generator.state = plain["generator"]


def pick_device(name: str, large: bool) -> torch.device:
    """Get the device that the options ask for; auto takes a GPU, if there is one, for a large network alone."""
    has_gpu = torch.cuda.is_available()
    if name == "cuda" and not has_gpu:
        raise OptionError("device is 'cuda', but torch finds no GPU; use cpu, or install torch for CUDA.")
    return torch.device(("cuda" if has_gpu and large else "cpu") if name == "auto" else name)
