"""Many meshes: processes on one machine, Ray on many; limits, cache, resume."""

from rlacd.fleet.assets import ENDINGS, Asset, find_assets
from rlacd.fleet.batch import REDO, Batch, Summary, Watcher
from rlacd.fleet.local import LocalEngine
from rlacd.fleet.order import Order
from rlacd.fleet.worker import Limits

__all__ = ["ENDINGS", "REDO", "Asset", "Batch", "Limits", "LocalEngine", "Order", "Summary", "Watcher", "find_assets"]
