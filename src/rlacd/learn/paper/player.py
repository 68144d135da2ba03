"""Playing an episode: cut a solid with the current network until nothing is left to cut, and record every step."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from rlacd.learn.encoders import Encoder, describe
from rlacd.learn.paper.lookahead import Lookahead, promising
from rlacd.learn.paper.loss import boltzmann
from rlacd.learn.paper.mdp import CutProcess, Reward
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.qnetwork import QNetwork
from rlacd.learn.paper.record import ENDED, Record
from rlacd.policies.observe import Float32Array, observe, valid_planes
from rlacd.solid.arrays import BoolArray, FloatArray
from rlacd.solid.component import Component, Plane


@dataclass
class _Seen:
    """A component of the frontier."""

    features: Float32Array
    mask: BoolArray


@dataclass(frozen=True)
class Player:
    """Plays one episode.

    Attributes
    ----------
    cutting : CutProcess
        The uncut solid; it must need a cut.
    options : TrainOptions
    encoder : Encoder
    network : QNetwork or None
        None for uniformly random valid planes.
    epsilon : float
        Fraction of cuts that are uniformly random anyway.
    rng : Generator
        Generator of this episode only.
    """

    cutting: CutProcess
    options: TrainOptions
    encoder: Encoder
    network: QNetwork | None
    epsilon: float
    rng: np.random.Generator

    def play(self) -> Record:
        """Repeatedly cut the largest component; a pure function of the attributes, with torch on one thread."""
        cutting, frontier = self.cutting, self._see(self.cutting.frontier)
        everything, joined, discounts = list(frontier), [len(frontier)], [1.0] * len(frontier)
        index: list[int] = []
        planes: list[int] = []
        values: list[float] = []
        rewards: list[Reward] = []
        while not (ended := self._ended(len(planes))):
            largest = cutting.largest()
            component, seen = cutting.frontier[largest], frontier.pop(largest)
            if self.options.lookahead:
                plane, value = 0, np.nan
                cut = cutting.cut(largest, self._look_ahead(component))
            else:
                plane, value = self._choose(seen)
                cut = cutting.cut(largest, cutting.candidates(component).plane(plane))
            children = self._see(cut.unfinished)
            frontier += children
            everything += children
            joined.append(len(children))
            discounts += cut.discounts
            index.append(largest)
            planes.append(plane)
            values.append(value)
            rewards.append(cut.reward)
        return Record(
            features=np.stack([seen.features for seen in everything]).astype(np.float16),
            masks=np.stack([seen.mask for seen in everything]),
            discounts=np.array(discounts),
            joined=np.array(joined, np.int64),
            index=np.array(index, np.int64),
            planes=np.array(planes, np.int64),
            rewards=np.array([dataclasses.astuple(reward) for reward in rewards]),
            values=np.array(values),
            parts=cutting.count,
            ended=ENDED.index(ended),
        )

    def _ended(self, cuts: int) -> str:
        if self.cutting.over:
            return "terminal" if self.cutting.terminal else "stuck"
        capped = cuts >= self.options.max_cuts or self.cutting.count >= self.options.max_parts
        return "cap" if capped and cuts else ""

    def _see(self, components: list[Component]) -> list[_Seen]:
        """Describe components for the learner."""
        if not components:
            return []
        options = self.options
        seen = [observe(c, self.cutting.candidates(c), options.threshold, options.points) for c in components]
        features = describe(self.encoder, seen, options.scale_input)
        only = np.ones(1, dtype=np.bool_)  # the value of a component is that of its only action
        return [_Seen(row, only if options.lookahead else o.mask) for row, o in zip(features, seen, strict=True)]

    def _look_ahead(self, component: Component) -> Plane:
        """Choose one of the promising planes, at random or by lookahead."""
        planes = promising(component, self.options.lookahead)
        if not planes:  # the sweep is stricter than the mask
            candidates = self.cutting.candidates(component)
            return candidates.plane(int(valid_planes(component, candidates).argmax()))
        if self.network is None or self.rng.random() < self.epsilon:
            return planes[int(self.rng.integers(len(planes)))]
        values = Lookahead(self.network, self.encoder, self.options).values(self.cutting, component, planes)
        return planes[int(values.argmax())]

    def _choose(self, seen: _Seen) -> tuple[int, float]:
        """Choose a plane, at random or by the Boltzmann policy; also returns the greatest Q, nan without a network."""
        chances, value = seen.mask / seen.mask.sum(), np.nan
        if self.network is not None:
            mask = torch.from_numpy(seen.mask)[None]
            with torch.inference_mode():
                q = self.network(torch.from_numpy(seen.features)[None])
                policy = boltzmann(q, mask, self.options.temperature)[0].double().numpy()
            chances = self.epsilon * chances + (1 - self.epsilon) * policy
            value = float(q.masked_fill(~mask, -torch.inf).amax())
        return _draw(chances, self.rng), value


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Run torch on one thread: sums over several threads round differently."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _draw(chances: FloatArray, rng: np.random.Generator) -> int:
    accumulated: NDArray[np.float64] = np.cumsum(chances)
    return int(np.searchsorted(accumulated, rng.random() * accumulated[-1], side="right"))
