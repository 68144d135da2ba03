"""What every task of a batch needs."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from rlacd.batch.job_spec import JobSpec
from rlacd.batch.store import ResultStore
from rlacd.pool import ProcessLimits, Shared


@dataclass(frozen=True)
class BatchContext:
    """What every task needs.

    Attributes
    ----------
    order
        What is done to a mesh.
    limits
        What it may take.
    fallback
        Whether a mesh that fails is given its convex hull.
    out
        Folder or address of the results.
    store
        The same, open.
    stop
        Once it is set no further mesh is begun.
    shared
        What all processes need: the network of a policy that is a file.
    """

    order: JobSpec
    limits: ProcessLimits
    fallback: bool
    out: str
    store: ResultStore
    stop: threading.Event = field(default_factory=threading.Event)
    shared: dict[str, Shared] = field(default_factory=dict)
