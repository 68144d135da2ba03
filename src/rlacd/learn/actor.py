"""Actors: episodes of cutting on solid after solid, described for the learner by features.

An actor's state is never pickled: it is the recipe of its episode (solid, turn, cuts so far) and of its generator, and
is rebuilt from that bit for bit.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from rlacd.criteria import Concavity
from rlacd.errors import TrainingError
from rlacd.learn.encoders import Encoder, describe
from rlacd.learn.episodes import Episodes, Start
from rlacd.learn.mdp import Cutting, Reward
from rlacd.learn.meshes import Solids
from rlacd.learn.options import TrainOptions
from rlacd.policies.observe import Float32Array, observe
from rlacd.solid.arrays import BoolArray
from rlacd.solid.component import Component


@dataclass(frozen=True, eq=False)
class Described:
    """Components for the learner.

    Attributes
    ----------
    features : float32 [C, D]
    masks : bool [C, A]
    fill : float64 [C]
        Share of the hull that the solid fills: 1 - fill is all the volume that cutting can save.
    """

    features: Float32Array
    masks: BoolArray
    fill: np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """What a cut has led to, for the learner.

    Attributes
    ----------
    reward : Reward
    children : Described
        The unfinished ones, which join the frontier at its end.
    discounts : list of float
        Of those.
    parts : int
        Components of the solid now.
    ended : str
        "" while the episode goes on; else "terminal", "stuck" or "cap".
    fresh : Described or None
        The frontier of the next episode, when this one has ended.
    largest : int
        Index of the component to cut next.
    """

    reward: Reward
    children: Described
    discounts: list[float]
    parts: int
    ended: str
    fresh: Described | None
    largest: int


class Actor:
    """Cuts one solid after another.

    Parameters
    ----------
    solids : Solids
    names : tuple of str
        The meshes to draw from.
    encoder : Encoder
    options : TrainOptions
    number : int
        Of this actor; each draws its own sequence of solids.
    """

    def __init__(
        self, solids: Solids, names: tuple[str, ...], encoder: Encoder, options: TrainOptions, number: int
    ) -> None:
        self._encoder, self._options = encoder, options
        self._episodes = Episodes(
            solids, names, Concavity(options.threshold), options.rotate, options.max_cuts, options.max_parts
        )
        self._rng = np.random.default_rng([options.seed, 1, number])
        self._start: Start
        self._cutting: Cutting
        self._cuts: list[tuple[int, int]] = []

    def start(self) -> tuple[Described, int]:
        """Begin an episode on the next solid; returns its frontier, and which component to cut first."""
        self._start, self._cutting = self._episodes.draw(self._rng)
        self._cuts = []
        return self._describe(self._cutting.frontier), self._cutting.largest()

    def step(self, index: int, plane: int) -> Step:
        """Cut component `index` of the frontier by candidate `plane`; begins the next episode when this one ends."""
        cutting = self._cutting
        component = cutting.frontier[index]
        cut = cutting.cut(index, cutting.candidates(component).plane(plane))
        self._cuts.append((index, plane))
        children = self._describe(cut.unfinished)
        parts, ended = cutting.count, self._ended()
        fresh, largest = self.start() if ended else (None, cutting.largest())
        return Step(cut.reward, children, cut.discounts, parts, ended, fresh, largest)

    def recipe(self) -> dict[str, Any]:
        """Say, as plain JSON values, how to come to where this actor is."""
        return {"generator": self._rng.bit_generator.state, **dataclasses.asdict(self._start), "cuts": self._cuts}

    def restore(self, recipe: dict[str, Any]) -> int:
        """Come to where `recipe` was told; returns which component to cut next."""
        self._start = Start(recipe["name"], recipe["axis"], recipe["degrees"])
        cutting = self._episodes.begin(self._start)
        if cutting is None:
            raise TrainingError(f"{self._start.name} is not the mesh it was; train again from the beginning.")
        self._cuts = [(int(index), int(plane)) for index, plane in recipe["cuts"]]
        for index, plane in self._cuts:
            cutting.cut(index, cutting.candidates(cutting.frontier[index]).plane(plane))
        self._cutting = cutting
        self._rng.bit_generator.state = recipe["generator"]
        return cutting.largest()

    def _ended(self) -> str:
        if self._cutting.over:
            return "terminal" if self._cutting.terminal else "stuck"
        return "cap" if self._episodes.is_capped(self._cutting, len(self._cuts)) else ""

    def _describe(self, components: list[Component]) -> Described:
        return describe_components(self._cutting, components, self._encoder, self._options)


def describe_components(
    cutting: Cutting, components: list[Component], encoder: Encoder, options: TrainOptions
) -> Described:
    """Describe components of a frontier for the learner."""
    if not components:
        none = np.empty(0)
        return Described(np.empty((0, 0), np.float32), np.empty((0, 0), bool), none)
    seen = [observe(c, cutting.candidates(c), options.threshold, options.points) for c in components]
    features = describe(encoder, seen, options.scale_input)
    fill = np.array([c.volume / c.hull.volume for c in components])
    return Described(features, np.stack([o.mask for o in seen]), fill)
