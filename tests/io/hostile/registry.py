"""The list of hostile files, and how they are added to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from trimesh import creation

Build = Callable[[Path], Path]

REFUSED: dict[str, tuple[Build, str]] = {}
"""Files that have to be refused, and words of the sentence that says why."""

HARMLESS: dict[str, Build] = {}
"""Files that look bad but give a box."""

BOX = creation.box()


def refused(name: str, says: str) -> Callable[[Callable[[], bytes]], Callable[[], bytes]]:
    """Register what makes the content of a file; its ending is the last part of `name`."""

    def register(content: Callable[[], bytes]) -> Callable[[], bytes]:
        REFUSED[name] = (_writer(name, content), says)
        return content

    return register


def harmless(name: str) -> Callable[[Callable[[], bytes]], Callable[[], bytes]]:
    def register(content: Callable[[], bytes]) -> Callable[[], bytes]:
        HARMLESS[name] = _writer(name, content)
        return content

    return register


def _writer(name: str, content: Callable[[], bytes]) -> Build:
    def write(folder: Path) -> Path:
        path = folder / f"mesh.{name.rpartition('.')[2]}"
        path.write_bytes(content())
        return path

    return write
