"""How many threads run: as many as were asked for, in whichever thread or process they start."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from functools import partial

import pytest

from rlacd.run import Run, available_cpus

ON_LINUX = sys.platform.startswith("linux")

COUNT_THREADS = """
import os, sys, time
import trimesh
import rlacd
before = len(os.listdir("/proc/self/task"))
body = trimesh.creation.torus(1.0, 0.4, major_sections=160, minor_sections=80)
result = rlacd.decompose(body, quality="fast", threshold=0.3, threads=int(sys.argv[1]))
time.sleep(0.2)  # a thread that was joined may still be listed
print(len(os.listdir("/proc/self/task")) - before, len(os.sched_getaffinity(0)))
"""


def threads_started(threads: int) -> tuple[int, int]:
    """Count the threads that a process has more of after a decomposition, and the processors it may use then."""
    run = [sys.executable, "-c", COUNT_THREADS, str(threads)]
    started, allowed = subprocess.run(run, capture_output=True, text=True, check=True).stdout.split()
    return int(started), int(allowed)


@pytest.mark.slow
@pytest.mark.skipif(not ON_LINUX or available_cpus() < 2, reason="needs Linux and two processors")
def test_one_thread_is_one_thread_for_booleans_too() -> None:
    """manifold3d has a pool of its own as soon as a surface has ten thousand triangles."""
    assert threads_started(1) == (0, available_cpus())


@pytest.mark.skipif(not ON_LINUX, reason="processors are given to processes on Linux")
def test_as_many_workers_as_the_process_may_use() -> None:
    assert available_cpus() == len(os.sched_getaffinity(0))
    with Run() as run:
        assert run.threads == available_cpus()


def test_results_come_in_the_order_of_the_items() -> None:
    with Run(3) as run:
        assert run.map(lambda x: x * x, range(100)) == [x * x for x in range(100)]


def test_items_do_not_wait_behind_what_was_begun_before() -> None:
    may_end = threading.Event()
    with Run(2) as run:
        begun = [run.start(may_end.wait) for _ in range(4)]
        assert run.map(len, ["a", "bb"]) == [1, 2]
        may_end.set()
        assert all(run.result(one) for one in begun)


def test_one_thread_does_what_was_begun_when_it_is_asked_for() -> None:
    done: list[int] = []
    with Run(1) as run:
        first, second = (run.start(partial(done.append, number)) for number in range(2))
        assert not done
        run.result(second)
        run.drop([first])
    assert done == [1]
