"""Side by side with other tools, on the same meshes and by the same measure (extra ``bench``)."""

from rlacd.bench.methods import Method, make_method
from rlacd.bench.metrics import Metrics, measure
from rlacd.bench.runner import Bench, Limits, find_meshes
from rlacd.bench.store import Store, Task

__all__ = ["Bench", "Limits", "Method", "Metrics", "Store", "Task", "find_meshes", "make_method", "measure"]
