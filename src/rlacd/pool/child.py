"""The process that answers requests, one at a time: ``python -m rlacd.pool.child SERVER FOLDER``.

Requests come through stdin and answers leave through what stdout was at the start: pipes that every system has. A
request that crashes, hangs, exhausts memory or makes a library print does so here. The process exits when its parent
does or, where a library that hangs holds the interpreter, `END_SECONDS` after the limit of its request. A message is a
JSON header that names its blobs, then the blobs.
"""

from __future__ import annotations

import faulthandler
import importlib
import json
import os
import queue
import signal
import struct
import sys
import threading
import warnings
from pathlib import Path
from typing import IO

from rlacd.errors import DecompositionWarning, RlacdError
from rlacd.pool import Blobs, MakeServer, Values

READY = {"ready": True}
"""Header of the first message, sent when requests may come."""

END_SECONDS = 10.0
"""Seconds for a process to be gone after it was told to, and after the limit of a request until it ends itself."""

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


def main() -> None:
    """Answer requests until the other end is closed."""
    warnings.simplefilter("ignore", DecompositionWarning)  # answers hold them
    for number in (signal.SIGINT, signal.SIGTERM):  # the parent decides what these stop
        signal.signal(number, signal.SIG_IGN)
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    messages: queue.SimpleQueue[tuple[Values, dict[str, bytes]]] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                messages.put(receive(requests))
        except (EOFError, OSError):
            os._exit(0)  # even in the middle of a request: its answer is no longer needed

    threading.Thread(target=listen, daemon=True).start()
    serve = find_server(sys.argv[1])(Path(sys.argv[2]))
    send(answers, READY, {})
    while True:
        header, blobs = messages.get()
        faulthandler.dump_traceback_later(min(header["seconds"] + END_SECONDS, threading.TIMEOUT_MAX - 1), exit=True)
        try:
            values, files = serve(header["values"], blobs)
        except RlacdError as error:
            send(answers, {"error": [type(error).__name__, str(error)]}, {})
        else:
            send(answers, {"values": values}, files)
        faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    main()
