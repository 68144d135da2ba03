"""Watched processes that answer requests one at a time: in this process, on this machine, or on a Ray cluster."""

from rlacd.pool.in_process import InProcessPool
from rlacd.pool.local import LocalPool
from rlacd.pool.open import open_pool
from rlacd.pool.request import (
    Answer,
    Blobs,
    MachineLostError,
    Pool,
    ProcessLimits,
    Request,
    Shared,
    TimeLimitError,
    WorkerDiedError,
)
from rlacd.pool.retry import answers, submit_with_retry

__all__ = [
    "Answer",
    "Blobs",
    "InProcessPool",
    "LocalPool",
    "MachineLostError",
    "Pool",
    "ProcessLimits",
    "Request",
    "Shared",
    "TimeLimitError",
    "WorkerDiedError",
    "answers",
    "open_pool",
    "submit_with_retry",
]
