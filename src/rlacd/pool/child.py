"""The process in which requests are done: ``python -m rlacd.pool.child SOCKET SERVER FOLDER``, one after another.

Whatever a request does (crash, hang, eat all memory, make a library print) happens here. The process ends when whoever
started it does.
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
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it decides what Ctrl-C ends
    os.dup2(2, 1)
    connection = Connection(int(sys.argv[1]))
    messages: queue.SimpleQueue[tuple[Values, dict[str, bytes]]] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                messages.put(receive(connection))
        except (EOFError, OSError):
            os._exit(0)  # in the middle of a request, too: nobody waits for it any more

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
