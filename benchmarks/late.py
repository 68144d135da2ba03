"""How late a decomposition ends: after `timeout` of ``rlacd.decompose``, or after Ctrl-C on the command."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import click
import trimesh
from tests.shapes_large import LARGE

from benchmarks.tables import Table

GIVE_UP = 120.0
"""Seconds after which a run that does not end is killed."""

TIMEOUT = """
result = rlacd.decompose(path, timeout=seconds).report
"""

CTRL_C = """
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background
threading.Timer(seconds, os.kill, [os.getpid(), signal.SIGINT]).start()
try:
    app(["decompose", path, "-o", out, "--report", out + ".json"], prog_name="rlacd")
except SystemExit:  # what is left to do is to end the process at once
    result = json.load(open(out + ".json"))
"""

AROUND = """
import json, os, signal, sys, threading, time, rlacd
from rlacd.cli.main import app
path, seconds, out = sys.argv[1], float(sys.argv[2]), sys.argv[3]
rlacd.decompose  # loads the libraries
at = []
threading.Timer(seconds, lambda: at.append((time.perf_counter(), time.process_time()))).start()
{}
wall, cpu = at[0] if at else (float("nan"), float("nan"))
told = [time.perf_counter() - wall, time.process_time() - cpu, result["hulls"], result["hausdorff"]["missed"]]
print(json.dumps(told))
"""


@click.command()
@click.argument("shapes", nargs=-1)
@click.option("--seconds", default=2.0, show_default=True, help="The timeout, and when Ctrl-C is sent.")
def app(shapes: tuple[str, ...], seconds: float) -> None:
    """Measure seconds from the timeout, and from Ctrl-C, to the end; each run is a process of its own.

    SHAPES are meshes, or some of those that `tests.shapes_large` makes; default: all of these. At most 1.0 s and a
    tenth of the timeout are promised. Lateness is wall time and grows with the load of the machine, so CPU seconds
    stand beside it; nan: it ended before.

    \b
    python -m benchmarks late sponge --seconds 2
    """
    lines = []
    for shape in shapes or LARGE:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(shape)
            if shape in LARGE:
                path = Path(folder) / f"{shape}.ply"
                trimesh.Trimesh(*LARGE[shape](), process=False).export(path)
            for name, how in (("timeout", TIMEOUT), ("Ctrl-C", CTRL_C)):
                command = [sys.executable, "-c", AROUND.format(how), str(path), str(seconds), f"{folder}/hulls.glb"]
                run = subprocess.run(command, capture_output=True, text=True, timeout=seconds + GIVE_UP)
                told = json.loads(run.stdout.splitlines()[-1]) if run.stdout else [run.stderr[-200:]]
                lines.append([f"{path.stem}, {name}", *(f"{x:.2f}" if isinstance(x, float) else x for x in told)])
                click.echo(lines[-1])
    click.echo(Table(["shape", "s late", "CPU s", "hulls", "under"], lines))
