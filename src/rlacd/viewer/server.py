"""The viewer's server: the page, the decomposition, its progress, and files to download, for this machine only.

====================================  ===========================================================================
``GET /``, ``GET /page/NAME.js``      the page and its scripts
``GET /events``                       the state, with every change (server-sent events)
``GET /scene``, ``GET /heat``         the data to draw; see `rlacd.viewer.scene`
``GET /download?format=NAME``         a file
``POST /open?name=NAME``              open another mesh: the bytes of its file
``POST /command``                     the options as a command for a terminal
``POST /touching``                    the links of a robot that touch at other positions of its joints
``POST /decompose``, ``POST /cancel``  JSON in, JSON out
====================================  ===========================================================================

It listens on the loopback address alone. Pages of other sites are kept out: a request's Host header must name this
server, which defeats DNS rebinding, and the request must not come from a page of another origin. Memory is bounded:
uploads of at most `LARGEST_MESH` bytes, one decomposition with its scene and heat map, and `HEAVY` costly answers at a
time.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import re
import tempfile
import threading
import time
import urllib.parse
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from rlacd._version import __version__
from rlacd.errors import OptionError, RlacdError, sentence_of
from rlacd.io.read import READERS
from rlacd.io.read.open_file import UPLOAD
from rlacd.options.presets import PRESETS
from rlacd.plain_json import to_json
from rlacd.result import Result
from rlacd.viewer.controls import Subject, as_command, file_name, passes_of, preset_words, read_controls
from rlacd.viewer.downloads import download, offered
from rlacd.viewer.heat import heat_map
from rlacd.viewer.page import live_page, module
from rlacd.viewer.picture import check_up
from rlacd.viewer.robot import RobotResult
from rlacd.viewer.scene import heat_scene, input_scene, scene
from rlacd.viewer.session import Session

ADDRESS = "127.0.0.1"
USUAL_PORT = 8765
LONGEST_REQUEST = 10_000  # bytes of JSON
LARGEST_MESH = 2**28  # bytes of an uploaded file
HEAVY = 2  # concurrent scenes, and downloads: answers that take much memory and time

HARDENING = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
"""Headers of every answer."""


Read = Callable[[Path, str | None], Subject]
"""Reads a file to be shown, with the axis that points up if that is given."""


class ViewServer(ThreadingHTTPServer):
    """Serves one session: a subject, with the first values of the page's controls, and what reads another.

    It listens on `port` (OptionError if it cannot); by default on the usual one, or any that is free.
    """

    daemon_threads = True

    def __init__(self, session: Session, subject: Subject, read: Read, *, port: int | None, options: Any) -> None:
        self.session, self.subject, self.read = session, subject, read
        self.answers, self._changed = 0, threading.Condition()
        self.heavy, self.downloads = threading.BoundedSemaphore(HEAVY), threading.BoundedSemaphore(HEAVY)
        self.controls = options
        self._made: dict[str, tuple[int, bytes]] = {}
        self._making, self._opening = threading.Lock(), threading.Lock()
        self.uploaded: tempfile.TemporaryDirectory[str] | None = None
        config: dict[str, Any] = {"options": options, "formats": list(READERS), "version": __version__}
        config["downloads"] = [asdict(offer) for offer in offered()]
        config["presets"] = [{"name": name, **preset_words(name)} for name in PRESETS]
        page, policy = live_page(subject.name, config)
        self.page, self.policy = page.encode(), f"{policy}; frame-ancestors 'none'"
        self._bind(port)
        self._thread = threading.Thread(target=self.serve_forever, args=(0.1,), name="rlacd-view-server", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{ADDRESS}:{self.server_address[1]}/"

    @property
    def at_work(self) -> bool:
        """Whether work is still running, even after the viewer is closed: a kernel cannot be interrupted."""
        return not self.session.ended or self.answers > 0

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        with contextlib.suppress(KeyboardInterrupt):
            while self._thread.is_alive():  # a wait without timeout would not notice Ctrl-C on Windows
                self._thread.join(0.5)

    @contextlib.contextmanager
    def answering(self) -> Iterator[None]:
        """Count an answer that is being made."""
        with self._changed:
            self.answers += 1
        try:
            yield
        finally:
            with self._changed:
                self.answers -= 1
                self._changed.notify_all()

    def end(self, seconds: float) -> bool:
        """Accept nothing more; returns whether all answers have been made within `seconds`."""
        self.shutdown()
        self.server_close()
        with self._changed:
            return self._changed.wait_for(lambda: not self.answers, timeout=max(0.0, seconds))

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors: closing a page breaks its connections."""

    def decompose(self, controls: dict[str, Any], *, other_input: bool = False) -> None:
        """Decompose the subject next: first a draft, then with the requested options."""
        self.controls = controls
        passes = [{"mesh": self.subject.path, **options} for options in passes_of(controls)]
        self.session.decompose(*passes, other_input=other_input)

    def open_mesh(self, name: str, content: bytes) -> None:
        """Replace the subject by an uploaded file, decomposed with the options accepted last, unless it is unusable."""
        with self._opening:
            folder = tempfile.TemporaryDirectory(prefix=UPLOAD, ignore_cleanup_errors=True)
            try:
                path = Path(folder.name) / file_name(name)
                path.write_bytes(content)
                self.subject = self.read(path, None)
            except BaseException:
                folder.cleanup()
                raise
            self.decompose(self.controls, other_input=True)
            if self.uploaded is not None:
                self.uploaded.cleanup()
            self.uploaded = folder

    def without_folders(self, said: str) -> str:
        """Name the mesh in a message by its file name alone."""
        uploads = rf"{re.escape(tempfile.gettempdir())}.{UPLOAD}\w+[/\\]"
        return re.sub(uploads, "", said.replace(str(self.subject.path), self.subject.path.name))

    def server_close(self) -> None:
        """Stop listening, and remove uploaded files."""
        super().server_close()
        if self.uploaded is not None:
            self.uploaded.cleanup()

    def scene(self) -> bytes:
        """Return the scene as JSON; computed once per subject or result."""
        subject, result = self.subject, self.session.result
        guess = {"upIsGuess": subject.up_is_guess}
        if result is None:
            mesh = subject.mesh
            bare = input_scene(subject.name, mesh.vertices, mesh.faces, subject.up, mesh.unit)
            return to_json(bare | guess, indent=None).encode()
        return self.once("scene", result[0], lambda: scene(result[1], subject.up) | guess)

    def once(self, what: str, version: int, make: Callable[[], dict[str, Any]]) -> bytes:
        """Return values as JSON; computed once per version."""
        with self._making:
            made = self._made.get(what)
            if made is None or made[0] != version:
                self._made.pop(what, None)
                made = self._made[what] = version, to_json(make(), indent=None).encode()
            return made[1]

    def _bind(self, port: int | None) -> None:
        try:
            super().__init__((ADDRESS, USUAL_PORT if port is None else port), _Handler)
        except OverflowError:
            raise OptionError(f"{port} is not a port; choose one from 1024 to 65535, or 0 for any free one.") from None
        except OSError as error:
            if port is None:
                super().__init__((ADDRESS, 0), _Handler)
                return
            why = "is in use" if error.errno == errno.EADDRINUSE else f"cannot be listened on ({error.strerror})"
            raise OptionError(f"port {port} {why}; choose another with --port, or leave it out.") from error


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    error_content_type, error_message_format = "application/json", '{"error": "%(explain)s."}'
    timeout = 20.0  # seconds for a single send or receive

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        self.request_version = self.protocol_version  # a request that is no HTTP gets a head too
        super().send_error(code, message, explain)

    def version_string(self) -> str:
        return "rlacd"

    def log_message(self, format: str, *args: Any) -> None:
        pass

    def do_GET(self) -> None:
        with self._answered():
            self._check_sender()
            place = _split(self.path)
            query = urllib.parse.parse_qs(place.query)
            if place.path == "/":
                self._send(self.server.page, "text/html", {"Content-Security-Policy": self.server.policy})
            elif place.path == "/events":
                self._send_events()
            elif place.path == "/scene":
                with self.server.heavy:
                    content = self.server.scene()
                self._send(content, "application/json")
            elif place.path == "/heat":
                with self.server.heavy:
                    version, hulls = self._result()
                    content = self.server.once("heat", version, lambda: heat_scene(heat_map(hulls)))
                self._send(content, "application/json")
            elif place.path == "/download":
                self._send_file(query.get("format", [""])[0], query.get("up", [self.server.subject.up])[0])
            elif (script := module(place.path.removeprefix("/page/").removesuffix(".js"))) is not None:
                self._send(script.encode(), "text/javascript")
            else:
                raise _Refused(HTTPStatus.NOT_FOUND, "there is nothing here.")

    def do_POST(self) -> None:
        with self._answered():
            self._check_sender()
            place = _split(self.path)
            answer: dict[str, Any] = {}
            if place.path == "/open":
                self._open(urllib.parse.parse_qs(place.query))
            elif place.path == "/decompose":
                self.server.decompose(read_controls(self._body()))
            elif place.path == "/command":
                path = self.server.subject.path  # an uploaded mesh has no place but a copy that goes with the viewer
                where = path if self.server.uploaded is None else path.name
                answer["command"] = as_command(self.server.subject, where, read_controls(self._body()))
            elif place.path == "/touching":
                answer["contacts"] = self._touching(self._body())
            elif place.path == "/cancel":
                self._body()
                self.server.session.stop()
            else:
                raise _Refused(HTTPStatus.NOT_FOUND, "there is nothing here.")
            self._send_json(answer, HTTPStatus.ACCEPTED)

    def _open(self, query: dict[str, list[str]]) -> None:
        if self.headers.get_content_type() != "application/octet-stream":
            raise _Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send the mesh as application/octet-stream.")
        content = self._read(LARGEST_MESH)
        with self.server.heavy:
            self.server.open_mesh(query.get("name", [""])[0], content)

    @contextlib.contextmanager
    def _answered(self) -> Iterator[None]:
        """Turn errors into answers that the page shows."""
        try:
            with self.server.answering():
                yield
        except (TimeoutError, ConnectionError):
            self.close_connection = True
        except _Refused as error:
            self.close_connection = True  # the rest of the request stays unread
            self._send_json({"error": str(error)}, error.status)
        except Exception as error:
            known = isinstance(error, RlacdError)
            status = HTTPStatus.BAD_REQUEST if known else HTTPStatus.INTERNAL_SERVER_ERROR
            self._send_json({"error": self.server.without_folders(sentence_of(error))}, status)

    def _check_sender(self) -> None:
        """Refuse requests for another host, and those from pages of other origins."""
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or _split(f"//{hosts[0]}").hostname not in (ADDRESS, "localhost"):
            raise _Refused(HTTPStatus.FORBIDDEN, f"this viewer answers to {ADDRESS} and localhost only.")
        origin = self.headers.get("Origin")
        followed = self.command == "GET" and self.headers.get("Sec-Fetch-Mode") == "navigate"  # a link in another page
        if (origin is not None and origin != f"http://{hosts[0]}") or (
            self.headers.get("Sec-Fetch-Site") in ("cross-site", "same-site") and not (followed and self.path == "/")
        ):
            raise _Refused(HTTPStatus.FORBIDDEN, "this viewer answers to its own page only.")

    def _body(self) -> dict[str, Any]:
        if self.headers.get_content_type() != "application/json":  # forms of other sites cannot send this type
            raise _Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "this viewer takes JSON only.")
        try:
            given = json.loads(self._read(LONGEST_REQUEST))
        except (ValueError, RecursionError):
            given = None
        if not isinstance(given, dict):
            raise OptionError("the request is not a JSON object; send {} at least.")
        return given

    def _read(self, longest: int) -> bytes:
        length = self.headers.get("Content-Length", "0")
        if "Transfer-Encoding" in self.headers or not (length.isascii() and length.isdigit()):
            raise _Refused(HTTPStatus.LENGTH_REQUIRED, "the request does not say how long it is (Content-Length).")
        if len(length) > len(str(longest)) or int(length) > longest:
            raise _Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the request is longer than {longest:,} bytes.")
        content = self.rfile.read(int(length))
        if len(content) != int(length):
            raise ConnectionError("the request ended early")
        return content

    def _result(self) -> tuple[int, Result]:
        result = self.server.session.result
        if result is None:
            raise OptionError("there are no hulls yet; wait for the first decomposition.")
        return result

    def _touching(self, asked: dict[str, Any]) -> list[Any]:
        """The links of a robot that touch at given joint positions."""
        robot, values = self._result()[1], asked.get("values")
        if not isinstance(robot, RobotResult) or robot.touching is None:
            raise OptionError("whether links touch is not known here.")
        is_number = (isinstance(value, (int, float)) and math.isfinite(value) for value in values or ())
        if not isinstance(values, list) or len(values) != robot.free or not all(is_number):
            raise OptionError(f"give values, {robot.free} numbers: the positions of the joints.")
        with self.server.heavy:
            return robot.touching(values)

    def _send_events(self) -> None:
        self.close_connection = True
        self._send_head(HTTPStatus.OK, "text/event-stream", {"Connection": "close"})
        # After 3 s of silence a sign of life, which shows whether the client still reads.
        for state in self.server.session.changes(3.0):
            if state is not None and state.error is not None:
                state = replace(state, error=self.server.without_folders(state.error))
            event = ": still here" if state is None else f"data: {json.dumps(asdict(state))}"
            self.wfile.write(f"{event}\n\n".encode())
            self.wfile.flush()
            if state is not None and state.state == "working":
                time.sleep(0.05)  # the eye follows no faster; changes in the meantime are combined

    def _send_file(self, wanted: str, up: str) -> None:
        check_up(up)
        with self.server.downloads:
            name, content = download(self._result()[1], wanted, up=up)
        plain = name.encode("ascii", "replace").decode().replace('"', "_").replace("\\", "_")
        exact = urllib.parse.quote(name.encode(errors="replace"))
        named = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{exact}"
        self._send(content, "application/octet-stream", {"Content-Disposition": named})

    def _send_json(self, value: Any, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(to_json(value, indent=None).encode(), "application/json", status=status)

    def _send(
        self, content: bytes, kind: str, headers: dict[str, str] | None = None, status: HTTPStatus = HTTPStatus.OK
    ) -> None:
        self._send_head(status, kind, {"Content-Length": str(len(content)), **(headers or {})})
        self.wfile.write(content)

    def _send_head(self, status: HTTPStatus, kind: str, headers: dict[str, str]) -> None:
        self.send_response(status)
        text = kind.startswith("text/")
        self.send_header("Content-Type", f"{kind}; charset=utf-8" if text and kind != "text/event-stream" else kind)
        if self.close_connection and "Connection" not in headers:
            self.send_header("Connection", "close")
        for name, value in {**HARDENING, **headers}.items():
            self.send_header(name, value)
        self.end_headers()


class _Refused(Exception):
    """A request that the server refuses."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


def _split(address: str) -> urllib.parse.SplitResult:
    try:
        return urllib.parse.urlsplit(address)
    except ValueError as error:  # a bracket without its partner
        raise _Refused(HTTPStatus.BAD_REQUEST, f"{address!r} is not an address.") from error
