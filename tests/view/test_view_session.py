"""The viewer's session: other options replace the work under way, stopping keeps it, errors leave what there was."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from rlacd.decomposition import Decomposition
from rlacd.errors import MeshFileError
from rlacd.run import Progress, ProgressCallback
from rlacd.viewer.controls import read_subject
from rlacd.viewer.session import Session, SessionState
from tests.hulls import hull_of

PATIENCE = 20.0  # seconds until a test gives up


class Work:
    """Stands in for `rlacd.decompose`: works in steps that the test lets it take."""

    def __init__(self) -> None:
        self.began = threading.Semaphore(0)
        self.steps = threading.Semaphore(0)
        self.error: Exception | None = None

    def __call__(self, *, progress: ProgressCallback, **options: Any) -> Decomposition:
        self.began.release()
        complete = True
        for step in range(3):
            assert self.steps.acquire(timeout=PATIENCE)
            complete = progress(Progress("cut", step, 3, step + 1, 0.1)) is not False
            if not complete:
                break
        if self.error is not None:
            raise self.error
        cube = trimesh.creation.box()
        return Decomposition.of([hull_of(cube.vertices)], cube, options=options, complete=complete)

    def wait_until_it_began(self) -> None:
        assert self.began.acquire(timeout=PATIENCE)

    def go_on(self, steps: int = 3) -> None:
        self.steps.release(steps)


@pytest.fixture
def work() -> Work:
    return Work()


@pytest.fixture
def session(work: Work) -> Iterator[Session]:
    with contextlib.closing(Session(work)) as session:
        yield session
        work.go_on(100)


def until(session: Session, state: str, **wanted: Any) -> SessionState:
    """The first state that is as wanted; an error only has to be there."""
    for seen in session.changes(patience=PATIENCE):
        assert seen is not None, f"nothing changed while waiting for {state} with {wanted}"
        known = {**vars(seen), "error": seen.error is not None}
        if seen.state == state and wanted.items() <= known.items():
            return seen
    raise AssertionError("the session was closed")


def options_of(session: Session) -> dict[str, Any]:
    return session.result[1].report.options


def test_other_options_replace_the_work_under_way(session: Session, work: Work) -> None:
    session.decompose({"threshold": 0.1})
    work.wait_until_it_began()
    session.decompose({"threshold": 0.2})
    session.decompose({"threshold": 0.3})
    work.go_on(100)
    until(session, "idle", run=1)
    assert options_of(session) == {"threshold": 0.3}, "what was reached with the first options is dropped"


def test_stopping_does_not_reach_into_the_next_run(session: Session, work: Work) -> None:
    session.stop()
    session.decompose({})
    work.go_on()
    until(session, "idle", run=1)
    assert session.result[1].report.complete is True


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (MeshFileError("cup.glb is empty; export it again."), "cup.glb is empty; export it again."),
        (MemoryError(), "not enough memory"),
        (RuntimeError("surprise"), "a bug in rlacd (RuntimeError: surprise)"),
    ],
)
def test_an_error_is_reported_and_what_there_was_stays(
    session: Session, work: Work, error: Exception, says: str
) -> None:
    session.decompose({"threshold": 0.1})
    work.go_on()
    until(session, "idle", run=1)
    work.error = error
    session.decompose({"threshold": 0.2})
    work.go_on()
    state = until(session, "idle", error=True)
    assert says in str(state.error)
    assert state.run == 1
    assert options_of(session) == {"threshold": 0.1}
    work.error = None
    session.decompose({"threshold": 0.3})
    work.go_on()
    until(session, "idle", run=2, error=False)


def test_a_draft_is_shown_until_better_hulls_come(session: Session, work: Work) -> None:
    session.decompose({"quality": "fast"}, {"quality": "best"})
    work.go_on(3)
    state = until(session, "working", draft=True)
    assert (state.run, state.version) == (None, 1)
    assert options_of(session) == {"quality": "fast"}
    work.go_on(3)
    state = until(session, "idle", run=1)
    assert (state.draft, state.version) == (False, 2)
    assert options_of(session) == {"quality": "best"}


def test_stopping_keeps_the_draft_rather_than_less(session: Session, work: Work) -> None:
    session.decompose({"quality": "fast"}, {"quality": "best"})
    work.go_on(3)
    until(session, "working", draft=True)
    work.wait_until_it_began()
    session.stop()
    work.go_on(1)
    state = until(session, "idle", run=1)
    assert (state.draft, state.version) == (True, 1)
    assert options_of(session) == {"quality": "fast"}


def test_another_input_drops_the_hulls(session: Session, work: Work) -> None:
    session.decompose({})
    work.go_on()
    until(session, "idle", run=1)
    session.decompose({}, other_input=True)
    assert session.result is None
    work.go_on()
    assert until(session, "idle", run=2).version == 3


# --- the mesh that is shown -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ending", "ground", "expected", "is_guess"),
    [
        ("obj", 1, "y", True),
        ("obj", 2, "z", True),
        ("obj", None, "z", True),
        ("stl", 1, "y", True),
        ("glb", 2, "y", False),
        ("3mf", 1, "z", False),
    ],
)
def test_up_is_guessed_where_the_file_does_not_say_it(
    tmp_path: Path, ending: str, ground: int | None, expected: str, is_guess: bool
) -> None:
    """A box with its middle at the origin, or on the ground along one axis."""
    box = trimesh.creation.box((1, 2, 3))
    if ground is not None:
        box.apply_translation(np.eye(3)[ground] * box.extents[ground] / 2)
    path = tmp_path / f"box.{ending}"
    trimesh.Scene(box).export(path)
    subject = read_subject(path)
    assert (subject.up, subject.up_is_guess) == (expected, is_guess)
    asked = read_subject(path, "x")
    assert (asked.up, asked.up_is_guess) == ("x", False)
    assert subject.mesh.unit.name == {"glb": "m", "3mf": "mm"}.get(ending, "units")
