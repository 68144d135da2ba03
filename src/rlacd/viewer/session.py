"""The viewer's work: one mesh, decomposed again and again with other options.

One thread does the work. A request for other options cancels the current work and drops its result; stopping keeps the
result so far. All other threads read the state and wait for it to change.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from rlacd.errors import sentence_of
from rlacd.result import Result
from rlacd.run import Progress

Decompose = Callable[..., Result]
"""Takes ``progress`` and the options, returns a decomposition: `rlacd.decompose` with the mesh bound."""


@dataclass(frozen=True)
class SessionState:
    """State of a session."""

    state: str = "idle"
    run: int | None = None
    """Number of the last finished decomposition; None before the first."""
    version: int = 0
    """Grows whenever there is something new to draw: another input, a draft, a decomposition."""
    draft: bool = False
    """Whether the current hulls come from a quick first pass and may still be replaced."""
    stage: str = "load"
    done: int = 0
    total: int | None = None
    parts: int = 0
    seconds: float = 0.0
    """Progress of the current work; see `rlacd.run.Progress`."""
    error: str | None = None
    """Why the last requested work failed."""


class Session:
    """Runs decompositions on its own thread.

    Parameters
    ----------
    run : callable
        Called with ``progress`` and the requested options.
    """

    def __init__(self, run: Decompose) -> None:
        self._run = run
        self._changed = threading.Condition()
        self._state = SessionState()
        self._count = 0  # number of state changes so far
        self._wanted: list[dict[str, Any]] | None = None
        self._stopped = False
        self._result: Result | None = None
        self._thread = threading.Thread(target=self._work, name="rlacd-view", daemon=True)
        self._thread.start()

    @property
    def state(self) -> SessionState:
        """Current state."""
        with self._changed:
            return self._state

    @property
    def result(self) -> tuple[int, Result] | None:
        """The current hulls and their version; None before the first result and after the input changed."""
        with self._changed:
            return None if self._result is None else (self._state.version, self._result)

    @property
    def ended(self) -> bool:
        """Whether the session is closed and its work has ended."""
        return not self._thread.is_alive()

    def decompose(self, *passes: dict[str, Any], other_input: bool = False) -> None:
        """Cancel the current work and decompose with these options instead.

        Parameters
        ----------
        *passes : dict
            Options of each: the hulls of one are shown until those of the next are ready.
        other_input : bool
            Drop the current hulls, which belong to another input.
        """
        with self._changed:
            self._wanted, self._stopped = list(passes), False
            now = SessionState("working", run=self._state.run, version=self._state.version, draft=self._state.draft)
            if other_input:
                self._result = None
                now = replace(now, version=now.version + 1, draft=False)
            self._publish(now)

    def stop(self) -> None:
        """End the current work and keep its result so far."""
        with self._changed:
            self._stopped = True

    def close(self, patience: float = 1.0) -> bool:
        """Cancel the work and release all waiting threads; tells whether the work ended within `patience` seconds.

        If it has not, Python waits for its thread on exit: no object of a C++ library may outlive that.
        """
        with self._changed:
            if self._state.state != "closed":
                self._publish(replace(self._state, state="closed"))
        self._thread.join(timeout=patience)
        return self.ended

    def changes(self, patience: float = 15.0) -> Iterator[SessionState | None]:
        """Yield the current state, then every new one until the session closes; None after `patience` quiet seconds."""
        seen = -1
        while True:
            with self._changed:
                news = self._count != seen or self._changed.wait(timeout=patience)
                seen, state = self._count, self._state
            yield state if news else None
            if state.state == "closed":
                return

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wanted is not None or self._state.state == "closed")
                if self._state.state == "closed" or self._wanted is None:
                    return
                passes, self._wanted = self._wanted, None
            self._take(passes)

    def _take(self, passes: list[dict[str, Any]]) -> None:
        """Run the draft, if there is one, and then the requested decomposition."""
        for number, options in enumerate(passes, start=1):
            result, error = self._attempt(options)
            with self._changed:
                if self._state.state == "closed" or self._wanted is not None:
                    return
                is_last = number == len(passes) or self._stopped or error is not None
                # A pass that was stopped before its search is worth less than the finished draft.
                if number > 1 and result and not result.report.complete and result.report.search is None:
                    result = None
                state = self._state
                if result is not None:
                    self._result = result
                    state = replace(state, version=state.version + 1, draft=number < len(passes))
                if is_last:
                    done = result is not None or (number > 1 and error is None)
                    state = replace(state, state="idle", run=(state.run or 0) + 1 if done else state.run, error=error)
                self._publish(state)
                if is_last:
                    return

    def _attempt(self, options: dict[str, Any]) -> tuple[Result | None, str | None]:
        try:
            return self._run(progress=self._follow, **options), None
        except Exception as error:  # the viewer stays up and shows the error
            return None, sentence_of(error)

    def _follow(self, progress: Progress) -> bool:
        with self._changed:
            if self._wanted is not None or self._stopped or self._state.state == "closed":
                return False
            now = {name: getattr(progress, name) for name in ("stage", "done", "total", "parts", "seconds")}
            self._publish(replace(self._state, **now))
            return True

    def _publish(self, state: SessionState) -> None:
        self._state = state
        self._count += 1
        self._changed.notify_all()
