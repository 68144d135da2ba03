"""The process that answers requests, one at a time: ``python -m rlacd.pool.child SOCKET SERVER FOLDER``.

A request that crashes, hangs, exhausts memory or makes a library print does so here. The process exits when its parent
does.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
from multiprocessing.connection import Connection
from pathlib import Path

from rlacd.errors import RlacdError
from rlacd.pool.message import find_server, receive, send
from rlacd.pool.request import Shared, Values

READY = b"ready"


def main() -> None:
    """Answer requests until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C stops
    os.dup2(2, 1)
    connection = Connection(int(sys.argv[1]))
    messages: queue.SimpleQueue[tuple[Values, dict[str, bytes]]] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                messages.put(receive(connection))
        except (EOFError, OSError):
            os._exit(0)  # even in the middle of a request: its answer is no longer needed

    threading.Thread(target=listen, daemon=True).start()
    serve = find_server(sys.argv[2])(Path(sys.argv[3]))
    connection.send_bytes(READY)
    shared: dict[str, Shared] = {}
    while True:
        header, blobs = messages.get()
        if header["shares"]:
            shared[header["shares"]] = Shared(blobs, header["key"])
            continue
        shared = {name: shared[name] for name in header["shared"]}
        try:
            values, files = serve(header["values"], blobs, shared)
        except RlacdError as error:
            send(connection, {"error": [type(error).__name__, str(error)]}, {})
        else:
            send(connection, {"values": values}, files)


if __name__ == "__main__":
    main()
