"""Messages between a worker and its process: a JSON header that names the blobs, then the blobs."""

from __future__ import annotations

import importlib
import json
from multiprocessing.connection import Connection

from rlacd.pool.request import Blobs, MakeServer, Values


def send(connection: Connection, header: Values, blobs: Blobs) -> None:
    """Send one message."""
    connection.send_bytes(json.dumps({**header, "blobs": list(blobs)}).encode())
    for content in blobs.values():
        connection.send_bytes(content)


def receive(connection: Connection) -> tuple[Values, dict[str, bytes]]:
    """Wait for one message.

    Raises
    ------
    EOFError, OSError
        The other end is closed.
    """
    header: Values = json.loads(connection.recv_bytes())
    return header, {name: connection.recv_bytes() for name in header.pop("blobs")}


def find_server(name: str) -> MakeServer:
    """Import the object that ``module:name`` refers to."""
    module, _, attribute = name.partition(":")
    make: MakeServer = getattr(importlib.import_module(module), attribute)
    return make
