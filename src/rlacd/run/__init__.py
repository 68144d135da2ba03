"""What a decomposition works with: threads, time, counted work, and the caller's wish to stop."""

from rlacd.run.run import Apart, Begun, Progress, ProgressCallback, Run, available_cpus
from rlacd.run.work import Work

__all__ = ["Apart", "Begun", "Progress", "ProgressCallback", "Run", "Work", "available_cpus"]
