"""The list of hostile files, and how they are added to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from trimesh import creation

Build = Callable[[Path], Path]
Content = Callable[[], bytes]

REFUSED: dict[str, tuple[Build, str]] = {}
"""Files that have to be refused, and words of the sentence that says why."""

HARMLESS: dict[str, Build] = {}
"""Files that look bad but give a box."""

BOX = creation.box()


def refused(name: str, says: str) -> Callable[[Content], None]:
    """Register what makes the content of a file; its ending is the last part of `name`."""
    return lambda content: REFUSED.update({name: (_writer(name, content), says)})


def harmless(name: str) -> Callable[[Content], None]:
    return lambda content: HARMLESS.update({name: _writer(name, content)})


def _writer(name: str, content: Content) -> Build:
    def write(folder: Path) -> Path:
        path = folder / f"mesh.{name.rpartition('.')[2]}"
        path.write_bytes(content())
        return path

    return write
