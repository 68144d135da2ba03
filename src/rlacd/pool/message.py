"""Messages between a worker and its process: a JSON header that names the blobs, then the blobs."""

from __future__ import annotations

import importlib
import json
import struct
from typing import IO

from rlacd.pool.request import Blobs, MakeServer, Values

_LENGTH = struct.Struct("<Q")


def send(pipe: IO[bytes], header: Values, blobs: Blobs) -> None:
    """Send one message.

    Raises
    ------
    OSError, ValueError
        The other end, or this one, is closed.
    """
    for content in (json.dumps({**header, "blobs": list(blobs)}).encode(), *blobs.values()):
        pipe.write(_LENGTH.pack(len(content)))
        pipe.write(content)
    pipe.flush()


def receive(pipe: IO[bytes]) -> tuple[Values, dict[str, bytes]]:
    """Wait for one message.

    Raises
    ------
    EOFError, OSError, ValueError
        The other end, or this one, is closed.
    """
    header: Values = json.loads(_next(pipe))
    return header, {name: _next(pipe) for name in header.pop("blobs")}


def _next(pipe: IO[bytes]) -> bytes:
    (length,) = _LENGTH.unpack(_exactly(pipe, _LENGTH.size))
    return _exactly(pipe, length)


def _exactly(pipe: IO[bytes], length: int) -> bytes:
    content = pipe.read(length)
    if len(content) < length:
        raise EOFError
    return content


def find_server(name: str) -> MakeServer:
    """Import the object that ``module:name`` refers to."""
    module, _, attribute = name.partition(":")
    make: MakeServer = getattr(importlib.import_module(module), attribute)
    return make
