"""Files made to harm are refused with one sentence, in little time and memory, and nothing outside is read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rlacd.errors import RlacdError
from rlacd.solid.load import load_mesh
from tests import hostile
from tests.bounded import bounded

MEMORY = 2**30
"""Address space that loading may take on top of what the process holds."""


def load(path: Path) -> tuple[int, float]:
    """Number of triangles, and the greatest coordinate."""
    mesh = load_mesh(path)
    return len(mesh.faces), float(abs(mesh.vertices).max())


@pytest.mark.parametrize("name", hostile.REFUSED)
def test_a_hostile_mesh_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    build, says = hostile.REFUSED[name]
    path = build(tmp_path)
    with pytest.raises(RlacdError) as caught:
        bounded(load, path, memory=MEMORY)
    text = str(caught.value)
    assert path.name in text
    assert len(text.splitlines()) == 1
    assert len(text) < 500 + len(str(path))
    assert re.search(says, text.replace(str(path), ""))


@pytest.mark.parametrize("name", hostile.HARMLESS)
def test_what_only_looks_hostile_is_read(name: str, tmp_path: Path) -> None:
    faces, extent = bounded(load, hostile.HARMLESS[name](tmp_path), memory=MEMORY)
    assert faces >= 12
    assert extent == 0.5
