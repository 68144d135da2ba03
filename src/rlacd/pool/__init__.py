"""Watched processes that answer requests one at a time: in this process, on this machine, or on a Ray cluster.

A request and its answer are plain values and bytes, so that they can be sent to any process or machine. `open_pool`
opens a `rlacd.pool.local.LocalPool`, an `InProcessPool` or a `rlacd.pool.on_ray.RayPool`.

Pools of the standard library and of other packages share a pipe or a lock between their processes: killing one that
holds it stops the whole pool (`concurrent.futures` and loky fail every other request), and none bounds memory or ends
the children of a process (pebble). Here every process has its own pipe, so that its death affects no other.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, TypeAlias

Values: TypeAlias = dict[str, Any]
"""Values that JSON can represent."""

Blobs: TypeAlias = Mapping[str, bytes]


@dataclass(frozen=True)
class ProcessLimits:
    """Limits of one request."""

    seconds: float = 600.0
    """Wall time."""
    memory: int = 4 * 2**30
    """Bytes of main memory that the process may hold; 0 for no limit."""


@dataclass(frozen=True, eq=False)
class Request:
    """A job for a pool. It must be a pure function of its fields, since it may run twice."""

    server: str
    """``module:name`` of a factory that makes the `Server`."""
    values: Values
    blobs: Blobs = field(default_factory=dict)
    limits: ProcessLimits = field(default_factory=ProcessLimits)
    """Limits; the process is ended when it exceeds them."""
    threads: int = 1
    """Number of processors it uses."""
    fresh: bool = False
    """Whether it needs a new process."""
    tries: int = 1
    """How often it is tried, in a new process each, if its process dies before its time is up: that may be the fault of
    an earlier request or of other processes."""


@dataclass(frozen=True)
class Answer:
    """The answer of a server."""

    values: Values
    blobs: dict[str, bytes]
    """Results of the server."""
    worker: str
    """Process and machine."""


Server: TypeAlias = Callable[[Values, Blobs], tuple[Values, dict[str, bytes]]]
"""Answers requests. An `RlacdError` that it raises is passed on to the caller; any other exception ends its process."""

MakeServer: TypeAlias = Callable[[Path], Server]
"""Called once per process, with a folder that is removed when the process ends."""


class WorkerDiedError(Exception):
    """A process ended before it answered.

    Attributes
    ----------
    reason : str
        Why, in the same words every time.
    last_words : str
        The end of its stderr.
    seconds : float
        How long it had the request.
    """

    seconds = 0.0

    def __init__(self, reason: str, last_words: str = "") -> None:
        super().__init__(reason, last_words)  # both, or pickling loses one
        self.reason = reason
        self.last_words = last_words

    def __str__(self) -> str:
        return self.reason


class TimeLimitError(WorkerDiedError):
    """A process was ended because it took too long: it would again, so it gets no second try."""


class Pool(AbstractContextManager["Pool"]):
    """Where requests are answered; a context that ends all processes. They start only when needed.

    Attributes
    ----------
    many_machines : bool
        Whether another machine may have room for a request that needs a lot of memory.
    """

    many_machines = False

    @property
    @abstractmethod
    def room(self) -> int:
        """Number of requests worth submitting at once; more would only queue."""

    @abstractmethod
    def submit(self, request: Request) -> Future[Answer]:
        """Submit a request.

        The future raises `WorkerDiedError` if the process died or was ended, and any `RlacdError` of the server. A
        process that died is replaced.
        """

    @abstractmethod
    def close(self) -> None:
        """End all processes, even busy ones; what was submitted and not answered fails."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def open_pool(jobs: int | None, ray: str | None = None) -> Pool:
    """Open a pool.

    Parameters
    ----------
    jobs : int, optional
        Processes on this machine, one by default; 0 to run in the calling process. For a cluster started here, its
        number of processors, all by default.
    ray : str, optional
        Address of a cluster.

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    OptionError
        There is no cluster at the address, or the number of processes is negative.
    """
    if ray is not None:
        from rlacd.pool.on_ray import RayPool

        return RayPool(ray, jobs)
    from rlacd.pool.local import InProcessPool, LocalPool

    return InProcessPool() if jobs == 0 else LocalPool(1 if jobs is None else jobs)
