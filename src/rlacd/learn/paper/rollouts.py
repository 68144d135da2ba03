"""Episodes played by a pool, some ahead of the learner, and consumed in order of their numbers.

Episode n is drawn from the seed and n alone, and is played by the network as of the moment when episode n - E has been
consumed, where E is the number of concurrent episodes. So the result of learning does not depend on the number, place
or speed of the processes, or on the death of one: its episode is played again.
"""

from __future__ import annotations

import dataclasses
import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.errors import TrainingError
from rlacd.learn.meshes import SOLID, Solids
from rlacd.learn.paper.episodes import TRIES, Start, draw_start, nothing_to_cut
from rlacd.learn.paper.options import TrainOptions
from rlacd.learn.paper.record import Record
from rlacd.learn.paper.rollout_server import SERVER
from rlacd.pool import Answer, Pool, ProcessLimits, Request, Shared, WorkerDiedError, submit_with_retry

LOST = 10
"""Training stops after this many consecutive episodes that could not be played, since the meshes cannot be at fault."""

MESH, ACT = 1, 2
"""Random streams of an episode."""


@dataclass(frozen=True)
class Acting:
    """How cuts are chosen.

    Attributes
    ----------
    network : Shared or None
        Weights of the Q network; None for random cuts.
    epsilon : float
        Fraction of random cuts in any case.
    """

    network: Shared | None
    epsilon: float


class Rollouts:
    """An endless sequence of episodes.

    Parameters
    ----------
    pool : Pool
        Closed by the caller.
    solids : Solids
    names : sequence of str
        The meshes to draw from.
    options : TrainOptions
    limits : ProcessLimits
        Limits of one episode.
    say : callable
        Receives messages about episodes that could not be played.
    """

    def __init__(
        self,
        pool: Pool,
        solids: Solids,
        names: Sequence[str],
        options: TrainOptions,
        limits: ProcessLimits,
        say: Callable[[str], None],
    ) -> None:
        self._pool, self._solids, self._names, self._options = pool, solids, names, options
        self._limits, self._say = limits, say
        setting = {"options": json.dumps(dataclasses.asdict(options)).encode()}
        if options.encoder_weights:
            setting["encoder"] = Path(options.encoder_weights).read_bytes()
        self._setting = Shared(setting)
        self._ahead: deque[_Episode | Record] = deque()
        self._begun = 0
        self._without_cuts = 0
        self._lost = 0

    def begin(self, acting: Acting) -> None:
        """Start episodes until the required number is ahead."""
        while len(self._ahead) < self._options.environments:
            self._ahead.append(self._episode(self._begun, acting))
            self._begun += 1

    def take(self) -> Record:
        """Wait for the next episode in order and return it; episodes without a cut are skipped.

        Raises
        ------
        TrainingError
            Many consecutive episodes had no cut, or none of them could be played.
        RlacdError
            The error of all of them, such as a missing GPU.
        """
        record = self._record(self._ahead.popleft())
        self._without_cuts = 0 if record.cuts else self._without_cuts + 1
        self._lost = self._lost + 1 if record.how == "lost" else 0
        if self._lost == LOST:
            raise TrainingError(
                f"{LOST} episodes in a row were lost with their processes; give more --memory or a longer --limit, or "
                "fewer --jobs, and use --resume."
            )
        if self._without_cuts == TRIES:
            raise nothing_to_cut(TRIES, len(self._names))
        return record

    def state(self) -> dict[str, NDArray[Any]]:
        """Wait for all episodes ahead, and return everything as arrays."""
        self._ahead = deque(self._record(episode) for episode in self._ahead)
        arrays: dict[str, NDArray[Any]] = {"counts": np.array([self._begun, len(self._ahead), self._without_cuts])}
        for i, record in enumerate(self._ahead):
            assert isinstance(record, Record)
            arrays |= {f"{i}.{name}": array for name, array in record.arrays().items()}
        return arrays

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._begun, ahead, self._without_cuts = (int(count) for count in arrays["counts"])
        fields = [field.name for field in dataclasses.fields(Record)]
        self._ahead = deque(Record.of({name: arrays[f"{i}.{name}"] for name in fields}) for i in range(ahead))

    def _episode(self, number: int, acting: Acting) -> _Episode:
        options = self._options
        start = draw_start(self._names, options.rotate, np.random.default_rng([options.seed, MESH, number]))
        values = {
            "axis": start.axis,
            "degrees": start.degrees,
            "epsilon": acting.epsilon,
            "seed": [options.seed, ACT, number],
        }
        shared = {"setting": self._setting} | ({} if acting.network is None else {"network": acting.network})
        request = Request(SERVER, values, self._solids.files(start.name), shared, self._limits)
        return _Episode(number, start, submit_with_retry(self._pool, request))

    def _record(self, episode: _Episode | Record) -> Record:
        if isinstance(episode, Record):
            return episode
        try:
            answer = episode.future.result()
        except WorkerDiedError as died:
            words = (died.last_words.splitlines() or [""])[-1]
            self._say(f"episode {episode.number}, {episode.start.name}, is left out: {died} {words}".rstrip())
            return Record.empty("lost")
        if SOLID in answer.blobs:
            self._solids.keep(episode.start.name, answer.blobs[SOLID])
        return Record.from_bytes(answer.blobs["record"])


@dataclass(frozen=True)
class _Episode:
    """An episode in progress."""

    number: int
    start: Start
    future: Future[Answer]
