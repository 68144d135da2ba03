"""The decision process as a Gymnasium environment, ``rlacd/Cut-v0``.

>>> import gymnasium, rlacd.learn.env  # doctest: +SKIP
>>> env = gymnasium.make("rlacd/Cut-v0", meshes="meshes/")  # doctest: +SKIP
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from rlacd.criteria import Concavity
from rlacd.learn.meshes import Solids, list_meshes
from rlacd.learn.paper.episodes import Episodes
from rlacd.learn.paper.mdp import CutProcess, Reward
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.policies.observe import SCALE_INPUTS, Observation, observe
from rlacd.solid.arrays import BoolArray
from rlacd.solid.component import Component

PLANES = 6 * OFFSETS_PER_AXIS

LARGEST_SCALE = 1024.0
"""Bound on the absolute value of every entry of ``scale``; larger values are clipped."""

_Observed = dict[str, NDArray[Any]]


class CutEnv(gymnasium.Env[_Observed, NDArray[np.int64]]):
    """Cut solids until every component meets the criterion, with as few components as possible.

    The observation has `max_parts` slots, one per unfinished component; empty slots are zero:

    - ``points`` float32 [S, 2, N, 3]: points of the component's surface and of its hull's, in its own frame;
    - ``directions`` float32 [S, 6, 3]: normals of its candidate planes;
    - ``scale`` float32 [S, 10]: see `rlacd.policies.observe.Observation`;
    - ``taken`` int8 [S]: 1 if the slot holds a component.

    The action is a slot and one of its 150 planes. Planes not allowed by ``info["action_mask"]`` [S, 150] cut nothing
    and give no reward, but count towards `max_cuts`.

    The reward is lambda_1 r_1 + lambda_2 r_2 (the paper's eq. 2 and 3); ``info["saved"]`` is r_1 and
    ``info["finished"]`` is r_2. An episode terminates when nothing is left to cut, and is truncated at `max_cuts` cuts
    or `max_parts` components; ``info["terminal"]`` tells whether all of them meet the criterion.

    Parameters
    ----------
    meshes : path
        A folder of mesh files, searched to any depth.
    threshold : float
        Concavity at which a component is finished.
    points : int
        N.
    max_cuts, max_parts : int
    max_faces : int
        Meshes with more triangles are skipped.
    rotate : bool
        Turn each solid about a random axis by 0, 45, 90 or 180 degrees.
    volume_reward, finish_reward : float
        lambda_1 and lambda_2.

    Raises
    ------
    TrainingError
        There are no usable meshes.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        meshes: str | os.PathLike[str],
        threshold: float = 0.04,
        points: int = 2048,
        max_cuts: int = 64,
        max_parts: int = 64,
        max_faces: int = 2000,
        rotate: bool = True,
        volume_reward: float = 1000.0,
        finish_reward: float = 1000.0,
    ) -> None:
        folder = Path(meshes)
        names = list_meshes(folder, max_faces, validation=0, seed=0).training
        self._episodes = Episodes(Solids(folder), names, Concavity(threshold), rotate, max_cuts, max_parts)
        self._threshold, self._points = threshold, points
        self._weights = (volume_reward, finish_reward)
        self._cutting: CutProcess
        self._seen: dict[Component, Observation] = {}
        self._cuts = 0
        self._name = ""
        self._slots = slots = max_parts
        self.action_space = spaces.MultiDiscrete([slots, PLANES])
        self.observation_space = spaces.Dict(  # type: ignore[assignment]
            {
                "points": spaces.Box(-1.0, 1.0, (slots, 2, points, 3), np.float32),
                "directions": spaces.Box(-1.0, 1.0, (slots, 6, 3), np.float32),
                "scale": spaces.Box(-LARGEST_SCALE, LARGEST_SCALE, (slots, SCALE_INPUTS), np.float32),
                "taken": spaces.MultiBinary(slots),
            }
        )

    @property
    def cutting(self) -> CutProcess:
        """The solid being cut."""
        return self._cutting

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Observed, dict[str, Any]]:
        """Start with another solid, drawn at random; see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        start, self._cutting = self._episodes.draw(self.np_random)
        self._name, self._cuts, self._seen = start.name, 0, {}
        return self._observed(), self._info(Reward(0.0, 1.0, 0.0, 0.0), made=False)

    def step(self, action: NDArray[np.int64]) -> tuple[_Observed, float, bool, bool, dict[str, Any]]:
        """Cut the component in slot ``action[0]`` by its plane ``action[1]``; see `gymnasium.Env.step`."""
        slot, plane = (int(a) for a in action)
        cutting, reward, made = self._cutting, Reward(0.0, 1.0, 0.0, 0.0), False
        self._cuts += 1
        if self._mask()[slot, plane]:
            cut = cutting.cut(slot, cutting.candidates(cutting.frontier[slot]).plane(plane))
            reward, made = cut.reward, cut.made
        terminated = cutting.over
        truncated = not terminated and self._episodes.is_capped(cutting, self._cuts)
        r = self._weights[0] * reward.share * reward.saved + self._weights[1] * reward.finished
        return self._observed(), r, terminated, truncated, self._info(reward, made)

    def _shown(self) -> list[Observation]:
        """Observations of the components in the slots; if the frontier outgrew them, the episode has ended."""
        components = self._cutting.frontier[: self._slots]
        self._seen = {
            c: self._seen.get(c) or observe(c, self._cutting.candidates(c), self._threshold, self._points)
            for c in components
        }
        return list(self._seen.values())

    def _observed(self) -> _Observed:
        filled: _Observed = {name: np.zeros(s.shape, s.dtype) for name, s in self.observation_space.items()}  # type: ignore[attr-defined]
        for slot, seen in enumerate(self._shown()):
            filled["points"][slot] = np.clip(seen.points, -1, 1)  # float32 rounding may move a corner outwards
            filled["directions"][slot] = np.clip(seen.directions, -1, 1)
            filled["scale"][slot] = np.clip(seen.scale, -LARGEST_SCALE, LARGEST_SCALE)
            filled["taken"][slot] = 1
        return filled

    def _mask(self) -> BoolArray:
        mask: BoolArray = np.zeros((self._slots, PLANES), dtype=np.bool_)
        for slot, seen in enumerate(self._shown()):
            mask[slot] = seen.mask
        return mask

    def _info(self, reward: Reward, made: bool) -> dict[str, Any]:
        return {
            "action_mask": self._mask(),
            "saved": reward.share * reward.saved,
            "finished": reward.finished,
            "made": made,
            "terminal": self._cutting.terminal,
            "parts": self._cutting.count,
            "mesh": self._name,
        }


gymnasium.register("rlacd/Cut-v0", entry_point="rlacd.learn.env:CutEnv")
