"""Watched processes that do one request after another: here, on this machine, or on the machines of a Ray cluster."""

from rlacd.pool.again import answers, submit_twice
from rlacd.pool.here import HerePool
from rlacd.pool.local import LocalPool
from rlacd.pool.open import open_pool
from rlacd.pool.request import Answer, Blobs, Limits, MachineLostError, Pool, Request, Shared, WorkerDiedError

__all__ = [
    "Answer",
    "Blobs",
    "HerePool",
    "Limits",
    "LocalPool",
    "MachineLostError",
    "Pool",
    "Request",
    "Shared",
    "WorkerDiedError",
    "answers",
    "open_pool",
    "submit_twice",
]
