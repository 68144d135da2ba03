"""What a decomposition would take on other numbers of cores, told from the trace of one.

Each span of a trace becomes slices that hold the interpreter's lock and slices that do not, as many as it called
kernels; the loops of kernels are divided among the threads. Cores that slow each other down are not modelled.
"""

from __future__ import annotations

import heapq
import json
from collections import deque
from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from benchmarks.cli import PATH
from benchmarks.tables import Table


class Cost(NamedTuple):
    """CPU seconds: with the lock and without, of that in kernels' loops; of all threads in them; and the kernels."""

    locked: float
    unlocked: float
    in_loops: float
    of_loops: float
    kernels: float


SLICES = 300
"""At most, of a span: more make no difference."""

LOOK = 2e-5
"""Seconds after which a thread with nothing to do looks again."""


class Step(NamedTuple):
    """Of the first thread: to "do" something, "map" items, "begin" a task, or "wait" for the task of a number."""

    kind: str
    costs: list[Cost]
    number: int | None = None


def steps_of(spans: list[dict[str, Any]]) -> Iterator[Step]:
    """The first thread's steps."""
    spans = sorted(spans, key=lambda span: span["ts"])
    whole = next(span for span in spans if span["cat"] == "run")
    items = deque(span for span in spans if span["cat"] == "item")
    begun = {span["args"]["number"]: span for span in spans if span["cat"] == "begun"}
    at = _counted(whole, 0)
    for span in spans:
        if span["tid"] == whole["tid"] and span["cat"] in ("map", "begin", "wait"):
            number, inside, end = span["args"]["number"], list[dict[str, Any]](), span["ts"] + span["dur"]
            if span["cat"] == "map":
                while items and items[0]["ts"] < end:
                    inside.append(items.popleft())
            elif span["cat"] == "begin" and number in begun:  # otherwise it was dropped
                inside = [begun[number]]
            own = sum(_cost(one) for one in inside if one["tid"] == whole["tid"] and one["ts"] < end)
            yield Step("do", [Cost(*(_counted(span, 1) - at - own))])
            yield Step(span["cat"], [Cost(*_cost(one)) for one in inside], number)
            at = _counted(span, 1)
    yield Step("do", [Cost(*(_counted(whole, 1) - at))])


def _counted(span: dict[str, Any], end: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    unlocked, *others = span["args"]["end" if end else "begin"]
    return np.array([(span["tts"] + end * span["tdur"]) / 1e6 - unlocked, unlocked, *others])


def _cost(span: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return _counted(span, 1) - _counted(span, 0)


class _Task:
    """Of a pool; `is_done` once it is."""

    def __init__(self, cost: Cost) -> None:
        self.cost, self.is_done = cost, False


class _Machine:
    """As many workers as cores, one lock, and a first thread that hands out tasks and waits for them."""

    def __init__(self, threads: int) -> None:
        self.now = self.lock_is_free = 0.0
        self._threads = threads
        self._waiting: deque[_Task] = deque()
        self._number = count()
        self._workers = [self._worker() for _ in range(threads)]
        self._ready: list[tuple[float, int, Iterator[float]]] = []  # threads, by when they go on

    def run(self, steps: Iterable[Step]) -> float:
        """Seconds that the steps take."""
        first = self._first(steps)
        for thread in (first, *self._workers):
            self._wake(thread, 0.0)
        while True:
            self.now, _, thread = heapq.heappop(self._ready)
            at = next(thread, None)
            if at is not None:
                self._wake(thread, at)
            elif thread is first:
                return self.now

    def _wake(self, thread: Iterator[float], at: float) -> None:
        heapq.heappush(self._ready, (at, next(self._number), thread))

    def _work(self, cost: Cost) -> Iterator[float]:
        slices = round(min(max(cost.kernels, 1), SLICES))
        free = cost.unlocked - cost.in_loops + cost.of_loops / self._threads
        for _ in range(slices):
            self.lock_is_free = max(self.now, self.lock_is_free) + max(cost.locked, 0.0) / slices
            yield self.lock_is_free
            yield self.now + max(free, 0.0) / slices

    def _worker(self) -> Iterator[float]:
        while True:
            if self._waiting:
                task = self._waiting.popleft()
                yield from self._work(task.cost)
                task.is_done = True
            else:
                yield self.now + LOOK

    def _first(self, steps: Iterable[Step]) -> Iterator[float]:
        begun: dict[int | None, list[_Task]] = {}
        for kind, costs, number in steps:
            if kind == "do":
                yield from self._work(costs[0])
                continue
            tasks = [_Task(cost) for cost in costs] if kind != "wait" else begun[number]
            if kind == "map":  # the first thread takes part, whatever else waits
                self._waiting.extendleft(reversed(tasks))
            elif kind == "begin":
                self._waiting += tasks
                begun[number] = tasks
                continue
            while not all(task.is_done for task in tasks):
                yield self.now + LOOK


def replayed(steps: Iterable[Step], threads: int) -> float:
    """Seconds that the steps take on as many cores as threads."""
    return _Machine(threads).run(steps)


@click.command()
@click.argument("traces", type=PATH, nargs=-1, required=True)
@click.option("--threads", default="1 2 4 8 16", show_default=True, help="Numbers of cores.")
def app(traces: tuple[Path, ...], threads: str) -> None:
    """Tell what decompositions would take on other numbers of cores; the traced time stands beside it.

    TRACES are written by RLACD_TRACE=FILE, best on two threads or more.

    \b
    RLACD_TRACE=al.json rlacd decompose al.ply --threads 2 && python -m benchmarks replay al.json --threads "2 8"
    """
    numbers = [int(number) for number in threads.split()]
    rows = []
    for path in traces:
        spans = json.loads(path.read_text())["traceEvents"]
        steps = list(steps_of(spans))
        sums = np.sum([cost for step in steps for cost in step.costs], axis=0)
        first = np.sum([step.costs[0] for step in steps if step.kind == "do"], axis=0)[:3] @ (1, 1, -1)
        traced = next(span["dur"] for span in spans if span["cat"] == "run") / 1e6
        cpu = sums[0] + sums[1] - sums[2] + sums[3]
        rows.append([path.stem, traced, cpu, sums[0], first, *(replayed(steps, number) for number in numbers)])
    rows.append(["all", *np.sum([row[1:] for row in rows], axis=0)])
    header = ["trace", "traced s", "CPU s", "lock held, s", "one thread only, s", *(f"{n} cores" for n in numbers)]
    click.echo(Table(header, [[row[0], *(f"{value:.2f}" for value in row[1:])] for row in rows]))
