"""The viewer's server: the page, the decomposition, its progress, and files to download, for this machine only.

====================================  ===========================================================================
``GET /``                             the page
``GET /events``                       the state, with every change (server-sent events)
``GET /scene``, ``GET /heat``         what is drawn; see `rlacd.show.scene`
``GET /download?format=NAME``         a file
``POST /decompose``, ``POST /cancel``  JSON in, JSON out
====================================  ===========================================================================

It listens on the loopback address alone. Pages of other sites are kept out: a request must name this server as its
host, so that no foreign name can be pointed at it, and what changes anything must come from the viewer's own page.
"""

from __future__ import annotations

import contextlib
import errno
import json
import threading
import time
import urllib.parse
from collections.abc import Callable, Iterator
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from rlacd._version import __version__
from rlacd.decomposition import Decomposition
from rlacd.errors import OptionError, RlacdError
from rlacd.plain_json import to_json
from rlacd.show.downloads import download, offered
from rlacd.show.heat import heat_map
from rlacd.show.page import live_page
from rlacd.show.picture import check_up
from rlacd.show.scene import heat_scene, scene
from rlacd.show.session import Session, State

ADDRESS = "127.0.0.1"
USUAL_PORT = 8765
LONGEST_REQUEST = 10_000  # bytes of JSON
QUICKEST = 0.05  # seconds between two reports of progress


class ViewServer(ThreadingHTTPServer):
    """Serves one session.

    Parameters
    ----------
    session : Session
    name : str
        Of the mesh, for the page's title.
    port : int, optional
        Where to listen; without it the usual port, or any free one.
    options : dict
        What the page's controls hold at first.
    up : {"x", "y", "z"}
        The axis of the mesh that points up.
    accept : callable
        From the page's options to those of the session's run; raises `OptionError`.

    Raises
    ------
    OptionError
        The port is in use, may not be used, or is none.
    """

    daemon_threads = True

    def __init__(
        self,
        session: Session,
        name: str,
        *,
        port: int | None,
        options: dict[str, Any],
        up: str,
        accept: Callable[[dict[str, Any]], dict[str, Any]],
    ) -> None:
        self.session, self.up, self.accept = session, up, accept
        self._heat_of: tuple[int, bytes] | None = None
        self._heat_lock = threading.Lock()
        self.page = live_page(name, {"options": options, "downloads": offered(), "version": __version__}).encode()
        self._bind(port)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://{ADDRESS}:{self.server_address[1]}/"

    def heat(self, run: int, decomposition: Decomposition) -> bytes:
        """Give the error heat map as JSON; worked out once for a decomposition."""
        with self._heat_lock:
            if self._heat_of is None or self._heat_of[0] != run:
                found = heat_scene(heat_map(decomposition))
                self._heat_of = run, to_json(found, indent=None).encode()
            return self._heat_of[1]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing: pages that are closed break their connections."""

    def _bind(self, port: int | None) -> None:
        try:
            super().__init__((ADDRESS, USUAL_PORT if port is None else port), _Handler)
        except OverflowError:
            raise OptionError(f"{port} is no port; choose one from 1024 to 65535.") from None
        except OSError as error:
            if port is None:
                super().__init__((ADDRESS, 0), _Handler)
            elif error.errno == errno.EADDRINUSE:
                raise OptionError(
                    f"port {port} is in use; choose another with --port, or leave it out to get a free one."
                ) from error
            else:
                raise OptionError(f"cannot listen on port {port} ({error.strerror}); choose another.") from error


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    timeout = 60.0

    def do_GET(self) -> None:
        place = urllib.parse.urlsplit(self.path)
        query = urllib.parse.parse_qs(place.query)
        with self._answered():
            self._check_host()
            if place.path == "/":
                self._send(self.server.page, "text/html; charset=utf-8")
            elif place.path == "/events":
                self._send_events()
            elif place.path == "/scene":
                self._send_json(scene(self._result()[1], self.server.up))
            elif place.path == "/heat":
                self._send(self.server.heat(*self._result()), "application/json")
            elif place.path == "/download":
                self._send_file(query.get("format", [""])[0], query.get("up", [self.server.up])[0])
            else:
                self._send_json({"error": "there is nothing here."}, HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        with self._answered():
            self._check_host()
            self._check_origin()
            given = self._body()
            if self.path == "/decompose":
                self.server.session.decompose(self.server.accept(given))
                self._send_json({}, HTTPStatus.ACCEPTED)
            elif self.path == "/cancel":
                self.server.session.stop()
                self._send_json({}, HTTPStatus.ACCEPTED)
            else:
                self._send_json({"error": "there is nothing here."}, HTTPStatus.NOT_FOUND)

    def log_message(self, format: str, *args: Any) -> None:
        pass

    @contextlib.contextmanager
    def _answered(self) -> Iterator[None]:
        """Turn errors into answers that the page shows."""
        try:
            yield
        except (TimeoutError, ConnectionError):
            self.close_connection = True
        except _Refused as error:
            self.close_connection = True  # what else was sent is not read
            self._send_json({"error": str(error)}, HTTPStatus.FORBIDDEN)
        except RlacdError as error:
            self._send_json({"error": str(error)}, HTTPStatus.BAD_REQUEST)
        except Exception as error:
            said = f"a bug in rlacd ({type(error).__name__}: {error}); please report it."
            self._send_json({"error": said}, HTTPStatus.INTERNAL_SERVER_ERROR)

    def _check_host(self) -> None:
        host = self.headers.get("Host", "").rsplit(":", 1)[0]
        if host not in (ADDRESS, "localhost"):
            raise _Refused(f"this viewer answers to {ADDRESS} and localhost only.")

    def _check_origin(self) -> None:
        origin = self.headers.get("Origin")
        if origin is not None and urllib.parse.urlsplit(origin).netloc != self.headers.get("Host"):
            raise _Refused("this viewer takes orders from its own page only.")
        if self.headers.get_content_type() != "application/json":  # forms of other sites cannot send this
            raise _Refused("this viewer takes JSON only.")

    def _body(self) -> dict[str, Any]:
        length = int(self.headers.get("Content-Length") or 0)
        if length > LONGEST_REQUEST:
            raise _Refused("this request is too long.")
        try:
            given = json.loads(self.rfile.read(length))
        except ValueError:
            given = None
        if not isinstance(given, dict):
            raise OptionError("the request is no JSON object; send {} at least.")
        return given

    def _result(self) -> tuple[int, Decomposition]:
        result = self.server.session.result
        if result is None:
            raise OptionError("there are no hulls yet; wait for the first decomposition.")
        return result

    def _send_events(self) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        for state in _calmly(self.server.session.changes()):
            told = ": still here" if state is None else f"data: {json.dumps(asdict(state))}"
            self.wfile.write(f"{told}\n\n".encode())
            self.wfile.flush()

    def _send_file(self, wanted: str, up: str) -> None:
        check_up(up)
        file = download(self._result()[1], wanted, up=up)
        plain = file.name.encode("ascii", "replace").decode().replace('"', "_").replace("\\", "_")
        exact = urllib.parse.quote(file.name.encode(errors="replace"))
        named = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{exact}"
        self._send(file.content, "application/octet-stream", {"Content-Disposition": named})

    def _send_json(self, value: Any, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(to_json(value, indent=None).encode(), "application/json", status=status)

    def _send(
        self, content: bytes, kind: str, headers: dict[str, str] | None = None, status: HTTPStatus = HTTPStatus.OK
    ) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)


class _Refused(Exception):
    """A request that is none of ours."""


def _calmly(changes: Iterator[State | None]) -> Iterator[State | None]:
    """Slow progress down to what an eye can follow; the last state of every kind always comes."""
    for state in changes:
        yield state
        if state is not None and state.state == "working":
            time.sleep(QUICKEST)  # changes meanwhile are seen as one
