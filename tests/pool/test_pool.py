"""The pool: what is asked is answered, and a process that dies, hangs or is killed disturbs no other."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from rlacd.errors import OptionError
from rlacd.pool import Pool, ProcessLimits, Request, TimeLimitError, WorkerDiedError, open_pool
from rlacd.pool.local import InProcessPool, LocalPool
from tests.pool.obedient import SERVER, pool_processes

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def server_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))


@pytest.fixture(params=["here", "local"])
def pool(request: pytest.FixtureRequest) -> Iterator[Pool]:
    with InProcessPool() if request.param == "here" else LocalPool(2) as pool:
        yield pool


@pytest.fixture
def one() -> Iterator[LocalPool]:
    with LocalPool(1) as pool:
        yield pool


def ask(what: str = "echo", **more: Any) -> Request:
    seconds = more.pop("seconds", 600)
    kept = {name: more.pop(name) for name in ("blobs", "fresh", "tries") if name in more}
    return Request(SERVER, {"what": what, **more}, **kept, limits=ProcessLimits(seconds=seconds))


def pid(pool: Pool, request: Request | None = None) -> int:
    return int(pool.submit(request or ask()).result().values["pid"])


def test_what_is_asked_is_answered_with_all_that_came_with_it(pool: Pool) -> None:
    blobs = {"nothing": b"", "a": os.urandom(3_000_000), "椅子": b"x"}
    futures = [pool.submit(ask(number=n, blobs=blobs)) for n in range(5)]
    for number, future in enumerate(futures):
        answer = future.result()
        assert answer.values["echo"]["number"] == number
        assert answer.blobs == blobs


def test_refusals_are_raised_as_what_they_are(pool: Pool) -> None:
    with pytest.raises(OptionError, match="that is too much; ask for less"):
        pool.submit(ask("refuse")).result()
    assert pid(pool)


def test_a_death_is_reported_to_its_request_only(pool: Pool) -> None:
    if isinstance(pool, InProcessPool):
        pytest.skip("no supervisor watches this process")
    well = [pool.submit(ask(number=n)) for n in range(3)]
    died = pool.submit(ask("die"))
    more = [pool.submit(ask(number=n)) for n in range(3)]
    with pytest.raises(WorkerDiedError, match="its process died of SIGKILL") as told:
        died.result()
    assert told.value.last_words == "last words"
    assert [future.result().values["echo"]["number"] for future in [*well, *more]] == [0, 1, 2] * 2
    with pytest.raises(WorkerDiedError, match="ended with code 1") as bug:
        pool.submit(ask("bug")).result()
    assert "a surprise" in bug.value.last_words


def test_a_process_that_hangs_is_ended(one: LocalPool) -> None:
    before = pid(one)
    with pytest.raises(WorkerDiedError, match=r"it took more than 0\.5 s"):
        one.submit(ask("hang", seconds=0.5)).result()
    assert not psutil.pid_exists(before)
    assert pid(one) != before


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
@pytest.mark.parametrize(("what", "seconds"), [("outlive", 600), ("outlive, holding the interpreter", 0.5)])
def test_a_process_ends_by_itself_when_who_asked_is_gone_or_its_time_is_up(
    tmp_path: Path, what: str, seconds: float
) -> None:
    mark = tmp_path / "pid"
    asking = f"ask({what!r}, mark={str(mark)!r}, seconds={seconds})"
    words = [sys.executable, "-c", f"from tests.pool.test_pool import *; LocalPool(1).submit({asking}).result()"]
    assert subprocess.run(words, check=False).returncode == -signal.SIGKILL
    until = time.monotonic() + 60
    while runs(int(mark.read_text())):
        assert time.monotonic() < until
        time.sleep(0.1)


def runs(process: int) -> bool:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    return False


def test_a_process_stays_unless_a_new_one_is_wanted(one: LocalPool) -> None:
    before = pid(one)
    assert pid(one) == before
    assert pid(one, ask(fresh=True)) != before


def test_a_second_chance_is_one(one: LocalPool, tmp_path: Path) -> None:
    begun = time.monotonic()
    with pytest.raises(TimeLimitError) as late:
        one.submit(ask("hang", seconds=2, tries=2)).result()
    assert 2 <= late.value.seconds <= time.monotonic() - begun < 4, "what takes too long would do so again"
    before = pid(one)
    assert one.submit(ask("die once", mark=str(tmp_path / "mark"), tries=2)).result().values["pid"] != before
    with pytest.raises(WorkerDiedError, match="SIGKILL"):
        one.submit(ask("die", tries=2)).result()
    with pytest.raises(OptionError, match="too much"):
        one.submit(ask("refuse", tries=2)).result()


def test_a_process_that_is_killed_from_outside_costs_nothing_but_time(one: LocalPool) -> None:
    os.kill(pid(one), signal.SIGKILL)
    assert one.submit(ask(number=7, tries=2)).result().values["echo"]["number"] == 7


def test_closing_ends_what_is_running_at_once() -> None:
    before = pool_processes()
    with LocalPool(2) as pool:
        hanging = [pool.submit(ask("hang")) for _ in range(4)]
        while len(own := [child for child in pool_processes() if child not in before]) < 2:
            time.sleep(0.05)
    assert all(future.done() for future in hanging)
    assert not any(child.is_running() for child in own)


def test_a_server_that_is_not_there_is_reported(one: LocalPool) -> None:
    with pytest.raises(WorkerDiedError, match="ended with code 1") as told:
        one.submit(Request("nowhere.at.all:Server", {})).result()
    assert "nowhere" in told.value.last_words
    assert pid(one)


def test_pools_by_what_a_command_is_given() -> None:
    with open_pool(None) as one, open_pool(0) as here, open_pool(3) as three:
        assert (one.room, three.room) == (1, 3)
        assert isinstance(here, InProcessPool)
    with pytest.raises(OptionError, match="jobs is -1"):
        open_pool(-1)
