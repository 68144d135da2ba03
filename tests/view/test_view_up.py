"""What the viewer takes for up, and for the unit of length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rlacd.view.controls import read_subject


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
    assert subject.unit == {"glb": "m", "3mf": "mm"}.get(ending, "")
