"""Side by side with other tools, on the same meshes and by the same measure (extra ``bench``)."""

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
