"""Hides from rlacd what Windows or macOS lack, in this process and all its children: put this folder on PYTHONPATH.

Other packages have ports of their own for each system and go on seeing everything. Besides, text that rlacd reads or
writes in the encoding of the system, which differs, is an error.
"""

import builtins
import os
import re
import signal
import subprocess
import sys
import types
import warnings
from typing import Any

MODULES = {"fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"}
LACKING = re.compile(
    r"""O_(?!APPEND|CREAT|EXCL|RDONLY|RDWR|TRUNC|WRONLY).+ | SIG(?!ABRT|FPE|ILL|INT|KILL|SEGV|TERM|_).+
    | (get|set)(e|re|res)?[ug]id | (get|set)(groups|itimer|pgid|priority|sid) | get(loadavg|random)
    | (posix|pthread|sched)_.+ | sig(interrupt|pending|wait.*) | .*fork.* | (open)?pty | ttyname | killpg | wait[34]
    | l?f?chown | fchmod | mkfifo | mknod | memfd_create | p(read|write)v? | sendfile | statvfs | sync
    | alarm | nice | pause | sysconf | uname""",
    re.VERBOSE,
)
"""Of `os` and `signal`. (SIGKILL is not on Windows either, but named beside `killpg`.)"""


def _asked_by_rlacd(frame: types.FrameType) -> bool:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0] == "rlacd"


class Lacking(types.ModuleType):
    """A module some of whose names rlacd cannot see."""

    def __getattribute__(self, name: str) -> Any:
        if LACKING.fullmatch(name) and _asked_by_rlacd(sys._getframe(1)):
            raise AttributeError(f"module has no attribute {name!r} on this system")
        return super().__getattribute__(name)


os.__class__ = Lacking  # type: ignore[assignment]
signal.__class__ = Lacking  # type: ignore[assignment]

imports = builtins.__import__


def lacking_import(name: str, *arguments: Any, **more: Any) -> types.ModuleType:
    """Import what exists everywhere."""
    if name in MODULES and _asked_by_rlacd(sys._getframe(1)):
        raise ModuleNotFoundError(f"No module named {name!r} on this system", name=name)
    return imports(name, *arguments, **more)


builtins.__import__ = lacking_import


class Popen(subprocess.Popen):  # type: ignore[type-arg]
    """Refuses what Windows refuses."""

    def __init__(self, *args: Any, **options: Any) -> None:
        for refused in ("pass_fds", "preexec_fn"):
            if options.get(refused):
                raise ValueError(f"{refused} is not supported on Windows platforms")
        super().__init__(*args, **options)


subprocess.Popen = Popen  # type: ignore[misc]
warnings.filterwarnings("error", category=EncodingWarning, module=r"rlacd(\..*)?$")
