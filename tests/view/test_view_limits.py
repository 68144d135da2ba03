"""The viewer's server under abuse: bounded memory and sizes, and a quick and silent end."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rlacd.viewer.server import ViewServer
from tests.view.viewing import PATIENCE, ask, open_viewer, port_of

LONGEST_LINE = 1 << 16


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("limits") / "box.stl"
    trimesh.creation.box().export(path)
    return path


@pytest.fixture
def viewer(mesh: Path) -> Iterator[ViewServer]:
    with open_viewer(mesh, {"quality": "fast"}, port=0) as viewer:
        yield viewer


@contextmanager
def connected(viewer: ViewServer) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port_of(viewer)), timeout=PATIENCE) as connection:
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


def posted(length: str, path: str = "/decompose", kind: str = "application/json") -> bytes:
    return head(path, f"Content-Type: {kind}", length, method="POST")


def upload(length: int) -> bytes:
    return posted(f"Content-Length: {length}", "/open?name=a.stl", "application/octet-stream")


def wait_until(true: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /" + b"a" * LONGEST_LINE + b" HTTP/1.1\r\n\r\n", 414),
        (head("/", "X-Long: " + "a" * LONGEST_LINE), 431),
        (head("/", *[f"X-{i}: 1" for i in range(200)]), 431),
        (posted("Content-Length: 20000"), 413),
        (posted(f"Content-Length: {'9' * 5000}"), 413),
        (posted("Content-Length: -1"), 411),
        (posted("Content-Length: many"), 411),
        (posted("Transfer-Encoding: chunked"), 411),
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
    assert ask(viewer, "GET", "/scene").status == 200, "others are served"


def test_slow_uploads_keep_nothing_else_waiting(viewer: ViewServer) -> None:
    with ExitStack() as stack:
        for _ in range(8):
            stack.enter_context(connected(viewer)).sendall(upload(1000) + b"x")
        wait_until(lambda: viewer.answers == 8)
        assert ask(viewer, "GET", "/scene").status == 200


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mesh that takes much longer than a second."""
    ball = trimesh.creation.icosphere(5)
    ball.vertices *= 1 + 0.2 * np.random.default_rng(0).random((len(ball.vertices), 1))
    path = tmp_path_factory.mktemp("limits") / "rough.ply"
    ball.export(path)
    return path


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
@pytest.mark.parametrize("seconds", [0.0, *(pytest.param(wait, marks=pytest.mark.nightly) for wait in (2.0, 6.0))])
def test_the_command_leaves_at_once_and_in_silence_while_at_work(rough: Path, seconds: float) -> None:
    # Background jobs of a shell ignore Ctrl-C, and so would this one.
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    start = f"{heed}; from rlacd.cli.main import main; main()"
    command = [sys.executable, "-c", start, "view", str(rough), "--no-browser", "--quality", "best"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = re.search(r"http://127\.0\.0\.1:(\d+)/", process.stderr.readline())
            with socket.create_connection(("127.0.0.1", int(address[1])), timeout=PATIENCE) as stream:
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
    command = [sys.executable, "-W", "ignore::UserWarning", "-c", program]  # as the command line does
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert "nanobind" not in run.stderr + run.stdout
    if ending == "raised":
        assert "ZeroDivisionError" in run.stderr
    else:
        assert (run.returncode, run.stderr) == (0, "")
