"""Open the pool that ``--jobs`` and ``--ray`` ask for."""

from __future__ import annotations

from rlacd.pool.in_process import InProcessPool
from rlacd.pool.local import LocalPool
from rlacd.pool.request import Pool


def open_pool(jobs: int | None, ray: str | None = None) -> Pool:
    """Open a pool.

    Parameters
    ----------
    jobs : int, optional
        Processes on this machine; 0 to run in the calling process. For a cluster started here, its number of
        processors, all by default.
    ray : str, optional
        Address of a cluster.

    Raises
    ------
    MissingExtraError
        Ray is not installed.
    OptionError
        There is no cluster at the address, or the number of processes is negative.
    """
    if ray is not None:
        from rlacd.pool.on_ray import RayPool

        return RayPool(ray, jobs)
    return InProcessPool() if jobs == 0 else LocalPool(1 if jobs is None else jobs)
