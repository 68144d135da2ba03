"""Several actors, in this process or spread over others: the same steps, in the same order, wherever they run."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from rlacd.errors import RlacdError, TrainingError
from rlacd.learn.actor import Actor, Described, Step
from rlacd.learn.options import TrainOptions

Started = tuple[Described, int]


class Actors(Protocol):
    """What the training asks of its actors; every list has one entry an actor."""

    def start(self) -> list[Started]:
        """Begin an episode each."""

    def step(self, actions: Sequence[tuple[int, int]]) -> list[Step]:
        """Cut (component, plane) each."""

    def recipes(self) -> list[dict[str, Any]]:
        """Say how to come to where each is."""

    def restore(self, recipes: Sequence[dict[str, Any]]) -> list[int]:
        """Come there; returns which component to cut next, each."""

    def close(self) -> None:
        """End the processes, if any."""


@dataclass(frozen=True)
class ActorSetting:
    """What is needed to make the actors, in whatever process."""

    folder: Path
    cache: Path
    names: tuple[str, ...]
    options: TrainOptions

    def make(self, numbers: Sequence[int]) -> list[Actor]:
        """Make some of the actors."""
        from rlacd.learn.device import pick_device
        from rlacd.learn.encoders import make_encoder
        from rlacd.learn.meshes import Solids

        options, solids = self.options, Solids(self.folder, self.cache)
        encoder = make_encoder(options.encoder, options.encoder_weights, pick_device(options.device))
        return [Actor(solids, self.names, encoder, options, number) for number in numbers]


class LocalActors:
    """Actors in this process."""

    def __init__(self, setting: ActorSetting) -> None:
        self._actors = setting.make(range(setting.options.environments))

    def start(self) -> list[Started]:
        """See `Actors`."""
        return [actor.start() for actor in self._actors]

    def step(self, actions: Sequence[tuple[int, int]]) -> list[Step]:
        """See `Actors`."""
        return [actor.step(*action) for actor, action in zip(self._actors, actions, strict=True)]

    def recipes(self) -> list[dict[str, Any]]:
        """See `Actors`."""
        return [actor.recipe() for actor in self._actors]

    def restore(self, recipes: Sequence[dict[str, Any]]) -> list[int]:
        """See `Actors`."""
        return [actor.restore(recipe) for actor, recipe in zip(self._actors, recipes, strict=True)]

    def close(self) -> None:
        """Nothing to end."""


class ProcessActors:
    """Actors spread over worker processes; worker w has the actors w, w + W, w + 2 W, ...

    Raises
    ------
    TrainingError
        On any call: a worker has died, or says what went wrong in it.
    """

    def __init__(self, setting: ActorSetting) -> None:
        count = setting.options.environments
        self._numbers = [range(w, count, setting.options.workers) for w in range(setting.options.workers)]
        self._count = count
        context = multiprocessing.get_context("spawn")
        self._pipes: list[Connection] = []
        self._processes = []
        for numbers in self._numbers:
            here, there = context.Pipe()
            process = context.Process(target=_work, args=(there, setting, numbers), daemon=True)
            process.start()
            there.close()
            self._pipes.append(here)
            self._processes.append(process)

    def start(self) -> list[Started]:
        """See `Actors`."""
        return self._ask("start", [()] * self._count)

    def step(self, actions: Sequence[tuple[int, int]]) -> list[Step]:
        """See `Actors`."""
        return self._ask("step", actions)

    def recipes(self) -> list[dict[str, Any]]:
        """See `Actors`."""
        return self._ask("recipe", [()] * self._count)

    def restore(self, recipes: Sequence[dict[str, Any]]) -> list[int]:
        """See `Actors`."""
        return self._ask("restore", [(recipe,) for recipe in recipes])

    def close(self) -> None:
        """End the processes."""
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join(timeout=10)
            if process.is_alive():
                process.terminate()

    def _ask(self, method: str, arguments: Sequence[Any]) -> list[Any]:
        answers: list[Any] = [None] * self._count
        try:
            for pipe, numbers in zip(self._pipes, self._numbers, strict=True):
                pipe.send((method, [arguments[i] for i in numbers]))
            for pipe, numbers in zip(self._pipes, self._numbers, strict=True):
                answer = pipe.recv()
                if isinstance(answer, str):
                    raise TrainingError(answer)
                for i, of_actor in zip(numbers, answer, strict=True):
                    answers[i] = of_actor
        except (EOFError, OSError) as error:
            for process in self._processes:
                process.join(timeout=1)
            codes = [process.exitcode for process in self._processes]
            raise TrainingError(
                f"a worker process died (exit codes {codes}); it may have run out of memory. Run the same command with "
                "--resume, perhaps with fewer workers, to go on from the last checkpoint."
            ) from error
        return answers


def make_actors(setting: ActorSetting) -> Actors:
    """Make the actors where the options want them."""
    return ProcessActors(setting) if setting.options.workers else LocalActors(setting)


def _work(pipe: Connection, setting: ActorSetting, numbers: Sequence[int]) -> None:
    """Serve a parent until it closes its end; runs in the worker."""
    import torch

    torch.set_num_threads(1)
    try:
        actors = setting.make(numbers)
        while True:
            method, arguments = pipe.recv()
            pipe.send([getattr(actor, method)(*given) for actor, given in zip(actors, arguments, strict=True)])
    except (EOFError, OSError, KeyboardInterrupt):
        return
    except RlacdError as error:
        pipe.send(str(error))
