"""An episode: a solid is cut until nothing is left to cut, and every cut is recorded as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.learn.checkpoint import packed, unpacked
from rlacd.learn.environment import CutEnv
from rlacd.learn.options import TrainOptions
from rlacd.planes.sweep import valid_planes
from rlacd.policies.encoder import Encoder
from rlacd.policies.network import Network
from rlacd.solid.arrays import BoolArray, Float32Array, FloatArray, Int64Array
from rlacd.solid.component import Component


@dataclass(frozen=True, eq=False)
class Episode:
    """T cuts of N components, with C unfinished children."""

    features: NDArray[np.float16]
    """``[N, D]``."""
    masks: BoolArray
    """``[N, A]``, their valid planes."""
    excess: FloatArray
    """``[N]``, see `CutEnv.excess`."""
    state: Int64Array
    planes: Int64Array
    """``[T]``, the component that each cut divided, by its number, and the plane."""
    rewards: FloatArray
    """``[T]``."""
    child: Int64Array
    owner: Int64Array
    """``[C]``, components that cuts left unfinished, and the cut of each."""
    discounts: FloatArray
    """``[C]``."""
    parts: int
    """Number of components at the end."""
    ended: str
    """terminal: all parts finished; stuck: some cannot be cut; cap: truncated; nothing: to cut; lost: never played."""

    @classmethod
    def empty(cls, ended: str) -> Episode:
        """Create an episode without a cut."""
        ints, floats = np.empty(0, np.int64), np.empty(0)
        none = np.empty((0, 0), np.float16), np.empty((0, 0), np.bool_)
        return cls(*none, floats, ints, ints, floats, ints, ints, floats, 0, ended)

    def returns(self) -> FloatArray:
        """Monte Carlo return of each cut [T]: eq. 8 down to the leaves, with what was played below for the values."""
        sums, cut = self.rewards.copy(), {int(component): t for t, component in enumerate(self.state)}
        below: list[list[tuple[int, float]]] = [[] for _ in sums]
        for t, child, discount in zip(self.owner.tolist(), self.child.tolist(), self.discounts.tolist(), strict=True):
            if child in cut:
                below[t].append((cut[child], discount))
        for t in reversed(range(len(sums))):  # children are cut later
            for later, discount in below[t]:
                sums[t] += discount * sums[later]
        return sums

    def to_bytes(self) -> bytes:
        """Pack it for `from_bytes`."""
        return packed({name: np.asarray(value) for name, value in vars(self).items()})

    @classmethod
    def from_bytes(cls, content: bytes) -> Episode:
        """Unpack the result of `to_bytes`."""
        values: dict[str, Any] = {name: a if a.ndim else a.item() for name, a in unpacked(content).items()}
        return cls(**values)


@dataclass
class Player:
    """Plays one episode of `env`, which must need a cut: a pure function of the attributes.

    `network` is None for uniformly random valid planes; a share `epsilon` of the cuts is random anyway.
    """

    env: CutEnv
    options: TrainOptions
    encoder: Encoder
    network: Network | None
    epsilon: float
    rng: np.random.Generator

    def play(self) -> Episode:
        """Cut the largest component again and again, epsilon-greedily."""
        env = self.env
        numbers = {component: i for i, component in enumerate(env.reset())}
        cuts: list[tuple[int, int, float]] = []
        children: list[tuple[int, int, float]] = []
        while env.unfinished and not (cuts and len(env.all) >= self.options.max_parts):
            component = env.largest()
            plane = self._choose(component)
            step = env.step(component, env.candidates(component).plane(plane))
            for child, share in zip(step.left.unfinished, step.discounts, strict=True):
                numbers[child] = len(numbers)
                children.append((numbers[child], len(cuts), share))
            cuts.append((numbers[component], plane, step.reward(self.options)))
        seen = [self._see(component) for component in numbers]
        state, planes, rewards = (np.array(column) for column in zip(*cuts, strict=True))
        of_child, owner, discounts = (np.array([c[i] for c in children]) for i in range(3))
        return Episode(
            np.stack([features for features, _ in seen]).astype(np.float16),
            np.stack([mask for _, mask in seen]),
            np.array([env.excess(component) for component in numbers]),
            *(state, planes, rewards, of_child.astype(np.int64), owner.astype(np.int64), discounts),
            parts=len(env.all),
            ended="cap" if env.unfinished else "terminal" if env.terminal else "stuck",
        )

    def _see(self, component: Component) -> tuple[Float32Array, BoolArray]:
        """Features, as exact as they are stored, and valid planes."""
        known: dict[Component, Any] = self.env.memory.features
        if component not in known:
            features = self.encoder.describe(component).astype(np.float16).astype(np.float32)
            known[component] = features, valid_planes(component, self.env.candidates(component))
        seen: tuple[Float32Array, BoolArray] = known[component]
        return seen

    def _choose(self, component: Component) -> int:
        """Choose a valid plane: the best, or a random one."""
        features, mask = self._see(component)
        if self.network is None or self.rng.random() < self.epsilon:
            return int(self.rng.choice(np.flatnonzero(mask)))
        return int(np.where(mask, self.network(features).reshape(-1), -np.inf).argmax())
