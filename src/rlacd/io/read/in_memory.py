"""Contents and open files, as files with a name, which readers need."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rlacd.errors import MeshDataError, MeshFileError, OptionError
from rlacd.io.read.open_file import LARGEST_FILE, format_of


@contextmanager
def as_file(content: bytes, file_type: str | None, name: str, option: str) -> Iterator[Path]:
    """A file with this content, for as long as it is needed.

    Parameters
    ----------
    content : bytes
    file_type : str, optional
        Its format; told from its content if it is not given.
    name : str
        What messages call it.
    option : str
        What is written before its format to give that.

    Raises
    ------
    OptionError
        Its format cannot be told.
    """
    ending = (file_type or format_of(content) or "").lower().removeprefix(".")
    if not ending.isalnum():
        raise OptionError(f"what {name} holds cannot be told from its content: add {option}obj, or what it is.")
    with TemporaryDirectory(prefix="rlacd-") as folder:
        place = Path(folder) / f"{Path(name).stem}.{ending}"
        place.write_bytes(content)
        try:
            yield place
        except MeshFileError as error:
            said = str(error).replace(str(place), name).replace("rename it to .", f"use {option}")
            raise MeshFileError(said) from error


def is_in_memory(source: Any) -> bool:
    """Whether something is the content of a file, or an open one."""
    return isinstance(source, bytes | bytearray | memoryview) or hasattr(source, "read")


@contextmanager
def opened(source: Any, file_type: str | None) -> Iterator[Path]:
    """Bytes, or a file that is open in binary mode, as `as_file`.

    Raises
    ------
    MeshDataError
        It is open as text.
    OptionError
        Its format cannot be told.
    """
    if file_type is None and (path := _path_of(source)) is not None:
        yield path
        return
    content, name = source, getattr(source, "name", None)
    if hasattr(source, "read"):
        content = source.read(LARGEST_FILE + 1)  # one more is refused as too large
    if isinstance(content, str):
        raise MeshDataError("the file is open as text: open it in binary mode ('rb')")
    name = name if isinstance(name, str) and Path(name).stem else "mesh"
    with as_file(bytes(content), file_type or Path(name).suffix or None, name, "file_type=") as place:
        yield place


def _path_of(source: Any) -> Path | None:
    """Where a file lies that is open at its begin, if it does: others beside it may belong to it."""
    try:
        lies_there = os.path.samestat(os.fstat(source.fileno()), os.stat(source.name))
        return Path(source.name) if lies_there and source.tell() == 0 and "b" in source.mode else None
    except (AttributeError, OSError, TypeError, ValueError):
        return None
