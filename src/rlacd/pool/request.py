"""Requests to a pool and their answers: plain values and bytes, so that they can be sent to any process or machine."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeAlias

from rlacd.errors import OptionError

Values: TypeAlias = dict[str, Any]
"""Values that JSON can represent."""

Blobs: TypeAlias = Mapping[str, bytes]


@dataclass(frozen=True)
class ProcessLimits:
    """Limits of one request.

    Attributes
    ----------
    seconds : float
        Wall time.
    memory : int
        Bytes of main memory that the process may hold; 0 for no limit.

    Raises
    ------
    OptionError
        A limit is not positive.
    """

    seconds: float = 600.0
    memory: int = 4 * 2**30

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise OptionError(f"the limit of time is {self.seconds!r}; it has to be a positive number of seconds.")
        if self.memory < 0:
            raise OptionError(f"the limit of memory is {self.memory!r}; it has to be positive, or 0 for none.")


@dataclass(frozen=True, eq=False)
class Shared:
    """Bytes that many requests need: each process receives them once.

    Attributes
    ----------
    blobs
        The bytes by name.
    key
        Identifies the content.
    """

    blobs: Blobs
    key: str = field(default_factory=lambda: uuid.uuid4().hex)


@dataclass(frozen=True, eq=False)
class Request:
    """A job for a pool. It must be a pure function of its fields, since it may run twice.

    Attributes
    ----------
    server
        ``module:name`` of a factory that makes the `Server`.
    values, blobs, shared
        Inputs of the server; a process keeps shared data as long as requests name it.
    limits
        Limits; the process is ended when it exceeds them.
    threads
        Number of processors it uses.
    fresh
        Whether it needs a new process.
    """

    server: str
    values: Values
    blobs: Blobs = field(default_factory=dict)
    shared: Mapping[str, Shared] = field(default_factory=dict)
    limits: ProcessLimits = field(default_factory=ProcessLimits)
    threads: int = 1
    fresh: bool = False


@dataclass(frozen=True)
class Answer:
    """The answer of a server.

    Attributes
    ----------
    values, blobs
        Results of the server.
    worker
        Process and machine.
    """

    values: Values
    blobs: dict[str, bytes]
    worker: str


Server: TypeAlias = Callable[[Values, Blobs, Mapping[str, Shared]], tuple[Values, dict[str, bytes]]]
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


class MachineLostError(WorkerDiedError):
    """The request was lost with its machine, again and again."""


class Pool(Protocol):
    """Where requests are answered.

    Attributes
    ----------
    many_machines : bool
        Whether another machine may have room for a request that needs a lot of memory.
    """

    many_machines: bool

    @property
    def room(self) -> int:
        """Number of requests worth submitting at once; more would only queue."""

    def submit(self, request: Request) -> Future[Answer]:
        """Submit a request.

        The future raises `WorkerDiedError` if the process died or was ended, and any `RlacdError` of the server. A
        process that died is replaced; the request is not retried unless its machine was lost.
        """

    def close(self) -> None:
        """End all processes, even busy ones."""

    def __enter__(self) -> Pool:
        """Return the pool; processes start only when needed."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """See `close`."""
