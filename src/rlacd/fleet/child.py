"""The process in which meshes are decomposed: ``python -m rlacd.fleet.child SOCKET``, one after another.

Whatever a mesh does (crash, hang, eat all memory, make a library print) happens here. A request is a line of JSON; the
answer is a line of JSON and then the files it names. The process ends when whoever started it does.
"""

from __future__ import annotations

import json
import os
import queue
import resource
import signal
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh

from rlacd.decompose import decompose
from rlacd.decomposition import Decomposition
from rlacd.errors import MeshError, RlacdError
from rlacd.fleet.order import Order
from rlacd.solid.load import load_mesh

READY = b"ready"

STAND_IN = "The convex hull of the whole mesh stands in for its decomposition."


def make(
    order: Order, mesh: Path, stem: str, staging: Path, hull_only: bool
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Decompose a mesh file and write what was asked for into a new folder.

    Parameters
    ----------
    order : Order
    mesh : Path
    stem : str
        What the file or folder is called.
    staging : Path
        An existing folder.
    hull_only : bool
        Take the convex hull of all points instead, inside the limits asked for.

    Returns
    -------
    dict
        What is said of the result.
    dict of bytes
        The files by name relative to the staging folder; a file that names others comes last.

    Raises
    ------
    RlacdError
        The mesh cannot be used, or its hulls cannot be written.
    """
    result = _hull(order, mesh) if hull_only else decompose(mesh, **order.arguments())
    with TemporaryDirectory(dir=staging) as folder:
        place = f"{folder}/{stem}{order.ending or '/'}"
        written: dict[str, Any] = {"density": order.density, "up": order.up_of(mesh.name), "one_mesh": order.one_mesh}
        result.save(place, file_format=order.file_format, **written)
        paths = sorted(path for path in Path(folder).rglob("*") if path.is_file())
        paths.sort(key=lambda path: -len(path.relative_to(folder).parts))
        files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
    return _summary(result.report), files


def _hull(order: Order, mesh: Path) -> Decomposition:
    """One hull around everything: a cloud of points has no shape but that."""
    source = load_mesh(mesh)
    used = source.vertices[np.unique(source.faces)] if len(source.faces) else source.vertices
    limits: dict[str, Any] = {
        name: order.options.get(name) for name in ("max_vertices", "max_faces", "preset", "threads")
    }
    around = decompose((used, np.empty((0, 3), dtype=np.int64)), max_hulls=1, quality="fast", **limits)
    told = {what: around.report[what] for what in ("parts", "faces", "vertices")}
    told |= {"name": mesh.stem, "complete": False, "warnings": [STAND_IN]}
    return Decomposition(around.hulls, told, trimesh.Trimesh(source.vertices, source.faces, process=False))


def _summary(report: dict[str, Any]) -> dict[str, Any]:
    """What is the same whenever and wherever the mesh is decomposed."""
    same = ("parts", "faces", "vertices", "complete", "hausdorff")
    kept: dict[str, Any] = {what: report[what] for what in same if what in report}
    if "concavity" in report:
        kept["concavity"] = report["concavity"]["max"]
    if "navigable" in report:
        kept["intrusion"] = report["navigable"]["intrusion"]["max"]
    return {**kept, "warnings": report["warnings"]}


def answer(request: dict[str, Any]) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Do what a request asks; whatever goes wrong is part of the answer."""
    wall, cpu = time.perf_counter(), time.process_time()
    files: dict[str, bytes] = {}
    try:
        order = Order(**request["order"])
        mesh, staging = Path(request["mesh"]), Path(request["staging"])
        report, files = make(order, mesh, request["stem"], staging, request["hull_only"])
        said: dict[str, Any] = {"report": report}
    except MeshError as error:
        said = {"error": _sentence(error, request), "unusable": True}
    except RlacdError as error:
        said = {"error": _sentence(error, request)}
    except MemoryError:
        said = {"error": "there is not enough memory for it"}
    except Exception as error:
        said = {"error": f"a bug in rlacd ({type(error).__name__}: {_sentence(error, request)})"}
    said["seconds"] = round(time.perf_counter() - wall, 4)
    said["cpu"] = round(time.process_time() - cpu, 4)
    said["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // (
        2**20 if sys.platform == "darwin" else 2**10
    )
    return said, files


def _sentence(error: Exception, request: dict[str, Any]) -> str:
    """First line of a message, with the mesh's name where this machine's path to it stood."""
    line = (str(error).strip().splitlines() or ["no message"])[0]
    return line.replace(request["mesh"], request["name"]).replace(request["staging"], "")


def main() -> None:
    """Answer requests until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it decides what Ctrl-C ends
    os.dup2(2, 1)
    connection = Connection(int(sys.argv[1]))
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                requests.put(connection.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)  # in the middle of a mesh, too: nobody waits for it any more

    threading.Thread(target=listen, daemon=True).start()
    connection.send_bytes(READY)
    while True:
        said, files = answer(json.loads(requests.get()))
        connection.send_bytes(json.dumps({**said, "files": list(files)}).encode())
        for content in files.values():
            connection.send_bytes(content)


if __name__ == "__main__":
    main()
