"""The command `rlacd` under faults: how it may end, and which files it may leave.

`faults.c` injects the faults: a full disk, failing renames, a clock that jumps, signals at a given moment. Environment
variables control each, so that it can be repeated.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from rlacd import NavigableSpace

Tree = dict[str, bytes]

STARTING = 0.7
"""CPU seconds before the work begins."""

PATIENCE = 1800.0

NO_THREAD = 127
"""Exit code of the C library when it cannot allocate thread-local data."""

MAIN = "from rlacd.cli.main import main; main()"

SMALL = """
import resource, sys
with open("/dev/null", "w") as sys.stdout:
    sys.argv, argv = ["rlacd", "decompose", "--help"], sys.argv
    try:
        import numpy, rlacd.cli.main, rlacd.io.write
        rlacd.decompose(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), threads=1)
        numpy.ones((64, 64)) @ numpy.ones((64, 64))
        rlacd.cli.main.app()
    except SystemExit:
        sys.argv, sys.stdout = argv, sys.__stdout__
held = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
limit = held + int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
rlacd.cli.main.main()
"""
"""Python code that runs the command with a given memory allowance beyond its use once all libraries are loaded."""


@dataclass(frozen=True)
class Fault:
    """A fault to inject.

    Attributes
    ----------
    name
    codes
        Exit codes that are acceptable; signals are negative.
    environment
        See `faults.c`.
    memory
        Bytes that the command may allocate beyond its loaded libraries; 0 for no limit.
    words
        Words added to the command line.
    """

    name: str
    codes: tuple[int, ...]
    environment: dict[str, str] = field(default_factory=dict)
    memory: int = 0
    words: tuple[str, ...] = ()

    @property
    def kills(self) -> bool:
        """Whether the command has no chance to clean up."""
        return any(code in self.codes for code in (-signal.SIGKILL, -signal.SIGTERM))


@dataclass(frozen=True)
class Run:
    """Outcome of a command.

    Attributes
    ----------
    code, said
    cpu
        CPU seconds, including its children.
    """

    code: int
    said: str
    cpu: float


def draw_fault(random: np.random.Generator, cpu: float, size: int) -> Fault:
    """Draw a fault for a command.

    Parameters
    ----------
    random
    cpu : float
        CPU seconds that its work takes without a fault.
    size : int
        Bytes that it writes without a fault.
    """
    moment = int(1000 * random.uniform(0.5 * STARTING, 1.1 * (STARTING + cpu)))
    change = int(random.integers(1, 12))
    kill, term, stop = int(signal.SIGKILL), int(signal.SIGTERM), int(signal.SIGINT)
    faults = [
        Fault("full disk", (0, 3), {"FAULT_DISK": str(int(random.uniform(0, 1.1 * size)))}),
        Fault("failing renaming", (0, 3), {"FAULT_RENAME": str(random.integers(1, 4))}),
        Fault("killed", (0, -kill), {"FAULT_CPU": f"{moment},{kill}"}),
        Fault("killed while writing", (0, -kill), {"FAULT_CHANGE": f"{change},{kill}"}),
        Fault("terminated", (0, -term), {"FAULT_CPU": f"{moment},{term}"}),
        Fault("Ctrl-C", (0, 4, 130), {"FAULT_CPU": f"{moment},{stop}"}),
        Fault("Ctrl-C twice", (0, 4, 130), {"FAULT_CPU": f"{moment},{stop},{stop}"}),
        Fault("Ctrl-C while writing", (0, 4, 130), {"FAULT_CHANGE": f"{change},{stop}"}),
        Fault("small memory", (0, 2, NO_THREAD), memory=int(2 ** random.uniform(26, 31))),
        Fault(
            "clock jumps",
            (0,),
            {"FAULT_CLOCK": f"{random.integers(0, 200)},{random.choice([-(10**8), -60, 60, 10**8])}"},
        ),
        Fault("timeout", (0, 4), words=("--timeout", f"{random.choice([0.001, 0.05, 0.3, 1.0]):g}")),
    ]
    return faults[int(random.integers(len(faults)))]


def command(words: list[str], fault: Fault | None = None) -> Run:
    """Run the command and wait for its end."""
    environment = dict(os.environ)
    arguments = ["-c", MAIN]
    if fault is not None:
        words = [*words, *fault.words]
        environment |= {"LD_PRELOAD": str(library()), **fault.environment} if fault.environment else {}
        if fault.memory:
            arguments = ["-c", SMALL, str(fault.memory)]
            environment |= {"OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "1"}  # threads reserve memory
    process = subprocess.Popen(
        [sys.executable, *arguments, *words], env=environment, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    patience = threading.Timer(PATIENCE, process.kill)
    patience.start()
    assert process.stderr is not None
    with process.stderr:
        said = process.stderr.read().decode(errors="replace")
    _, status, used = os.wait4(process.pid, 0)
    patience.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return Run(process.returncode, said, used.ru_utime + used.ru_stime)


@cache
def library() -> Path:
    """Compile `faults.c` for this process."""
    place = Path(mkdtemp(prefix="rlacd-faults-")) / "faults.so"
    source = Path(__file__).with_name("faults.c")
    subprocess.run(["cc", "-std=c11", "-O1", "-shared", "-fPIC", "-o", place, source, "-ldl", "-lrt"], check=True)
    return place


def complaints(fault: Fault, run: Run) -> list[str]:
    """List what is wrong with the outcome of a command."""
    found = []
    lines = run.said.strip().splitlines()
    if run.code not in fault.codes:
        found.append(f"it ended with {run.code}, not {' or '.join(map(str, fault.codes))}: {' | '.join(lines[-3:])}")
    elif "Traceback" in run.said:
        found.append(f"a traceback: {lines[-1]}")
    elif run.code in (1, 2, 3, 130) and not any(line.startswith("rlacd: ") for line in lines):
        found.append(f"it ended with {run.code} and did not say why: {' | '.join(lines)}")
    return found


def left_behind(fault: Fault, code: int, main: str, before: Tree, after: Tree, whole: Tree) -> list[str]:
    """List what is wrong with the files that a command left.

    Parameters
    ----------
    fault : Fault
    code : int
    main : str
        The file that refers to all others; empty for a folder.
    before, after, whole : dict of bytes
        The files before, now, and after a run without a fault.
    """
    # A run that stopped early may have more hulls than the whole one, and so more files.
    strays = [n for n in after if n not in before and n not in whole and (code != 4 or Path(n).name.startswith("."))]
    found = [f"{name} was left behind" for name in strays if not fault.kills]
    half = [name for name, content in after.items() if name in whole and content not in (before.get(name), whole[name])]
    lost = [name for name in before if name not in after and name in whole]
    if code != 4:
        found += [f"{name} is neither the old file nor the new one" for name in half]
    found += [f"{name} is lost" for name in lost]
    if code == 0 and any(after.get(name) != content for name, content in whole.items()):
        found.append("done, but the files are not those of an undisturbed run")
    made = code not in (0, 4) and main in whole and after.get(main) == whole[main] != before.get(main)
    if made and any(after.get(name) != content for name, content in whole.items()):
        found.append(f"{main} names files that are not there")
    if code in (2, 3, 130) and not made and any(after.get(n) != before.get(n) for n in whole if n in before):
        found.append(f"an old file is replaced although it ended with {code}")
    return found


def tree(folder: Path) -> Tree:
    """Read all files of a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def words_of(options: dict[str, Any]) -> list[str]:
    """Convert options of `rlacd.decompose` to command-line arguments."""
    words = []
    for name, value in options.items():
        if isinstance(value, NavigableSpace):
            words += ["--criterion", "navigable", "--radius", str(value.radius), "--tolerance", str(value.tolerance)]
            words += [] if value.reachable_only else ["--everywhere"]
            for normal, offset in value.closed_planes:
                words.append(f"--closed-plane={','.join(map(repr, (*normal, offset)))}")
        elif name == "merge":
            words.append("--merge" if value else "--no-merge")
        else:
            words.append(f"--{name.replace('_', '-')}={value}")
    return words
