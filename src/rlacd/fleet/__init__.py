"""Many meshes: limits, cache, resume; on any pool of processes."""

from rlacd.fleet.assets import ENDINGS, Asset, find_assets
from rlacd.fleet.batch import REDO, Batch, Summary, Watcher
from rlacd.fleet.order import Order

__all__ = ["ENDINGS", "REDO", "Asset", "Batch", "Order", "Summary", "Watcher", "find_assets"]
