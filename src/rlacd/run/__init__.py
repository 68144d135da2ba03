"""What a decomposition works with: threads, time, counted work, and the caller's wish to stop."""

from rlacd.run.progress import Progress, ProgressCallback
from rlacd.run.run import Run, available_cpus
from rlacd.run.work import Work

__all__ = ["Progress", "ProgressCallback", "Run", "Work", "available_cpus"]
