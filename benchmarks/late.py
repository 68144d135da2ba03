"""How late a decomposition ends: after `timeout` of ``rlacd.decompose``, or after Ctrl-C on the command (Linux)."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import trimesh
import typer
from tests.shapes_large import LARGE

from benchmarks.tables import Table

app = typer.Typer(add_completion=False)

GIVE_UP = 120.0
"""Seconds after which a run that does not end is killed."""


@app.command()
def late(
    shapes: Annotated[
        list[str] | None, typer.Argument(help=f"Meshes, or some of {', '.join(LARGE)}; default: these.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="The timeout, and when Ctrl-C is sent.")] = 2.0,
) -> None:
    """Measure seconds from the timeout, and from Ctrl-C, to the end; each run is a process of its own.

    At most 1.0 s and a tenth of the timeout are promised. Lateness is wall time and grows with the load of the machine,
    so CPU seconds stand beside it.

    \\b
    python -m benchmarks late sponge --seconds 2
    """
    lines = []
    for shape in shapes or list(LARGE):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(shape)
            if shape in LARGE:
                path = Path(folder) / f"{shape}.ply"
                trimesh.Trimesh(*LARGE[shape](), process=False).export(path)
            load = os.getloadavg()[0]
            out = Path(folder) / "hulls.glb"
            cells = [*_after_timeout(path, seconds), *_after_interrupt(path, out, seconds)]
            lines.append([path.stem, *cells, f"{load:.0f}"])
        print(lines[-1], flush=True)
    header = ["shape", "timeout: s late", "CPU s", "hulls", "under", "Ctrl-C: s late", "CPU s", "hulls", "exit", "load"]
    print(Table(header, lines))


ONE = """
import json, sys, threading, time, rlacd
path, seconds = sys.argv[1], float(sys.argv[2])
decompose, at = rlacd.decompose, []  # loads the libraries
start = time.perf_counter()
threading.Timer(seconds, lambda: at.append(time.process_time())).start()
result = decompose(path, timeout=seconds)
late = time.perf_counter() - start - seconds
cpu = time.process_time() - at[0] if at else 0.0
print(json.dumps([late, cpu, len(result), result.report["hausdorff"]["under"]]))
"""


def _after_timeout(path: Path, seconds: float) -> list[Any]:
    command = [sys.executable, "-c", ONE, str(path), str(seconds)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=seconds + GIVE_UP)
    except subprocess.TimeoutExpired:
        return [f"more than {GIVE_UP:.0f}", "", "", ""]
    if run.returncode:
        return [f"failed: {run.stderr.strip().splitlines()[-1:]}", "", "", ""]
    late, cpu, hulls, under = json.loads(run.stdout)
    return [f"{late:.2f}", f"{cpu:.2f}", hulls, "–" if under is None else f"{under:.3f}"]


def _after_interrupt(path: Path, out: Path, seconds: float) -> list[Any]:
    command = [sys.executable, "-m", "rlacd", "decompose", str(path), "-o", str(out), "--report", "-"]
    ignoring = partial(signal.signal, signal.SIGINT, signal.SIG_IGN)  # until it sets its own
    with tempfile.TemporaryFile() as report:
        run = subprocess.Popen(command, stdout=report, stderr=subprocess.DEVNULL, preexec_fn=ignoring)
        while run.poll() is None and _ignores_interrupts(run.pid):  # it listens once its work starts
            time.sleep(0.01)
        time.sleep(seconds)
        if run.poll() is not None:
            return ["ended before", "", "", run.returncode]
        start, before = time.perf_counter(), _cpu(run.pid)
        run.send_signal(signal.SIGINT)
        patience = threading.Timer(GIVE_UP, run.kill)
        patience.start()
        _, status, used = os.wait4(run.pid, 0)
        patience.cancel()
        late, code = time.perf_counter() - start, os.waitstatus_to_exitcode(status)
        run.returncode = code
        report.seek(0)
        hulls = json.loads(report.read())["parts"] if code in (0, 4) else "–"
    return [f"{late:.2f}", f"{used.ru_utime + used.ru_stime - before:.2f}", hulls, code]


def _ignores_interrupts(process: int) -> bool:
    lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    ignored = next(line for line in lines if "SigIgn" in line)
    return bool(int(ignored.split()[1], 16) >> (signal.SIGINT - 1) & 1)


def _cpu(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
