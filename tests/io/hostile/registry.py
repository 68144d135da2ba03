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


def refused(name: str, says: str, content: Content | None = None) -> Callable[[Content], None]:
    """Register what makes the content of a file, given here or decorated; its ending is the last part of `name`."""

    def register(content: Content) -> None:
        REFUSED[name] = (_writer(name, content), says)

    if content is not None:
        register(content)
    return register


def harmless(name: str, content: Content | None = None) -> Callable[[Content], None]:
    def register(content: Content) -> None:
        HARMLESS[name] = _writer(name, content)

    if content is not None:
        register(content)
    return register


def _writer(name: str, content: Content) -> Build:
    def write(folder: Path) -> Path:
        path = folder / f"mesh.{name.rpartition('.')[2]}"
        path.write_bytes(content())
        return path

    return write
