"""How late a decomposition ends when stopped by `timeout`, or by Ctrl-C on the command line.

    python benchmarks/timeout.py timeout [--seconds 2] [SHAPE ...]
    python benchmarks/timeout.py interrupt [--seconds 2] [SHAPE ...]

SHAPE is a name in `tests/shapes_large.py` (all of them by default) or the path of a mesh. Every run is a fresh process.
Lateness is wall time, with the CPU seconds spent in it: for `rlacd.decompose` from its call, beyond the timeout; for
the command from SIGINT, sent `--seconds` after its start, to its exit. It grows with the load of the machine, whose
1-minute average is printed too.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.shapes_large import LARGE

PROMISE, SHARE = 1.0, 0.1
"""Allowed lateness: seconds, and a share of the timeout."""

GIVE_UP = 120.0


def mesh_of(shape: str) -> Any:
    return LARGE[shape]() if shape in LARGE else shape


def one(shape: str, seconds: float) -> dict[str, Any]:
    """Decompose in this process, and report how long each stage lasted beyond the timeout."""
    import rlacd

    mesh = mesh_of(shape)
    decompose = rlacd.decompose  # loads the libraries
    began: list[tuple[float, str]] = []
    start = time.perf_counter()

    def note(progress: rlacd.Progress) -> None:
        if not began or began[-1][1] != progress.stage:
            began.append((time.perf_counter() - start, progress.stage))

    at_deadline: list[float] = []
    watch = threading.Timer(seconds, lambda: at_deadline.append(time.process_time()))
    watch.start()
    result = decompose(mesh, timeout=seconds, progress=note)
    end = time.perf_counter() - start
    cpu = time.process_time() - at_deadline[0] if at_deadline else 0.0
    ends = [*(at for at, _ in began[1:]), end]
    late = [(round(b - max(a, seconds), 2), stage) for (a, stage), b in zip(began, ends, strict=True) if b > seconds]
    return {
        "late": end - seconds,
        "cpu": cpu,
        "parts": len(result),
        "stopped_by": result.report["stopped_by"],
        "stages": late,
        "under": result.report["hausdorff"]["under"],
        "warnings": [warning for warning in result.report["warnings"] if "ncomplete" in warning or "time" in warning],
    }


def timeout(shape: str, seconds: float) -> str:
    command = [sys.executable, __file__, "one", shape, "--seconds", str(seconds)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=seconds + GIVE_UP)
    except subprocess.TimeoutExpired:
        return f"more than {GIVE_UP:.0f} | | | |"
    if run.returncode:
        return f"failed: {run.stderr.strip().splitlines()[-1:]} | | |"
    result = json.loads(run.stdout)
    late = ", ".join(f"{stage} {more}" for more, stage in result["stages"] if more >= 0.05)
    under = "–" if result["under"] is None else f"{result['under']:.3f}"
    return f"{result['late']:.2f} | {result['cpu']:.2f} | {late} | {result['parts']} | {under}"


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _ignores_interrupts(process: int) -> bool:
    """Tell whether the command still ignores SIGINT because it has not started its work (Linux)."""
    ignored = next(
        line for line in Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines() if "SigIgn" in line
    )
    return bool(int(ignored.split()[1], 16) >> (signal.SIGINT - 1) & 1)


def _cpu(process: int) -> float:
    """CPU seconds of a process so far (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def interrupt(shape: str, seconds: float) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(shape)
        if shape in LARGE:
            import trimesh

            path = Path(folder) / "mesh.ply"
            trimesh.Trimesh(*mesh_of(shape), process=False).export(path)
        command = [sys.executable, "-c", "from rlacd.cli.main import main; main()", "decompose", str(path)]
        command += ["-o", str(Path(folder) / "hulls.glb"), "--report", "-"]
        report_file = Path(folder) / "report.json"
        with report_file.open("w") as out:
            run = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL, preexec_fn=_ignore_interrupts)
            while run.poll() is None and _ignores_interrupts(run.pid):
                time.sleep(0.01)
            time.sleep(seconds)
            before = run.poll()
            start, spent = time.perf_counter(), _cpu(run.pid)
            run.send_signal(signal.SIGINT)
            patience = threading.Timer(GIVE_UP, run.kill)
            patience.start()
            _, status, used = os.wait4(run.pid, 0)
            patience.cancel()
            code = run.returncode = os.waitstatus_to_exitcode(status)
            late = time.perf_counter() - start
            cpu = used.ru_utime + used.ru_stime - spent
        if before is not None or code not in (0, 4):
            return f"exit code {code} | | | |"
        report = json.loads(report_file.read_text())
        stages = ", ".join(f"{k} {v:.1f}" for k, v in report["seconds"].items() if k != "total")
        return f"{late:.2f} | {cpu:.2f} | {stages} | {report['parts']} | {code}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("timeout", "interrupt", "one"))
    parser.add_argument("shapes", nargs="*")
    parser.add_argument("--seconds", type=float, default=2.0)
    given = parser.parse_intermixed_args()
    if given.what == "one":
        print(json.dumps(one(given.shapes[0], given.seconds)))
        return
    measure = timeout if given.what == "timeout" else interrupt
    allowed = PROMISE + (SHARE * given.seconds if given.what == "timeout" else 0.0)
    print(f"{given.what} {given.seconds:g} s; at most {allowed:g} s late\n")
    own = (
        "CPU seconds after | stage | hulls | under"
        if given.what == "timeout"
        else "CPU seconds after | stages | hulls | exit"
    )
    print(f"| shape | seconds late | {own} | load |")
    print("|---|--:|--:|---|--:|--:|--:|" if given.what == "timeout" else "|---|--:|---|--:|--:|--:|")
    for shape in given.shapes or LARGE:
        row = measure(shape, given.seconds)
        print(f"| {Path(shape).stem} | {row} | {os.getloadavg()[0]:.0f} |", flush=True)


if __name__ == "__main__":
    main()
