"""What the viewer shows as a command for a terminal."""

from __future__ import annotations

import dataclasses
import os
import shlex
from pathlib import Path
from typing import Any

from rlacd.io.write import file_stem

ENDING = ".glb"


def as_command(mesh: str | os.PathLike[str], given: dict[str, Any], usual: Any) -> str:
    """Write ``rlacd decompose`` with the options that the page's controls hold.

    Parameters
    ----------
    mesh : path-like
    given : dict
        What the controls hold, by the names of `usual`.
    usual : dataclass instance
        What they hold where nothing is asked for; such options are left out.

    Returns
    -------
    str
        One line, quoted for a POSIX shell.
    """
    of_criterion = ("radius", "tolerance") if given.get("criterion") == "navigable" else ("threshold",)
    words = ["rlacd", "decompose", os.fspath(mesh)]
    for field in dataclasses.fields(usual):
        value = given.get(field.name)
        if field.name in ("threshold", "radius", "tolerance") and field.name not in of_criterion:
            continue
        if value is not None and value != getattr(usual, field.name):
            words += [f"--{field.name.replace('_', '-')}", f"{value:g}" if isinstance(value, float) else str(value)]
    return shlex.join([*words, "-o", f"{file_stem(Path(mesh).stem)}_hulls{ENDING}"])
