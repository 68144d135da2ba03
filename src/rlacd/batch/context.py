"""What every job of a batch shares."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from rlacd.batch.job_spec import JobSpec
from rlacd.batch.store import ResultStore
from rlacd.pool import ProcessLimits, Shared


@dataclass(frozen=True)
class BatchContext:
    """What every job of a batch shares.

    Attributes
    ----------
    spec
        What is done to a mesh.
    limits
        Limits for each mesh.
    fallback
        Whether a mesh that fails gets its convex hull instead.
    out
        Folder or address of the results.
    store
        The store opened for `out`.
    stop
        Once set, no further mesh is started.
    owns
        Tells of a file among the results whether an earlier run wrote it.
    shared
        What all processes need: the network, if the policy is a file.
    """

    spec: JobSpec
    limits: ProcessLimits
    fallback: bool
    out: str
    store: ResultStore
    owns: Callable[[str], bool] = lambda name: False
    stop: threading.Event = field(default_factory=threading.Event)
    shared: dict[str, Shared] = field(default_factory=dict)
