"""Stdin and stdout, named ``-``, as files: what reads and writes meshes needs names."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from rlacd.cli.exit_codes import give
from rlacd.errors import MeshFileError, OptionError

STDIO = "-"


@contextlib.contextmanager
def stdin_as_file(mesh: Path, ending: str | None) -> Iterator[Path]:
    """The mesh, or a file with what stdin holds, for as long as it is needed.

    Parameters
    ----------
    mesh : Path
        ``-`` for stdin.
    ending : str, optional
        The format of stdin; told from its content if it is not given.
    """
    if str(mesh) != STDIO:
        if ending is not None:
            raise OptionError(f"--from is the format of a mesh on stdin, not of {mesh}: give - as IN, or leave it out.")
        yield mesh
        return
    from rlacd.io.read.in_memory import as_file
    from rlacd.io.read.open_file import LARGEST_FILE

    content = b"" if sys.stdin is None else sys.stdin.buffer.read(LARGEST_FILE + 1)  # one more is refused as too large
    if not content.strip(b"\0 \t\r\n"):
        raise MeshFileError("stdin is empty: check what writes the mesh to it")
    if (ending or "").lower().removeprefix(".") in ("urdf", "xml"):
        raise OptionError("a robot refers to files beside it, so it is not read from stdin: give the name of its file.")
    with as_file(content, ending, "stdin", "--from ") as place:
        yield place


def refuse_stdin(mesh: Path) -> None:
    """Reject ``-`` where a file is needed."""
    if str(mesh) == STDIO:
        raise OptionError("only rlacd decompose reads stdin: give the name of a file.")


def stdout_name(output: str, file_type: str | None) -> str:
    """The name of a file whose content goes to stdout; any other output keeps its name."""
    from rlacd.io.write.target import FOLDER_FORMAT, MODEL_OF, WITH_MESHES, ending_of

    if output != STDIO:
        return output
    ending = ending_of(file_type or FOLDER_FORMAT)
    if MODEL_OF.get(ending) in WITH_MESHES:
        raise OptionError(f"{file_type} is written as several files, which cannot go to stdout: give -o a file name.")
    return f"hulls.{ending}"


@contextlib.contextmanager
def file_for(output: str, file_type: str | None) -> Iterator[str]:
    """The output, or a file whose content goes to stdout in the end."""
    if output != STDIO:
        yield output
        return
    with TemporaryDirectory(prefix="rlacd-") as folder:
        place = Path(folder) / stdout_name(output, file_type)
        yield str(place)
        give(place.read_bytes())
