"""STEP and IGES files: OpenCASCADE (cascadio, extra ``cad``) makes triangles of them, in a process of its own."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, answer_of, served
from rlacd.io.read.contents import Contents, damaged
from rlacd.io.read.gltf import read_gltf, split
from rlacd.io.read.open_file import JSON_CHUNK, MAGIC
from rlacd.options.names import UNITS
from rlacd.pool import Blobs, Values

SERVER = "rlacd.io.read.cad:triangulate"

DEVIATION = 1e-3
"""How far triangles may be from the surface, as a share of the longest side: a fifth of a threshold of 0.01."""

ANGLE = 0.5
"""Radians between neighbouring triangles of a curved surface, however small: 13 sides a circle."""

ROUGH = 0.1
"""The same as a share of the edge that a surface ends at, where only its size is wanted."""


def read_cad(path: Path, content: bytes) -> Contents:
    """Read the solids and surfaces of an assembly: a node for each, in metres and the axes of the file.

    Raises
    ------
    MeshFileError
        It is damaged, holds too much, or nothing that has a surface.
    MissingExtraError
        The extra ``cad`` is not installed.
    """
    kind = "step" if path.suffix.lower() in (".step", ".stp") else "iges"
    glb = answer_of(SERVER, path, kind.upper(), {"path": str(path), "kind": kind}, {"file": content}).blobs["glb"]
    contents = read_gltf(path, glb)
    if not contents.geometry:
        raise MeshFileError(f"{path} holds no surfaces: if its parts lie elsewhere, export them all into one file")
    empty = sum("mesh" not in node and not node.get("children") for node in split(glb)[0]["nodes"])
    said = f"parts of {path.name} without surfaces, or that lie in other files, were left out: {empty}"
    return contents._replace(warnings=(*contents.warnings, *([said] if empty else [])), up="z")


@served
def triangulate(values: Values, blobs: Blobs) -> Answered:
    """Convert a ``file`` of a ``kind`` to a ``glb`` in metres: twice, the first time to see how large it is."""
    import cascadio

    def converted(**tolerance: float | bool) -> bytes:
        how = {"file_type": values["kind"], "tol_angular": ANGLE, "use_parallel": False, **tolerance}
        if glb := cascadio.load(blobs["file"], **how):
            return bytes(glb)
        raise damaged(Path(values["path"]), values["kind"].upper(), "or it holds no surfaces")

    glb = converted(tol_linear=ROUGH, tol_relative=True)
    if size := _size(read_gltf(Path(values["path"]), glb)):
        unit = 1.0 if values["kind"] == "iges" else UNITS["mm"]  # STEP is written in metres, and IGES as it is
        glb = converted(tol_linear=DEVIATION * size / unit)
    return {}, {"glb": _scaled(glb, UNITS["mm"]) if values["kind"] == "iges" else glb}


def _size(contents: Contents) -> float:
    """The longest side of all that is placed."""
    placed = [shape.vertices @ node.transform[:3, :3].T + node.transform[:3, 3] for node, shape in contents.geometry]
    return float(np.ptp(np.concatenate(placed), axis=0).max()) if placed else 0.0


def _scaled(glb: bytes, factor: float) -> bytes:
    """The same file with all its nodes below one that scales them."""
    header, rest = split(glb)
    header["nodes"].append({"scale": [factor] * 3, "children": header["scenes"][0]["nodes"]})
    header["scenes"][0]["nodes"] = [len(header["nodes"]) - 1]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    length = 20 + len(text) + len(rest or b"")
    return struct.pack("<4sIII4s", MAGIC, 2, length, len(text), JSON_CHUNK) + text + (rest or b"")
