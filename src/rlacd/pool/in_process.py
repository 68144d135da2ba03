"""A pool that runs requests in the calling process: nothing is watched, nothing has to start."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType

from rlacd.errors import RlacdError
from rlacd.pool.message import find_server
from rlacd.pool.request import Answer, Request, Server


class InProcessPool:
    """Answers each request during `submit`; limits are not enforced."""

    many_machines = False
    room = 1

    def __init__(self) -> None:
        self._servers: dict[str, Server] = {}
        self._folder = TemporaryDirectory(prefix="rlacd-")

    def submit(self, request: Request) -> Future[Answer]:
        """See `Pool`."""
        future: Future[Answer] = Future()
        if request.server not in self._servers:
            self._servers[request.server] = find_server(request.server)(Path(self._folder.name))
        try:
            values, blobs = self._servers[request.server](request.values, request.blobs, request.shared)
        except RlacdError as error:
            future.set_exception(error)
        else:
            future.set_result(Answer(values, blobs, "here"))
        return future

    def close(self) -> None:
        """See `Pool`."""
        self._servers.clear()
        self._folder.cleanup()

    def __enter__(self) -> InProcessPool:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
