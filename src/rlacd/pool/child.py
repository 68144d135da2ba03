"""The process that answers requests, one at a time: ``python -m rlacd.pool.child SERVER FOLDER``.

Requests come through stdin and answers leave through what stdout was at the start: pipes that every system has. A
request that crashes, hangs, exhausts memory or makes a library print does so here. The process exits when its parent
does.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
from pathlib import Path

from rlacd.errors import RlacdError
from rlacd.pool.message import find_server, receive, send
from rlacd.pool.request import Shared, Values

READY = {"ready": True}
"""Header of the first message, sent when requests may come."""


def main() -> None:
    """Answer requests until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C stops
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
            send(answers, {"error": [type(error).__name__, str(error)]}, {})
        else:
            send(answers, {"values": values}, files)


if __name__ == "__main__":
    main()
