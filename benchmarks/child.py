"""The process that runs a tool and measures its hulls: ``python -m benchmarks.child``, one task per process.

A tool that crashes, hangs, exhausts memory or prints to stdout does so here; the results go to a file.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path

import numpy as np

from benchmarks.methods import make_method
from benchmarks.metrics import measure
from benchmarks.store import Row, load_hulls, save_hulls
from rlacd.io.read.load import load_mesh
from rlacd.pool.process import peak_memory
from rlacd.repair.repair import repair

_CUBE = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
_CUBE_FACES = np.array(
    [
        *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
        *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ],
    dtype=np.int32,
)


def run_method(mesh: Path, name: str, setting: float, threads: int, hulls: Path) -> None:
    """Run a method on a mesh file and save hulls, seconds and memory.

    The timing covers arrays in to arrays out: a run on a cube loads the libraries first.
    """
    method = make_method(name)
    source = load_mesh(mesh)
    method.run(_CUBE, _CUBE_FACES, setting, threads)
    before = peak_memory() / 2**20
    wall, cpu = time.perf_counter(), time.process_time()
    found = method.run(source.vertices, source.faces.astype(np.int32), setting, threads)
    seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
    account = {
        "version": method.version,
        "input_faces": len(source.faces),
        "threads": threads,
        "wall": seconds,
        "cpu": cpu_seconds,
        "peak_mb": peak_memory() / 2**20,
        "loaded_mb": before,
    }
    save_hulls(hulls, found, account)


def measure_hulls(mesh: Path, name: str, setting: float, threads: int, hulls: Path) -> Row:
    """Measure the hulls that `run_method` saved."""
    found, account = load_hulls(hulls)
    if not found:
        return {**account, "error": "returned no hulls"}
    solid = repair(load_mesh(mesh), threads=threads)
    promised = make_method(name).concavity(setting)
    return {**account, **measure(solid, found, promised, threads).as_plain()}


def _end_with_parent() -> None:
    """Exit when stdin ends: it is a pipe that closes when the parent dies, for whatever reason."""
    while os.read(0, 1):
        pass
    os._exit(1)


def main() -> None:
    """Do the task described by the only argument, a JSON text; the answer goes to the file it names."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    task = json.loads(sys.argv[1])
    if task["memory"] and sys.platform == "linux":
        import resource  # does not exist on Windows

        resource.setrlimit(resource.RLIMIT_AS, (task["memory"], task["memory"]))
    place = (Path(task["mesh"]), task["method"], task["setting"], task["threads"], Path(task["hulls"]))
    try:
        if not place[-1].exists():
            run_method(*place)
        Path(task["answer"]).write_text(json.dumps(measure_hulls(*place)), encoding="utf-8")
    except MemoryError:
        sys.exit("out of memory")
    except Exception as error:
        sys.exit(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
