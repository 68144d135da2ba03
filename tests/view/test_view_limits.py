"""The viewer's server under load and abuse: bounded threads, memory, sizes and times, and a quick and silent end."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rlacd.view import connections
from rlacd.view.connections import MOST_CONNECTIONS, MOST_STREAMS
from rlacd.view.server import UPLOADS, ViewServer
from tests.view.viewing import open_viewer

LONGEST_LINE = 1 << 16
PATIENCE = 60.0


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("limits") / "box.stl"
    trimesh.creation.box().export(path)
    return path


@pytest.fixture
def viewer(mesh: Path) -> Iterator[ViewServer]:
    with open_viewer(mesh, {"quality": "fast"}, port=0) as viewer:
        yield viewer


def port_of(address: str) -> int:
    return int(address.rsplit(":", 1)[1].strip("/"))


@contextmanager
def connected(viewer: ViewServer) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port_of(viewer.address)), timeout=PATIENCE) as connection:
        yield connection


def status_of(answer: bytes) -> int:
    found = re.match(rb"HTTP/1\.1 (\d+)", answer)
    assert found, answer
    return int(found[1])


def all_of(connection: socket.socket) -> bytes:
    """Everything until the other side ends the connection."""
    got = b""
    while more := connection.recv(65_536):
        got += more
    return got


def head(path: str, *lines: str, method: str = "GET") -> bytes:
    return "\r\n".join([f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", *lines, "", ""]).encode()


def upload(length: int) -> bytes:
    kind = "Content-Type: application/octet-stream"
    return head("/open?name=a.stl", kind, f"Content-Length: {length}", method="POST")


@pytest.mark.slow
def test_sixty_streams_leave_room_for_pages(viewer: ViewServer) -> None:
    before = threading.active_count()
    with ExitStack() as stack:
        streams = [stack.enter_context(connected(viewer)) for _ in range(60)]
        for stream in streams:
            stream.sendall(head("/events"))
        answers = [status_of(stream.recv(100)) for stream in streams]
        assert answers.count(200) == MOST_STREAMS
        assert answers.count(503) == 60 - MOST_STREAMS
        wait_until(lambda: viewer.connections == MOST_STREAMS)
        assert threading.active_count() - before <= MOST_STREAMS
        page = stack.enter_context(connected(viewer))
        page.sendall(head("/", "Connection: close"))
        assert status_of(all_of(page)) == 200
    wait_until(lambda: viewer.connections == 0)
    with connected(viewer) as again:
        again.sendall(head("/events"))
        assert status_of(again.recv(100)) == 200, "streams that have gone make room"


def test_connections_beyond_the_limit_are_reported_and_make_room_when_they_end(viewer: ViewServer) -> None:
    with ExitStack() as stack:
        for _ in range(MOST_CONNECTIONS):
            stack.enter_context(connected(viewer))
        wait_until(lambda: viewer.connections == MOST_CONNECTIONS)
        with connected(viewer) as more:
            more.sendall(head("/"))
            answer = all_of(more)
        assert status_of(answer) == 503
        assert b"close a page" in answer
    wait_until(lambda: viewer.connections == 0)
    with connected(viewer) as later:
        later.sendall(head("/", "Connection: close"))
        assert status_of(all_of(later)) == 200


def wait_until(true: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.parametrize(
    "trickle",
    [b"", b"GET /", head("/")[:-2] + b"X-Slow: 1\r\n", head("/cancel", "Content-Length: 9000", method="POST")],
    ids=["nothing", "request line", "headers", "body"],
)
def test_a_request_that_trickles_in_is_ended(
    viewer: ViewServer, trickle: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "REQUEST_SECONDS", 0.5)
    monkeypatch.setattr("rlacd.view.server.REQUEST_SECONDS", 0.5)
    trickle = trickle.replace(b"Content-Length", b"Content-Type: application/json\r\nContent-Length")
    with connected(viewer) as slow:
        slow.sendall(trickle)
        until = time.monotonic() + PATIENCE
        ended = False
        while not ended and time.monotonic() < until:
            try:
                slow.sendall(b"x")  # never silent for longer than a moment
                slow.settimeout(0.05)
                ended = slow.recv(10_000) == b""
            except TimeoutError:
                pass
            except OSError:
                ended = True
        assert ended
    wait_until(lambda: viewer.connections == 0)


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /" + b"a" * LONGEST_LINE + b" HTTP/1.1\r\n\r\n", 414),
        (head("/", "X-Long: " + "a" * LONGEST_LINE), 431),
        (head("/", *[f"X-{i}: 1" for i in range(200)]), 431),
        (head("/decompose", "Content-Type: application/json", "Content-Length: 20000", method="POST"), 413),
        (head("/decompose", "Content-Type: application/json", f"Content-Length: {'9' * 5000}", method="POST"), 413),
        (head("/decompose", "Content-Type: application/json", "Content-Length: -1", method="POST"), 411),
        (head("/decompose", "Content-Type: application/json", "Content-Length: many", method="POST"), 411),
        (head("/decompose", "Content-Type: application/json", "Transfer-Encoding: chunked", method="POST"), 411),
        (upload(2**28 + 1), 413),
        (head("/", method="DELETE"), 501),
        (head("/", "Host: 127.0.0.1"), 403),
        (b"GET / HTTP/1.1\r\n\r\n", 403),
        (b"GET / HTTP/1.1\r\nHost: [\r\n\r\n", 400),
        (head("http://["), 400),
        (b"nonsense\r\n\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n", 400),
    ],
    ids=lambda value: str(value) if isinstance(value, int) else repr(value[:24]),
)
def test_what_is_too_long_or_no_request_is_refused(viewer: ViewServer, request_: bytes, status: int) -> None:
    with connected(viewer) as connection:
        connection.sendall(request_)
        answer = all_of(connection)
        assert status_of(answer) == status
        assert json.loads(answer.partition(b"\r\n\r\n")[2])["error"].endswith(".")
    with connected(viewer) as connection:
        connection.sendall(head("/scene", "Connection: close"))
        assert status_of(all_of(connection)) == 200, "others are served"


def test_slow_uploads_keep_nothing_else_waiting(viewer: ViewServer) -> None:
    with ExitStack() as stack:
        for _ in range(UPLOADS):
            stack.enter_context(connected(viewer)).sendall(upload(1000) + b"x")
        wait_until(lambda: viewer.connections == UPLOADS)
        with connected(viewer) as page:
            page.sendall(head("/scene", "Connection: close"))
            assert status_of(all_of(page)) == 200


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mesh that takes much longer than a second."""
    ball = trimesh.creation.icosphere(5)
    ball.vertices *= 1 + 0.2 * np.random.default_rng(0).random((len(ball.vertices), 1))
    path = tmp_path_factory.mktemp("limits") / "rough.ply"
    ball.export(path)
    return path


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
@pytest.mark.parametrize("seconds", [0.0, 2.0, 6.0])
def test_the_command_leaves_at_once_and_in_silence_while_at_work(rough: Path, seconds: float) -> None:
    command = [sys.executable, "-c", "from rlacd.cli.main import main; main()", "view", str(rough), "--no-browser"]
    with subprocess.Popen([*command, "--quality", "best"], stderr=subprocess.PIPE, text=True) as process:
        try:
            address = re.search(r"http://\S+", process.stderr.readline())
            port = port_of(address[0])
            with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as stream:
                stream.sendall(head("/events"))
                assert status_of(stream.recv(100)) == 200
                time.sleep(seconds)
                asked = time.monotonic()
                process.send_signal(signal.SIGINT)
                assert process.wait(timeout=PATIENCE) == 0
            assert time.monotonic() - asked < 5.0  # 1 s on an idle machine
            assert process.stderr.read() == ""
        finally:
            process.kill()


ENDINGS = {
    "done": "rlacd.decompose(mesh, quality='fast')",
    "kept": "import sys; sys.kept = rlacd.decompose(mesh, quality='fast', criterion=rlacd.NavigableSpace())",
    "raised": "rlacd.decompose(mesh, progress=lambda seen: 1 / 0)",
    "viewed": "from tests.view.viewing import open_viewer\nwith open_viewer(mesh, port=0): pass",
    "viewed for a while": (
        "import time\nfrom tests.view.viewing import open_viewer\nwith open_viewer(mesh, port=0): time.sleep(2)"
    ),
}


@pytest.mark.nightly
@pytest.mark.parametrize("ending", ENDINGS)
def test_no_leaks_are_printed_when_python_ends(rough: Path, ending: str) -> None:
    mesh = rough if "view" in ending else rough.with_name("cube.stl")
    trimesh.creation.box().export(rough.with_name("cube.stl"))
    program = f"import rlacd\nmesh = {os.fspath(mesh)!r}\n{ENDINGS[ending]}"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False)
    assert "nanobind" not in run.stderr + run.stdout
    if ending == "raised":
        assert "ZeroDivisionError" in run.stderr
    else:
        assert (run.returncode, run.stderr) == (0, "")
