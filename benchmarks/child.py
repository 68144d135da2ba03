"""The process that runs tools and measures their hulls: ``python -m benchmarks.child``, a task a line on stdin.

A tool that crashes, hangs, exhausts memory or prints to stdout does so here; results go to files.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.methods import Method, make_method
from benchmarks.metrics import measure
from benchmarks.store import Row, load_hulls, save_hulls
from rlacd.io.read.load import load_mesh
from rlacd.pool.process import peak_memory
from rlacd.repair.repair import repair


def run_method(mesh: Path, method: Method, setting: float, hulls: Path) -> None:
    """Run a method on a mesh file and save hulls, seconds and memory: arrays in, arrays out."""
    source = load_mesh(mesh)
    wall, cpu = time.perf_counter(), time.process_time()
    found = method.run(source.vertices, source.faces.astype(np.int32), setting, 1)
    account = {
        "version": method.version,
        "input_faces": len(source.faces),
        "wall": time.perf_counter() - wall,
        "cpu": time.process_time() - cpu,
        "peak_mb": peak_memory() / 2**20,
    }
    save_hulls(hulls, found, account)


def time_threads(mesh: Path, method: Method, setting: float, threads: int) -> Row:
    """The wall seconds of a method with so many threads, and how many processes wanted to run meanwhile."""
    source = load_mesh(mesh)
    faces, begun = source.faces.astype(np.int32), time.perf_counter()
    method.run(source.vertices, faces, setting, threads)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {"wall_threads": time.perf_counter() - begun, "load": load}


def measure_hulls(mesh: Path, method: Method, setting: float, hulls: Path) -> Row:
    """Measure the hulls that `run_method` saved."""
    found, account = load_hulls(hulls)
    if not found:
        return {**account, "error": "returned no hulls"}
    solid = repair(load_mesh(mesh), threads=1)
    return {**account, **measure(solid, found, method.concavity(setting)).as_plain()}


def _answer(task: dict[str, Any], warm: set[str]) -> Row:
    method, hulls = make_method(task["method"]), Path(task["hulls"])
    place = (Path(task["mesh"]), method, task["setting"], hulls)
    threads = task["threads"]
    try:
        if threads > 1 or not hulls.exists():
            if method.name not in warm:  # a run on a cube loads the libraries first
                cube = trimesh.creation.box()
                method.run(np.array(cube.vertices), np.array(cube.faces, dtype=np.int32), method.default, threads)
                warm.add(method.name)
            if threads > 1:
                return time_threads(*place[:3], threads)
            run_method(*place)
        return measure_hulls(*place)
    except MemoryError:
        return {"error": "out of memory"}
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}


def _listen(tasks: queue.Queue[str]) -> None:
    """Pass on lines of stdin; exit when it ends: the pipe closes when the parent dies, for whatever reason."""
    for line in sys.stdin:
        tasks.put(line)
    os._exit(1)


def main() -> None:
    """Do the tasks of stdin, each a JSON object; each answer goes to the file that its task names."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a tool prints is no answer
    tasks: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    warm: set[str] = set()
    while True:
        task = json.loads(tasks.get())
        if task["memory"] and sys.platform == "linux":
            import resource  # does not exist on Windows

            resource.setrlimit(resource.RLIMIT_AS, (task["memory"], task["memory"]))
        Path(task["answer"]).write_text(json.dumps(_answer(task, warm)), encoding="utf-8")
        print("done", file=answers, flush=True)


if __name__ == "__main__":
    main()
