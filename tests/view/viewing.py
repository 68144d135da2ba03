"""The viewer as `rlacd view` opens it, and what it answers."""

from __future__ import annotations

import http.client
import json
import urllib.parse
from contextlib import AbstractContextManager
from typing import Any

import rlacd
from rlacd.viewer import viewer
from rlacd.viewer.server import ViewServer

PATIENCE = 60.0


def open_viewer(
    mesh: Any, options: dict[str, Any] | None = None, *, decompose: Any = rlacd.decompose, **given: Any
) -> AbstractContextManager[ViewServer]:
    """Open it with what decomposes here."""
    return viewer.open_viewer(mesh, decompose, options, **given)


class Answer:
    """What a request gave."""

    def __init__(self, response: http.client.HTTPResponse) -> None:
        self.status, self.headers, self.body = response.status, response.headers, response.read()

    @property
    def json(self) -> Any:
        return json.loads(self.body)


def port_of(viewer: ViewServer) -> int:
    return int(urllib.parse.urlsplit(viewer.address).port or 0)


def ask(viewer: ViewServer, method: str, path: str, body: Any = None, **headers: str) -> Answer:
    connection = http.client.HTTPConnection("127.0.0.1", port_of(viewer), timeout=PATIENCE)
    try:
        sent = body if isinstance(body, (bytes, type(None))) else json.dumps(body).encode()
        kind = {"Content-Type": "application/json"} if method == "POST" else {}
        connection.request(method, path, sent, {**kind, **{k.replace("_", "-"): v for k, v in headers.items()}})
        return Answer(connection.getresponse())
    finally:
        connection.close()
