"""A run: its threads, its account of work, which is the same for any number of them, its memory, `RLACD_TRACE`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

import rlacd
from rlacd import cut_and_merge, memory
from rlacd.errors import MeshDataError
from rlacd.io.read.load import load_mesh
from rlacd.repair.repair import repair
from rlacd.run import Run, Work, available_cpus
from tests.hulls import assert_same_hulls
from tests.shapes import box, trimesh_of
from tests.shapes_large import screws, sponge

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
    def late(item: int) -> int:
        time.sleep(0.02 if item % 3 == 0 else 0)  # those after it are done earlier
        return item * item

    with Run(3) as run:
        assert run.map(late, range(30)) == [item * item for item in range(30)]


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


PRICES = st.lists(st.floats(0, 50), max_size=40)


def test_work_that_is_abandoned_ends_at_its_next_step() -> None:
    began = threading.Event()

    def work(own: Run) -> None:
        while own.work.pay(1):
            began.set()

    with Run(2) as run:
        apart = run.apart(work)
        assert began.wait(10)
        run.abandon([apart])
        assert apart.account.done > 0
    assert run.work.done == 0  # nobody paid


@given(st.floats(0, 200), PRICES)
def test_no_more_is_spent_than_there_is(most: float, prices: list[float]) -> None:
    work = Work(most)
    paid = [price for price in prices if work.pay(price)]
    assert sum(paid) <= work.done <= most
    assert work.is_spent == (len(paid) < len(prices))
    assert paid == prices[: len(paid)]  # once something was refused, so is all that follows


@given(st.floats(0, 200), st.floats(0, 200), PRICES)
def test_an_allowance_is_part_of_the_account(most: float, units: float, prices: list[float]) -> None:
    outer = Run(1)
    run = outer.result(outer.apart(lambda own: own, most).begun)
    with run.limited(units, cuts="cut"):
        for price in prices:
            run.work.pay(price)
        spent, used_up = run.work.done, run.work.is_spent
        assert spent <= units
    assert run.work.done == spent <= most
    assert not run.work.is_spent
    assert run.cut_short == ({"cut"} if used_up else set())


def crossing() -> Any:
    return screws(40, sides=6)


def grate() -> trimesh.Trimesh:
    holes = [box((i, j, -1), (i + 0.7, j + 0.7, 1)) for i in range(6) for j in range(6)]
    return trimesh_of(box((-0.3, -0.3, 0), (6, 6, 0.2)) - Manifold.batch_boolean(holes, OpType.Add))


@pytest.mark.parametrize(
    "shape",
    [*(pytest.param(shape, marks=pytest.mark.nightly) for shape in (grate, lambda: sponge(2))), crossing],
)
@pytest.mark.promise("bounded")
def test_the_default_stays_within_its_account(shape: Callable[[], Any]) -> None:
    solid = shape()
    one, three = (rlacd.decompose(solid, threads=threads) for threads in (1, 3))
    fast = rlacd.decompose(solid, quality="fast")
    search = one.report.search
    assert 0 < search.work <= search.allowed
    assert search.work == three.report.search.work
    assert len(one) <= len(fast)
    assert_same_hulls(one, three)


@pytest.mark.slow
def test_a_pass_whose_merging_is_cut_short_meets_the_threshold_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    solid = sponge(2)
    whole = rlacd.decompose(solid, quality="fast")
    monkeypatch.setattr(cut_and_merge, "MOST_MERGING", 1e5)
    short = rlacd.decompose(solid, quality="fast")
    assert len(short) > len(whole)
    assert short.report.concavity.max <= 0.05
    for result, expected in ((whole, False), (short, True)):
        assert any("merging stopped" in warning for warning in result.report.warnings) == expected


def test_a_trace_holds_the_work_of_all_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
    monkeypatch.setenv("RLACD_TRACE", str(tmp_path / "missing" / "torus.json"))
    with pytest.raises(rlacd.OutputError, match="correct RLACD_TRACE"):
        rlacd.decompose(torus, progress=lambda _: pytest.fail("work was begun"))
    monkeypatch.setenv("RLACD_TRACE", str(tmp_path / "torus.json"))
    rlacd.decompose(torus, threads=2)
    spans = json.loads((tmp_path / "torus.json").read_text())["traceEvents"]
    (whole,) = (span for span in spans if span["cat"] == "run")
    assert {"repair", "cut", "merge", "search", "measure"} <= {s["name"] for s in spans if s["cat"] == "stage"}
    assert all(whole["ts"] <= s["ts"] and s["ts"] + s["dur"] <= whole["ts"] + whole["dur"] + 1 for s in spans)
    assert len({span["tid"] for span in spans}) in (2, 3)
    begun, waited = ({s["args"]["number"] for s in spans if s["cat"] == kind} for kind in ("begin", "wait"))
    assert None not in begun
    assert set() != waited - {None} <= begun


def test_what_is_left_is_no_more_than_the_machine_has() -> None:
    assert 0 < memory.memory_left() <= psutil.virtual_memory().total


@pytest.mark.parametrize("kind", ["ply", "stl", "obj"])
def test_a_file_that_declares_too_much_is_refused_before_it_is_parsed(kind: str, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / f"ball.{kind}"
    ball = trimesh.creation.icosphere(3)
    ball.export(path)
    monkeypatch.setattr(memory, "_UNQUESTIONED", 0)
    monkeypatch.setattr(memory, "memory_left", lambda: len(ball.faces) * memory.BYTES_READ - 1)
    monkeypatch.setattr(np, "frombuffer", lambda *_, **__: pytest.fail("it was parsed"))
    with pytest.raises(
        MeshDataError, match=r"ball\.\w+ has 1,280 triangles, which need about 0\.0 GB of memory"
    ) as error:
        load_mesh(path)
    assert "simplify it first" in str(error.value)


def test_a_closed_mesh_needs_less_than_one_that_has_to_be_repaired(monkeypatch) -> None:
    ball = trimesh.creation.icosphere(3)
    monkeypatch.setattr(memory, "_UNQUESTIONED", 0)
    monkeypatch.setattr(memory, "memory_left", lambda: len(ball.faces) * memory.BYTES_READ)
    assert repair(load_mesh(ball)).bodies[0].step == "closed"
    opened = load_mesh((ball.vertices, ball.faces[1:]))
    with pytest.raises(MeshDataError, match="1,279 triangles"):
        repair(opened)


@pytest.mark.parametrize("version", [1, 2])
def test_control_groups_limit_what_is_left(version: int, tmp_path: Path, monkeypatch) -> None:
    names = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"]
    names = ["memory.max", "memory.current", "inactive_file"] if version == 2 else names
    root = tmp_path / "memory" if version == 1 else tmp_path
    group = root / "outer" / "inner"
    group.mkdir(parents=True)
    for folder, limit in ((group, "max" if version == 2 else str(2**63)), (group.parent, "1000000")):
        (folder / names[0]).write_text(limit + "\n")
        (folder / names[1]).write_text("900000\n")
        (folder / "memory.stat").write_text(f"cache 5\n{names[2]} 40000\n")
    line = "0::/outer/inner" if version == 2 else "4:cpu,memory:/outer/inner"
    read = Path.read_text
    monkeypatch.setattr(memory, "_CGROUPS", tmp_path)
    monkeypatch.setattr(
        Path, "read_text", lambda self, *a, **k: line if str(self) == "/proc/self/cgroup" else read(self, *a, **k)
    )
    assert memory.memory_left() == 140_000
