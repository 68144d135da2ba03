"""Comparison with other tools on the same meshes, by the same metrics (extra ``bench``)."""

from benchmarks.methods import Method, make_method
from benchmarks.metrics import Metrics, measure
from benchmarks.runner import Bench, BenchLimits, find_meshes
from benchmarks.store import BenchStore, BenchTask

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
