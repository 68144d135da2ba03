"""Connections of the viewer's server, with bounds on their number and duration.

Every connection has a thread, so their number is bounded; one more is answered 503 at once, without a thread. Each has
a deadline, at which slow requests, clients that do not read and idle connections are closed.
"""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

MOST_CONNECTIONS = 48
"""Concurrent connections; a browser opens up to six."""

MOST_STREAMS = 16
"""Concurrent event streams, one per open page; the other connections are free for pages and commands."""

REQUEST_SECONDS = 10.0
"""Seconds to receive headers and body, from the first byte expected; also how long an idle connection is kept."""

ANSWER_SECONDS = 120.0
"""Seconds to send an answer of any size."""

FULL = "too many connections to this viewer are open; close a page and reload this one."


_BUSY = (
    "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nCache-Control: no-store\r\n"
    f"Retry-After: 5\r\nConnection: close\r\n\r\n{json.dumps({'error': FULL})}"
).encode()


class BoundedServer(ThreadingHTTPServer):
    """A server with a thread for each connection, at most `MOST_CONNECTIONS`, each with a deadline."""

    daemon_threads = True
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], handler: type[BoundedHandler]) -> None:
        self._deadlines: dict[socket.socket, float] = {}
        self._changed = threading.Condition()
        self.streams = threading.BoundedSemaphore(MOST_STREAMS)
        super().__init__(address, handler)

    @property
    def connections(self) -> int:
        """Number of open connections."""
        with self._changed:
            return len(self._deadlines)

    def expect(self, connection: socket.socket, seconds: float) -> None:
        """End a connection unless its data arrives within `seconds`; infinity while it waits for this server."""
        with self._changed:
            if connection in self._deadlines:
                self._deadlines[connection] = time.monotonic() + seconds

    def end(self, seconds: float) -> bool:
        """Refuse new connections and end the open ones; returns whether all have ended within `seconds`."""
        self.shutdown()
        self.server_close()
        until = time.monotonic() + seconds
        with self._changed:
            # Connections that are sending get time to finish.
            self._changed.wait_for(lambda: not self._deadlines, timeout=min(0.3, max(0.0, seconds)))
            for connection in self._deadlines:
                _hang_up(connection)
            return self._changed.wait_for(lambda: not self._deadlines, timeout=max(0.0, until - time.monotonic()))

    def process_request(self, request: Any, client_address: Any) -> None:
        """Start a thread for a connection, or turn it away."""
        with self._changed:
            full = len(self._deadlines) >= MOST_CONNECTIONS
            if not full:
                self._deadlines[request] = time.monotonic() + REQUEST_SECONDS
        if full:
            _turn_away(request)
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection and remove its deadline."""
        super().shutdown_request(request)
        with self._changed:
            self._deadlines.pop(request, None)
            self._changed.notify_all()

    def service_actions(self) -> None:
        """End connections past their deadline; called several times a second."""
        now = time.monotonic()
        with self._changed:
            for connection, deadline in self._deadlines.items():
                if deadline < now:
                    _hang_up(connection)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors: closing a page breaks its connections."""


class BoundedHandler(BaseHTTPRequestHandler):
    """A handler that reads requests in bounded time.

    The base class bounds heads: to 100 lines of 64 KiB.
    """

    server: BoundedServer
    protocol_version = "HTTP/1.1"
    error_content_type, error_message_format = "application/json", '{"error": "%(explain)s."}'
    timeout = 20.0  # seconds for a single send or receive

    def handle_one_request(self) -> None:
        """Give each request its own deadline."""
        self.server.expect(self.connection, REQUEST_SECONDS)
        try:
            super().handle_one_request()
        except ConnectionError:
            self.close_connection = True

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send a head even if the request is no HTTP: the base class takes it for HTTP/0.9, which has no heads."""
        self.request_version = self.protocol_version
        super().send_error(code, message, explain)

    def version_string(self) -> str:
        """Name the program, without the version of Python."""
        return "rlacd"

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""


def _hang_up(connection: socket.socket) -> None:
    """Shut a connection down, so that pending reads and writes on it end."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


def _turn_away(connection: socket.socket) -> None:
    """Answer 503 without blocking."""
    connection.setblocking(False)
    with contextlib.suppress(OSError):
        connection.recv(1 << 16)  # closing a connection with unread input can destroy the answer
    with contextlib.suppress(OSError):
        connection.sendall(_BUSY)
