"""Whenever the work is stopped, what is returned covers the input, soon, and the report says what it is."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh

import rlacd
from rlacd import _native
from rlacd.fit import LengthFit
from rlacd.io.read.load import load_mesh
from rlacd.run import Run
from rlacd.solid.cover import MOST_HULLS, cover
from rlacd.solid.distance import hull_distances, hull_union
from rlacd.solid.hull import Hull
from tests.hulls import assert_covers, assert_same_hulls
from tests.shapes_large import LARGE, Mesh, boxes, bristles, noisy_ball, screws, sheet, spiked_ball, sponge, terrain

SMALL: dict[str, Mesh] = {
    "boxes": boxes(12),
    "bristles": bristles(6),
    "screws": screws(5, sides=6),
    "sponge": sponge(1),
    "spike": spiked_ball(1e6, 200),
    "terrain": terrain(8),
    "sheet": sheet(60),
    "ball": noisy_ball(200, 0.05),
}

LONG = {"ball", "sheet", "terrain", "screws"}
"""Those of them that take more than a second to stop at every poll tried."""

PATIENCE = 30.0
"""Seconds beyond the promise that a busy machine may take."""


@pytest.fixture
def polls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Stops the next decomposition at the poll whose number is put in here: no time is needed for that."""
    wanted: list[int] = []
    enter = Run.__enter__

    def counting(self: Run) -> Run:
        enter(self)
        if wanted:
            self.stop.trip_after(wanted[0])
        return self

    monkeypatch.setattr(Run, "__enter__", counting)
    return wanted


WHOLE = {"quality": "balanced", "search_steps": 4}
STAGES_OF_THEIR_OWN = [
    {"max_hulls": 3},
    {"max_vertices": 8, "max_faces": 12},
    {"max_vertices": 5},
    {"criterion": rlacd.NavigableSpace(0.1, 0.1)},
    {"merge": False},
    {"threshold_abs": 0.05},
    {"quality": "fast", "threads": 3},
]


@pytest.mark.parametrize(
    ("name", "ratio", "options"),
    [pytest.param(n, 4, WHOLE, marks=pytest.mark.slow) if n in LONG else (n, 2.3, WHOLE) for n in SMALL]
    + [pytest.param(name, 1.2, WHOLE, marks=pytest.mark.nightly) for name in SMALL]
    + [
        pytest.param("screws", 8.4, options, marks=pytest.mark.slow, id=str(options)) for options in STAGES_OF_THEIR_OWN
    ],
)
@pytest.mark.promise("timeout")
def test_stopped_at_any_poll_the_hulls_cover_the_input(
    polls: list[int], name: str, ratio: float, options: dict[str, Any]
) -> None:
    """At polls close together in the beginning, where the stages change quickly, until it comes to its end."""
    stages = set()
    for number in (round(ratio**k) for k in itertools.count()):
        polls[:] = [number]
        result = rlacd.decompose(SMALL[name], **{"threads": 1, **options})
        if result.report.stopped_by is None:
            break
        assert number < 10**7, "it never comes to its end"
        assert not result.report.complete
        assert any("early" in sentence for sentence in result.report.warnings)
        assert_covers(result, *SMALL[name])
        stages |= set(result.report.seconds)
        assert max(len(hull.vertices) for hull in result) <= options.get("max_vertices", np.inf)
        assert max(len(hull.faces) for hull in result) <= options.get("max_faces", np.inf)
    assert {"repair", "cut"} <= stages or options is not WHOLE


def test_a_stop_that_never_comes_changes_no_bit(polls: list[int]) -> None:
    mesh = SMALL["screws"]
    plain = rlacd.decompose(mesh)
    polls[:] = [10**12]
    for result in (rlacd.decompose(mesh), rlacd.decompose(mesh, timeout=1e6, progress=lambda _: None)):
        assert_same_hulls(plain, result)


def test_hulls_of_bodies_that_had_no_repair_hold_them() -> None:
    result = rlacd.decompose(boxes(40), timeout=1e-9)
    assert len(result) == 40
    assert sum(hull.volume for hull in result) == pytest.approx(trimesh.Trimesh(*boxes(40)).volume)
    assert result.report.repair == ()
    assert result.report.concavity == LengthFit(None, None, 0.05)


def test_bodies_by_the_thousand_share_hulls_with_those_near_them() -> None:
    rng = np.random.default_rng(0)
    corners = rng.random((3 * MOST_HULLS, 1, 3)) + 1e-3 * rng.random((3 * MOST_HULLS, 3, 3))
    mesh = corners.reshape(-1, 3), np.arange(9 * MOST_HULLS, dtype=np.int32).reshape(-1, 3)
    solid, parts = cover(load_mesh(mesh), Run(1))
    assert len(parts) == MOST_HULLS
    under = hull_distances([part.hull for part in parts], *solid.surface).under[0]
    assert under < 1e-9
    assert sum(part.hull.volume for part in parts) < 0.2 * 8  # they are near each other


@pytest.mark.parametrize("flat", [False, True])
def test_a_body_whose_hull_takes_too_long_gets_a_wider_one(flat: bool) -> None:
    vertices, faces = noisy_ball(20_000, 0.0)
    vertices = vertices * [1, 1, 0 if flat else 1]
    mesh = load_mesh((vertices, faces))
    with Run(1) as run:
        run.stop.trip_after(1)
        solid, parts = cover(mesh, run)
    (hull,) = (part.hull for part in parts)
    assert hull.volume > 0
    if not flat:
        assert hull_distances([hull], *solid.surface).under[0] == 0
        assert hull.volume < 1.2 * 4 / 3 * np.pi


# --- in time --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LARGE if name != "spike"])  # which is done in less
@pytest.mark.promise("timeout")
def test_a_timeout_ends_the_work_however_large_the_input(name: str) -> None:
    mesh = LARGE[name]()
    seen: list[rlacd.Progress] = []
    result = rlacd.decompose(mesh, timeout=1.0, progress=seen.append)
    # The step that notices the timeout is the last: see `python -m benchmarks late`.
    assert sum(step.seconds > 1.0 for step in seen) <= 1
    assert result.report.stopped_by == "timeout"
    # Corners: for the surface between them there is no time here either.
    corners = np.ascontiguousarray(mesh[0][:: max(1, len(mesh[0]) // 2000)], dtype=np.float64)
    union = hull_union([hull for part in result if (hull := Hull.of(part.vertices))], 1)
    assert union.distance(corners, 1).max() <= 2e-3 * np.ptp(mesh[0], axis=0).max()


@pytest.mark.slow
def test_a_long_kernel_calls_progress_in_the_thread_of_the_caller() -> None:
    threads = set()

    def note(progress: rlacd.Progress) -> None:
        threads.add(threading.get_ident())

    rlacd.decompose(noisy_ball(600, 0.05), progress=note, threads=2, quality="fast")
    assert threads == {threading.get_ident()}


def test_threads_wait_for_each_other_when_one_fails() -> None:
    running = itertools.count()
    ended = []

    def work(item: int) -> None:
        next(running)
        try:
            if item == 3:
                raise ValueError("three")
            for _ in range(20):
                time.sleep(0.002)
                _native.poll_stop()
        finally:
            ended.append(item)

    with Run(4) as run:
        with pytest.raises(ValueError, match="three"):
            run.map(work, range(40))
        assert len(ended) == next(running)
        run.stop.trip()
        with pytest.raises(_native.Stopped):
            run.map(work, range(40))
        run.stop.arm(float("inf"))
        assert run.map(lambda item: 2 * item, range(10)) == list(range(0, 20, 2))


def test_an_error_of_progress_leaves_long_kernels_too() -> None:
    """It is raised where the kernel is, through threads of its own."""

    class MyError(Exception):
        pass

    def look() -> None:
        raise MyError

    stop = _native.Stop()
    before = _native.use_stop(stop)
    stop.begin(look)
    try:
        surface = _native.Surface(*noisy_ball(2000, 0.0))
        with pytest.raises(MyError):  # after the tenth of a second between two looks
            surface.distance(np.zeros((10_000_000, 3)), 3)
    finally:
        stop.end()
        _native.use_stop(before)


def test_a_stop_ends_with_its_decomposition() -> None:
    rlacd.decompose(SMALL["ball"], timeout=1e-9)
    _native.poll_stop()
    assert _native.seconds_left() == float("inf")


def interrupted(name: str, handler: str, seconds: float, times: int, *words: str, folder: Path) -> int:
    """Exit code of the command that gets Ctrl-C so many times after so many CPU seconds."""
    trimesh.Trimesh(*LARGE[name](), process=False).export(folder / "mesh.ply")
    code = f"import signal; signal.signal(signal.SIGINT, signal.{handler}); from rlacd.cli.main import main; main()"
    with subprocess.Popen([sys.executable, "-c", code, "decompose", "mesh.ply", *words], cwd=folder) as run:
        try:
            used = psutil.Process(run.pid).cpu_times
            while run.poll() is None and used().user < seconds:
                time.sleep(0.05)
            for _ in range(times):
                run.send_signal(signal.SIGINT)
                time.sleep(0.2)
            return run.wait(PATIENCE)
        finally:
            run.kill()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT to one process")
@pytest.mark.parametrize("name", ["terrain", "boxes"])
@pytest.mark.promise("ctrl-c")
def test_ctrl_c_is_heeded_in_the_middle_of_a_stage(name: str, tmp_path: Path) -> None:
    """After 4 CPU seconds the libraries are loaded and the mesh is read: these shapes take many more."""
    assert interrupted(name, "SIG_IGN", 4.0, 1, "-o", "hulls.glb", folder=tmp_path) == 4
    assert (tmp_path / "hulls.glb").exists()


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT to one process")
@pytest.mark.parametrize("begun", [0.2, 1.2, 1.6, 2.0, 3.0, 5.0])  # CPU seconds
def test_ctrl_c_twice_ends_the_command_at_any_moment(begun: float, tmp_path: Path) -> None:
    """A handler is set, because SIGINT is ignored in a shell's background."""
    code = interrupted("boxes", "default_int_handler", begun, 2, "--budget", "20", folder=tmp_path)
    assert code in (4, 130, -signal.SIGINT)  # the last while Python starts
    assert not list(tmp_path.glob(".*")), "no file is left half-written"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT to one process")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_twice_ends_a_command_that_no_handler_of_python_can_interrupt(number: int) -> None:
    code = """if True:
        import signal
        signal.signal(signal.SIGINT, signal.default_int_handler)
        from rlacd.cli.terminal import watching
        with watching(quiet=True):
            print("busy", flush=True)
            sum(range(10**12))  # holds the GIL for hours, as a boolean of manifold3d may
    """
    run = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert run.stdout.readline() == "busy\n"
        time.sleep(0.2)
        run.send_signal(number)
        with pytest.raises(subprocess.TimeoutExpired):
            run.wait(2)
        run.send_signal(number)
        assert run.wait(PATIENCE) == 130
    finally:
        run.kill()
