"""What a pool is asked and what comes back: plain values and bytes, so that they travel to any process or machine."""

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
"""What JSON can say."""

Blobs: TypeAlias = Mapping[str, bytes]


@dataclass(frozen=True)
class ProcessLimits:
    """What one request may take.

    Attributes
    ----------
    seconds : float
        Wall time.
    memory : int
        Bytes of main memory that its process holds; 0 for no limit.

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
    """Bytes that many requests need: every process is given them once.

    Attributes
    ----------
    blobs
        The bytes by name.
    key
        Tells them from all others.
    """

    blobs: Blobs
    key: str = field(default_factory=lambda: uuid.uuid4().hex)


@dataclass(frozen=True, eq=False)
class Request:
    """One thing to do. It has to be a pure function of what is written here, since it may be done twice.

    Attributes
    ----------
    server
        Who does it: ``module:name`` of what makes a `Server`.
    values, blobs, shared
        What the server is given; a process keeps what is shared as long as requests name it.
    limits
        What it may take; its process is ended when it takes more.
    threads
        Processors it uses.
    fresh
        Whether it gets a new process.
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
    """What a server has said.

    Attributes
    ----------
    values, blobs
        Of the server.
    worker
        Process and machine.
    """

    values: Values
    blobs: dict[str, bytes]
    worker: str


Server: TypeAlias = Callable[[Values, Blobs, Mapping[str, Shared]], tuple[Values, dict[str, bytes]]]
"""Answers requests. An `RlacdError` that it raises is raised to whoever asked; anything else ends its process."""

MakeServer: TypeAlias = Callable[[Path], Server]
"""Called once a process, with a folder that is removed with it."""


class WorkerDiedError(Exception):
    """A process has ended before its answer.

    Attributes
    ----------
    reason : str
        Why, in words that are the same every time.
    last_words : str
        The end of what it said on stderr.
    """

    def __init__(self, reason: str, last_words: str = "") -> None:
        super().__init__(reason, last_words)  # both, or a pickle loses one
        self.reason = reason
        self.last_words = last_words

    def __str__(self) -> str:
        return self.reason


class MachineLostError(WorkerDiedError):
    """Machine after machine was lost with the request."""


class Pool(Protocol):
    """Where requests are done.

    Attributes
    ----------
    many_machines : bool
        Whether there may be room on another machine for what needs much of one.
    """

    many_machines: bool

    @property
    def room(self) -> int:
        """Requests that are worth handing over at a time: more only wait here."""

    def submit(self, request: Request) -> Future[Answer]:
        """Have a request done.

        The future raises `WorkerDiedError` if the process died or was ended, and any `RlacdError` of the server. A
        process that died is replaced; the request is not tried again, unless its machine was lost.
        """

    def close(self) -> None:
        """End all processes, whatever they are doing."""

    def __enter__(self) -> Pool:
        """Nothing is started before it is needed."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """See `close`."""
