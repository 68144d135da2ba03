"""Batches of meshes, with limits, a cache and resume, on any pool of processes."""

from rlacd.batch.assets import ENDINGS, Asset, find_assets
from rlacd.batch.batch import Batch, Summary, Watcher
from rlacd.batch.job_spec import JobSpec

__all__ = ["ENDINGS", "Asset", "Batch", "JobSpec", "Summary", "Watcher", "find_assets"]
