"""Deep Q-learning of cuts (the paper's 3.3, 3.5 and 4.1), from top to bottom: network, replay buffer, loss, agent.

The environment is `rlacd.learn.environment`; a run with its curves, validation and checkpoints is `rlacd.learn.train`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from rlacd.errors import RlacdError
from rlacd.learn.checkpoint import adam_state, restore_adam, tensors
from rlacd.learn.encoders import Encoder, pick_device
from rlacd.learn.episodes import Episode
from rlacd.learn.options import TrainOptions
from rlacd.learn.rollouts import Rollouts
from rlacd.policies.network import Network
from rlacd.pool import Shared
from rlacd.solid.arrays import BoolArray, FloatArray, Int64Array

HIDDEN = (1024, 512, 256, 128)
"""Widths of the paper's layers."""

SHARED = (128, 128)
"""Widths for a network that values planes one by one: 22,000 weights."""

LEAST_EXCESS = 1e-6
"""Share of the solid's hull: components with less excess have the same unit."""


class QNetwork(nn.Module):
    """One or two multilayer perceptrons with ReLU; the lesser of two values is the value (clipped double Q-learning).

    Parameters
    ----------
    inputs, outputs : int
        Features, and values that they give: 1 where each plane has features of its own, and all share the network.
    count : int
    """

    def __init__(self, inputs: int, outputs: int, count: int = 1) -> None:
        super().__init__()
        hidden = SHARED if outputs == 1 else HIDDEN
        self.each = nn.ModuleList(multilayer((inputs, *hidden, outputs)) for _ in range(count))

    def forward(self, features: Tensor) -> Tensor:
        """Each network's Q(p, m) [N, B, 150] of features [B, inputs] or [B, 150, inputs]; [N, B] of one plane's."""
        return torch.stack([one(features).squeeze(-1) for one in self.each])

    def plain(self, about: Mapping[str, Any]) -> Network:
        """Copy the first network for a file (`rlacd.policies.network`)."""
        linear = [layer for layer in self.each[0].modules() if isinstance(layer, nn.Linear)]
        return Network([(x.weight.detach().cpu().numpy(), x.bias.detach().cpu().numpy()) for x in linear], about)


def multilayer(widths: Sequence[int]) -> nn.Sequential:
    """Linear layers with ReLU between them."""
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


@dataclass(frozen=True, eq=False)
class Experience:
    """What is kept of an episode: T cuts, C children that they left, N components.

    Attributes
    ----------
    taken : float16 [T, D]
        What the network sees of each cut: features of the plane, or of the component.
    planes, rewards, excess : [T]
        Rewards of `n_step` cuts; for the excess see `CutEnv.excess`.
    owner, child, discounts : [C]
        The cut and the component of each child left after `n_step` cuts, in the order of the cuts.
    features, masks, left_excess, keys : [N, ...]
        Of the components, as far as the targets ask for them; `keys` are digests of their features.
    state : int64 [T]
        The component of each cut.
    """

    taken: NDArray[np.float16]
    planes: Int64Array
    rewards: FloatArray
    excess: FloatArray
    state: Int64Array
    owner: Int64Array
    child: Int64Array
    discounts: FloatArray
    features: NDArray[np.float16]
    masks: BoolArray
    left_excess: FloatArray
    keys: NDArray[np.uint8]

    @classmethod
    def of(cls, episode: Episode, options: TrainOptions, per_plane: bool) -> Experience:
        """Keep of an episode what the options ask for."""
        counts = options.objective == "fewest-cuts"
        rewards, left = episode.returns(1 if counts else options.n_step)
        links = [(t, c, d) for t, own in enumerate(left) for c, d in own.items()] if counts or options.n_step else []
        owner, child, discounts = np.array(links, np.float64).reshape(-1, 3).T
        state, planes, features = episode.state, episode.planes, episode.features
        asked, width = slice(None if counts or options.n_step else 0), slice(0 if counts else None)
        digests = [hashlib.sha256(one.tobytes()).digest() for one in features] if counts else [b""] * len(features)
        return cls(
            taken=features[state, planes] if per_plane else features[state],
            planes=planes,
            rewards=rewards,
            excess=episode.excess[state],
            state=state,
            owner=owner.astype(np.int64),
            child=child.astype(np.int64),
            discounts=discounts,
            features=features[asked, ..., width].copy(),
            masks=episode.masks[asked, width],
            left_excess=episode.excess[asked],
            keys=np.frombuffer(b"".join(digests[asked]), np.uint8).reshape(len(digests[asked]), len(digests[0])),
        )


PER_CUT, PER_CHILD = ("taken", "planes", "rewards", "excess", "state"), ("owner", "child", "discounts")


class ReplayBuffer:
    """The last cuts, in whole episodes, and the fewest cuts that any episode needed from a component on.

    Parameters
    ----------
    capacity : int
        The oldest episode is dropped as soon as the others hold so many cuts.
    unknown : float
        Cuts that a component counts which no episode has finished.
    """

    def __init__(self, capacity: int, unknown: float = 1.0) -> None:
        self.capacity, self._unknown = capacity, unknown
        self._held: deque[Experience] = deque()
        self._ends = np.zeros(0, np.int64)
        self._fewest: dict[bytes, float] = {}

    def __len__(self) -> int:
        return int(self._ends[-1]) if self._held else 0

    def add(self, experience: Experience) -> None:
        """Add an episode."""
        if experience.keys.size:
            for t in reversed(range(len(experience.planes))):
                key = experience.keys[experience.state[t]].tobytes()
                self._fewest[key] = min(self._fewest.get(key, math.inf), self.cuts(experience, t))
        self._held.append(experience)
        self._count()
        while len(self) - len(self._held[0].planes) >= self.capacity:
            self._held.popleft()
            self._count()

    def cuts(self, experience: Experience, t: int) -> float:
        """The fewest cuts seen, from cut t of an episode on."""
        keys = experience.keys[experience.child[children_of(experience, t)]]
        return 1 + sum(self._fewest.get(key.tobytes(), self._unknown) for key in keys)

    def sample(self, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        """Draw B = `count` cuts uniformly, with replacement.

        Returns
        -------
        dict of arrays
            features float32 [B, D]; planes int64, and rewards, excess and cuts float32 [B], the last the fewest seen
            from there on. Of C children: owner int64 [C], their row; child_features float32 [C, D] or [C, A, D];
            child_masks bool [C, A], never all False in a row; child_discounts and child_excess float32 [C].
        """
        if not self._held:
            raise RlacdError("there is nothing to learn from yet; let `learning_starts` be at least 1.")
        drawn = rng.integers(len(self), size=count)
        places = np.searchsorted(self._ends, drawn, side="right")
        cuts = [
            (self._held[i], int(n - self._ends[i] + len(self._held[i].planes)))
            for i, n in zip(places, drawn, strict=True)
        ]
        below = [children_of(e, t) for e, t in cuts]
        children = [(e, e.child[s]) for (e, _), s in zip(cuts, below, strict=True)]
        counts = bool(cuts[0][0].keys.size)
        return {
            "features": np.stack([e.taken[t] for e, t in cuts]).astype(np.float32),
            "planes": np.array([e.planes[t] for e, t in cuts]),
            "rewards": np.array([e.rewards[t] for e, t in cuts], np.float32),
            "excess": np.array([e.excess[t] for e, t in cuts], np.float32),
            "cuts": np.array([self.cuts(e, t) if counts else 0 for e, t in cuts], np.float32),
            "owner": np.repeat(np.arange(count), [len(c) for _, c in children]),
            "child_features": np.concatenate([e.features[c] for e, c in children]).astype(np.float32),
            "child_masks": np.concatenate([e.masks[c] for e, c in children]),
            "child_excess": np.concatenate([e.left_excess[c] for e, c in children]).astype(np.float32),
            "child_discounts": np.concatenate([e.discounts[s] for (e, _), s in zip(cuts, below, strict=True)]).astype(
                np.float32
            ),
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a checkpoint."""
        arrays = {f.name: [getattr(e, f.name) for e in self._held] for f in dataclasses.fields(Experience)}
        sizes = [(len(e.planes), len(e.owner), len(e.masks)) for e in self._held]
        return {name: np.concatenate(of_all) for name, of_all in arrays.items() if of_all} | {
            "sizes": np.array(sizes, np.int64).reshape(-1, 3),
            "fewest_keys": np.array([[*key] for key in self._fewest], np.uint8),
            "fewest": np.array(list(self._fewest.values())),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._fewest = {k.tobytes(): n for k, n in zip(arrays["fewest_keys"], arrays["fewest"].tolist(), strict=True)}
        ends = np.cumsum(arrays["sizes"], axis=0)
        names = [f.name for f in dataclasses.fields(Experience)]
        kinds = [0 if name in PER_CUT else 1 if name in PER_CHILD else 2 for name in names]
        self._held = deque(
            Experience(*(arrays[n][e[k] - s[k] : e[k]].copy() for n, k in zip(names, kinds, strict=True)))
            for e, s in zip(ends.tolist(), arrays["sizes"].tolist(), strict=True)
        )
        self._count()

    def _count(self) -> None:
        self._ends = np.cumsum([len(experience.planes) for experience in self._held])


def children_of(experience: Experience, t: int) -> slice:
    """Where the children of cut t are."""
    return slice(*np.searchsorted(experience.owner, (t, t + 1)).tolist())


def soft_value(q: Tensor, mask: Tensor, temperature: float) -> Tensor:
    """V [B] = T log sum_p exp(Q(p) / T) over the planes in `mask` [B, A]; T = 0 gives the maximum (eq. 7).

    Every row needs a valid plane.
    """
    q = q.masked_fill(~mask, -torch.inf)
    if temperature == 0:
        return q.amax(dim=1)
    return temperature * torch.logsumexp(q / temperature, dim=1)


def dual_state_target(reward: Tensor, values: Tensor, discounts: Tensor, owner: Tensor) -> Tensor:
    """Right-hand side of eq. 8 [B]: each reward, plus the discounted values of the unfinished children of its cut.

    Parameters
    ----------
    reward : float32 [B]
    values, discounts : float32 [C]
        Of all unfinished children in the batch. Finished ones have value 0 and are not listed.
    owner : int64 [C]
        The transition of each child.
    """
    return reward.index_add(0, owner, discounts * values)


def bellman_loss(q: Tensor, planes: Tensor, target: Tensor, huber: float = 0.0) -> Tensor:
    """Half the mean squared error of Q(p, m): of q [N, B, A] of N networks, those of the planes taken, int64 [B].

    A network shared by the planes has seen those only: q [N, B]. Beyond an error of `huber`, if any, it is linear.
    """
    taken = q if q.dim() == 2 else q.gather(2, planes.expand(len(q), -1)[..., None])[..., 0]
    error = (taken - target).abs()
    square = 0.5 * error.square()
    return (torch.where(error < huber, square, huber * (error - huber / 2)) if huber else square).mean(dim=1).sum()


class DQN:
    """The agent: plays episodes, keeps them, and learns from them.

    Parameters
    ----------
    options : TrainOptions
    encoder : Encoder
    """

    def __init__(self, options: TrainOptions, encoder: Encoder) -> None:
        self.options, self.encoder, self.device = options, encoder, pick_device(options)
        torch.manual_seed(options.seed)
        self.network, self.target = (
            QNetwork(encoder.dim, encoder.outputs, options.networks).to(self.device) for _ in range(2)
        )
        self.target.load_state_dict(self.network.state_dict())
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=options.learning_rate, fused=True)
        self.replay = ReplayBuffer(options.buffer_size, options.max_parts)
        self.rng = np.random.default_rng([options.seed, 0])
        self.env_steps = self.updates = 0
        self.losses: list[tuple[float, float]] = []  # and mean targets, of the episode learned from

    def train(self, rollouts: Rollouts) -> Iterator[Episode]:
        """Play episodes and learn from them until the last step."""
        while self.env_steps < self.options.env_steps:
            rollouts.begin(*self.acting())
            episode = rollouts.take()
            self.learn_from(episode)
            yield episode

    def acting(self) -> tuple[Shared | None, float]:
        """How new episodes are played (4.1): at random at first, then epsilon-greedily; see `Rollouts.begin`."""
        if self.env_steps < self.options.learning_starts:
            return None, 1.0
        thousands = (self.env_steps - self.options.learning_starts) // 1000
        network = Shared({"network": self.playing.plain({"threshold": 1.0}).to_bytes()})
        return network, self.options.epsilon * self.options.epsilon_decay**thousands

    @property
    def playing(self) -> QNetwork:
        """The network that plays and is validated: the average, if there is one."""
        return self.target if self.options.tau else self.network

    def learn_from(self, episode: Episode) -> None:
        """Keep an episode, and learn as often as its cuts ask for."""
        self.losses = []
        if len(episode.planes):
            self.replay.add(Experience.of(episode, self.options, self.encoder.outputs == 1))
        for _ in range(len(episode.planes)):
            self.env_steps += 1
            if self.env_steps > self.options.learning_starts and self.env_steps % self.options.train_frequency == 0:
                self.update()

    def update(self) -> None:
        """Take a gradient step on one batch: the dual-state Bellman loss (eq. 8), or that to the fewest cuts seen."""
        options, drawn = self.options, self.replay.sample(self.options.batch_size, self.rng)
        batch = {name: torch.from_numpy(array).to(self.device) for name, array in drawn.items()}
        target = self.targets(batch) if options.objective == "rewards" else -batch["cuts"].log()
        loss = bellman_loss(self.network(batch["features"]), batch["planes"], target, options.huber)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        self.updates += 1
        if options.tau:
            with torch.no_grad():
                for mean, new in zip(self.target.parameters(), self.network.parameters(), strict=True):
                    mean.lerp_(new, options.tau)
        elif self.updates % options.target_frequency == 0:
            self.target.load_state_dict(self.network.state_dict())
        self.losses.append((float(loss.detach()), float(target.mean())))

    @torch.no_grad()
    def targets(self, batch: Mapping[str, Tensor]) -> Tensor:
        """Right-hand side of eq. 8 [B], in the unit of each component's values."""
        options, sums = self.options, batch["rewards"]
        if options.n_step:
            q = self.target(batch["child_features"]) * self.unit(batch["child_excess"])[:, None]
            values = soft_value(q.amin(dim=0), batch["child_masks"], options.temperature)
            values = self.possible(values, batch["child_excess"])
            sums = dual_state_target(sums, values, batch["child_discounts"], batch["owner"])
        return self.possible(sums, batch["excess"]) / self.unit(batch["excess"])

    def possible(self, values: Tensor, excess: Tensor) -> Tensor:
        """Values limited to what components of such an excess can earn, if the options ask for that."""
        most = self.options.volume_reward * excess + self.options.finish_reward
        return torch.minimum(values.clamp(min=0), most) if self.options.clip else values

    def unit(self, excess: Tensor) -> Tensor:
        """What the network's outputs for components of such an excess are multiplied by."""
        weight = max(self.options.volume_reward, self.options.finish_reward)
        shares = excess.clamp(min=LEAST_EXCESS) if self.options.value_unit == "excess" else torch.ones_like(excess)
        return weight * shares

    def state(self) -> tuple[dict[str, Mapping[str, Any]], dict[str, Any]]:
        """Everything, for a checkpoint: arrays or tensors by owner and name, and plain values."""
        arrays: dict[str, Mapping[str, Any]] = {"network": self.network.state_dict(), "replay": self.replay.state()}
        arrays |= {"target": self.target.state_dict(), "adam": adam_state(self.optimizer)}
        plain = {"env_steps": self.env_steps, "updates": self.updates, "generator": self.rng.bit_generator.state}
        return arrays, plain

    def restore(self, arrays: Mapping[str, dict[str, NDArray[Any]]], plain: Mapping[str, Any]) -> None:
        """Restore the result of `state`."""
        self.network.load_state_dict(tensors(arrays["network"]))
        self.target.load_state_dict(tensors(arrays["target"]))
        restore_adam(self.optimizer, tensors(arrays.get("adam", {})))
        self.replay.restore(arrays["replay"])
        self.env_steps, self.updates = plain["env_steps"], plain["updates"]
        self.rng.bit_generator.state = plain["generator"]
