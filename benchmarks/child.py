"""What the processes of a `benchmarks.runner.Bench` do: run a tool on a mesh, save its hulls, measure them.

A tool that crashes, hangs, exhausts memory or prints to stdout does so here (see `rlacd.pool`).
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.methods import Method, make_method
from benchmarks.metrics import measure
from benchmarks.store import Row, load_hulls, save_hulls
from rlacd.io.read.load import load_mesh
from rlacd.pool import Blobs, Server
from rlacd.pool.process import peak_memory
from rlacd.repair.repair import repair


def make_server(folder: Path) -> Server:
    """Answers tasks: ``mesh``, ``method``, ``setting``, ``threads``, and ``hulls``, the file that keeps them."""
    warm: set[str] = set()

    def answer(task: Row, _: Blobs) -> tuple[Row, dict[str, bytes]]:
        try:
            return _row(task, warm), {}
        except MemoryError:
            return {"error": "out of memory"}, {}
        except Exception as error:
            return {"error": f"{type(error).__name__}: {error}"}, {}

    return answer


def _row(task: Row, warm: set[str]) -> Row:
    method, hulls, threads = make_method(task["method"]), Path(task["hulls"]), task["threads"]
    if threads == 1 and hulls.exists():
        return _measured(Path(task["mesh"]), method, task["setting"], hulls)
    os.environ["OMP_NUM_THREADS"] = str(threads)  # read by a tool's library when it is loaded, which is below
    if method.name not in warm:
        cube = trimesh.creation.box()
        method.run(np.array(cube.vertices), np.array(cube.faces, dtype=np.int32), method.default, threads)
        warm.add(method.name)
    source = load_mesh(task["mesh"])
    faces = source.faces.astype(np.int32)
    wall, cpu = time.perf_counter(), time.process_time()
    found = method.run(source.vertices, faces, task["setting"], threads)
    spent = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    if threads > 1:  # for the wall time alone, with the number of processes that wanted to run meanwhile
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        return {"wall_threads": spent["wall"], "load": load}
    account = {"version": method.version, "input_faces": len(faces), **spent, "peak_mb": peak_memory() / 2**20}
    save_hulls(hulls, found, account)
    return _measured(Path(task["mesh"]), method, task["setting"], hulls)


def _measured(mesh: Path, method: Method, setting: float, hulls: Path) -> Row:
    found, account = load_hulls(hulls)
    if not found:
        return {**account, "error": "returned no hulls"}
    return {**account, **measure(repair(load_mesh(mesh), threads=1), found, method.concavity(setting)).as_plain()}
