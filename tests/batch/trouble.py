"""Meshes that make trouble, by their names, in any process started with `trouble` in its PYTHONPATH."""

from __future__ import annotations

from pathlib import Path

import trimesh

CODE = """
import os, signal, sys, time
import rlacd.decompose_mesh

module = sys.modules["rlacd.decompose_mesh"]
well = module.decompose_quietly

def decompose_quietly(mesh, *faces, **options):
    name = getattr(mesh, "stem", "")  # the hull of a mesh that failed is taken of its points
    if name.startswith("dies_once"):
        try:
            os.close(os.open(os.environ["TROUBLE_MARK"], os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return well(mesh, *faces, **options)
    if name.startswith("dies"):
        print("last words", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
    if name.startswith("hangs"):
        time.sleep(3600)
    if name.startswith("grows"):
        hoard = []
        while True:
            hoard.append(bytearray(os.urandom(1)) * 2**24)
    if name.startswith("slow"):
        time.sleep(float(os.environ.get("TROUBLE_SLOW", "0.5")))
    if name.startswith("prints"):
        os.write(1, b"x" * 10**6)
    if name.startswith("bug"):
        raise RuntimeError("surprise")
    return well(mesh, *faces, **options)

module.decompose_quietly = decompose_quietly
"""


def make_trouble(folder: Path) -> dict[str, str]:
    """Write the code; returns what has to be in the environment."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(CODE)
    return {"PYTHONPATH": str(folder), "TROUBLE_MARK": str(folder / "mark")}


def write_ell(path: Path, length: float = 2.0) -> Path:
    """Two boxes that make an L, so that there is something to cut."""
    boxes = [trimesh.creation.box(size) for size in ((length, 0.4, 0.4), (0.4, 0.4, 2.0))]
    ell = trimesh.util.concatenate(boxes)
    ell.apply_translation([1.0, 2.0, 3.0])
    path.parent.mkdir(parents=True, exist_ok=True)
    ell.export(path)
    return path


def tree(folder: Path, *without: str) -> dict[str, bytes]:
    """Every file of a folder, hidden ones too, by name."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if name not in without}
