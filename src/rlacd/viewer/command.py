"""The viewer's options as a command for a terminal."""

from __future__ import annotations

import dataclasses
import os
import shlex
from pathlib import Path
from typing import Any

from rlacd.io.write import file_stem
from rlacd.options import CRITERIA, Options

ENDING = ".glb"


def as_command(mesh: str | os.PathLike[str], given: dict[str, Any], usual: Any) -> str:
    """Write ``rlacd decompose`` with the options set on the page.

    Parameters
    ----------
    mesh : path-like
    given : dict
        Values of the controls, by the field names of `usual`.
    usual : dataclass instance
        Default values of the controls; options at their default are left out.

    Returns
    -------
    str
        One line, quoted for a POSIX shell.
    """
    own = CRITERIA.get(str(given.get("criterion")), Options().numbers)
    others = {number for numbers in CRITERIA.values() for number in numbers} - {*own}
    words = ["rlacd", "decompose", os.fspath(mesh)]
    for field in dataclasses.fields(usual):
        value = given.get(field.name)
        if field.name not in others and value is not None and value != getattr(usual, field.name):
            words += [f"--{field.name.removeprefix('volume_').replace('_', '-')}", _word(value)]
    return shlex.join([*words, "-o", f"{file_stem(Path(mesh).stem)}_hulls{ENDING}"])


def _word(value: Any) -> str:
    if value is True:
        return "all"
    if isinstance(value, (list, tuple)):
        return ",".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
