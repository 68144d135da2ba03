"""Episodes played by a pool, some ahead of the learner, and consumed in order of their numbers.

Episode n is drawn from the seed and n alone, and is played by the network as it is once episode n - E has been learned
from, where E is the number of concurrent episodes. So the result does not depend on the number, place or speed of the
processes, or on the death of one: its episode is played again.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.criteria import Concavity
from rlacd.errors import TrainingError
from rlacd.learn.environment import CutEnv, Memory
from rlacd.learn.episodes import Episode, Player
from rlacd.learn.meshes import TURNS, Solids, turned
from rlacd.learn.options import TrainOptions
from rlacd.policies.encoder import Encoder
from rlacd.policies.network import Network, parse_network
from rlacd.pool import Answer, Blobs, Pool, ProcessLimits, Request, WorkerDiedError
from rlacd.solid.component import Component

LOST_IN_A_ROW = 10
"""Training stops after this many consecutive episodes that could not be played, since the meshes cannot be at fault."""

SOLIDS_TRIED = 1000
"""Training stops after this many consecutive solids without anything to cut."""

REMEMBERED = 10_000
"""Number of components of which a process remembers the cuts: a few hundred megabytes."""


class Rollouts:
    """An endless sequence of episodes of the meshes `names`.

    The caller closes the pool; `limits` are those of one episode.
    """

    def __init__(
        self,
        pool: Pool,
        solids: Solids,
        names: Sequence[str],
        options: TrainOptions,
        encoder: Encoder,
        limits: ProcessLimits,
        say: Callable[[str], None],
    ) -> None:
        self._pool, self._solids, self._names, self._options = pool, solids, names, options
        self._limits, self._say = limits, say
        self._setting = pickle.dumps((options, encoder))
        self._ahead: deque[tuple[int, str, Future[Answer]] | Episode] = deque()
        self._begun = self._without_cuts = self._lost = 0

    def begin(self, network: bytes | None, epsilon: float) -> None:
        """Start episodes until the required number is ahead.

        `network` is the file of the one that chooses cuts, None for random cuts; a share `epsilon` is random anyway.
        """
        while len(self._ahead) < self._options.environments:
            self._ahead.append(self._start(self._begun, network, epsilon))
            self._begun += 1

    def take(self) -> Episode:
        """Wait for the next episode in order.

        Raises
        ------
        TrainingError
            Many consecutive episodes had no cut, or none of them could be played.
        RlacdError
            The error of all of them, such as a missing GPU.
        """
        episode = self._played(self._ahead.popleft())
        self._without_cuts = 0 if len(episode.planes) else self._without_cuts + 1
        self._lost = self._lost + 1 if episode.ended == "lost" else 0
        if self._lost == LOST_IN_A_ROW:
            said = f"{LOST_IN_A_ROW} episodes in a row were lost with their processes; give more --memory or a longer"
            raise TrainingError(f"{said} --limit, or fewer --jobs, and use --resume.")
        if self._without_cuts == SOLIDS_TRIED:
            said = f"none of {SOLIDS_TRIED} solids drawn from {len(self._names)} meshes needs a cut"
            raise TrainingError(f"{said}; give other meshes, or a smaller threshold.")
        return episode

    def state(self) -> dict[str, NDArray[Any]]:
        """Wait for all episodes ahead, and return everything as arrays."""
        self._ahead = deque(self._played(episode) for episode in self._ahead)
        arrays = {f"ahead.{i}": np.frombuffer(self._played(e).to_bytes(), np.uint8) for i, e in enumerate(self._ahead)}
        return {"counts": np.array([self._begun, len(self._ahead), self._without_cuts]), **arrays}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._begun, ahead, self._without_cuts = (int(count) for count in arrays["counts"])
        self._ahead = deque(Episode.from_bytes(arrays[f"ahead.{i}"].tobytes()) for i in range(ahead))

    def _start(self, number: int, network: bytes | None, epsilon: float) -> tuple[int, str, Future[Answer]]:
        options = self._options
        rng = np.random.default_rng([options.seed, 1, number])  # 1 draws the mesh, 2 the cuts
        name, axis, turn = self._names[int(rng.integers(len(self._names)))], int(rng.integers(3)), int(rng.integers(4))
        values = {"name": name, "axis": axis, "degrees": TURNS[turn] if options.rotate else 0.0}
        values |= {"epsilon": epsilon, "seed": [options.seed, 2, number]}
        blobs = {"solid": self._solids.packed(name), "setting": self._setting}
        blobs |= {} if network is None else {"network": network}
        request = Request(SERVER, values, blobs, self._limits, tries=2)
        return number, name, self._pool.submit(request)

    def _played(self, episode: tuple[int, str, Future[Answer]] | Episode) -> Episode:
        if isinstance(episode, Episode):
            return episode
        number, name, future = episode
        try:
            answer = future.result()
        except WorkerDiedError as died:
            words = (died.last_words.splitlines() or [""])[-1]
            self._say(f"episode {number}, {name}, is left out: {died} {words}".rstrip())
            return Episode.empty("lost")
        return Episode.from_bytes(answer.blobs["episode"])


SERVER = "rlacd.learn.rollouts:RolloutServer"


class RolloutServer:
    """Plays episodes in a process of the pool."""

    def __init__(self, staging: Path) -> None:
        self._setting = self._weights = b""
        self._options: TrainOptions
        self._encoder: Encoder
        self._network: Network
        self._known: OrderedDict[str, tuple[Component, Memory]] = OrderedDict()

    def __call__(self, values: dict[str, Any], blobs: Blobs) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Play an episode of the ``solid``, packed by `Solids`; ``setting`` is pickled by the trainer itself."""
        self._take_over(blobs)
        key = f"{values['name']} {values['axis'] if values['degrees'] else 0} {values['degrees']}"
        known = self._known.pop(key) if key in self._known else None
        component, memory = known or (turned(blobs["solid"], values["axis"], values["degrees"]), Memory())
        env = None if component is None else CutEnv(component, Concavity(self._options.threshold), memory)
        if component is None or env is None or not env.unfinished or len(env.all) > self._options.max_parts:
            return {}, {"episode": Episode.empty("nothing").to_bytes()}
        network = self._network if "network" in blobs else None
        rng = np.random.default_rng(values["seed"])
        episode = Player(env, self._options, self._encoder, network, values["epsilon"], rng).play()
        self._known[key] = component, memory
        while sum(len(memory.met) for _, memory in self._known.values()) > REMEMBERED:
            self._known.popitem(last=False)
        return {}, {"episode": episode.to_bytes()}

    def _take_over(self, blobs: Blobs) -> None:
        """Rebuild whatever changed since the last request."""
        if blobs["setting"] != self._setting:
            self._setting, self._weights = blobs["setting"], b""
            self._options, self._encoder = pickle.loads(self._setting)
            self._known.clear()
        if blobs.get("network", self._weights) != self._weights:
            self._weights = blobs["network"]
            self._network = parse_network(self._weights)
