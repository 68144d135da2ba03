"""Comparison with other tools on the same meshes, by the same metrics (extra ``bench``)."""

from rlacd.bench.methods import Method, make_method
from rlacd.bench.metrics import Metrics, measure
from rlacd.bench.runner import Bench, BenchLimits, find_meshes
from rlacd.bench.store import BenchStore, BenchTask

__all__ = [
    "Bench",
    "BenchLimits",
    "BenchStore",
    "BenchTask",
    "Method",
    "Metrics",
    "find_meshes",
    "make_method",
    "measure",
]
