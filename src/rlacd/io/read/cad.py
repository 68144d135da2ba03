"""STEP and IGES files: OpenCASCADE (cascadio, extra ``cad``) makes triangles of them, in a process of its own."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, answer_of, served
from rlacd.io.read.contents import USUAL, Contents, Fineness, damaged
from rlacd.io.read.gltf import read_gltf, split
from rlacd.io.read.open_file import JSON_CHUNK, MAGIC
from rlacd.options.names import UNITS
from rlacd.pool import Blobs, Values

SERVER = "rlacd.io.read.cad:triangulate"

MOST_OF_CAD = 500_000
"""Triangles, about: with a smaller deviation their number grows in proportion, and the time faster."""

ANGLE = 0.5
"""Radians between neighbouring triangles of a curved surface, however small: 13 sides a circle."""

_LAST_LINE = re.compile(rb"^.{72}T", re.MULTILINE)
"""Of an IGES file. Without it, OpenCASCADE takes what is there for all."""

ROUGH = 0.1
"""The same as a share of the edge that a surface ends at, where only its size is wanted."""


def read_cad(path: Path, content: bytes, fineness: Fineness) -> Contents:
    """Read the solids and surfaces of an assembly: a node for each, in metres and the axes of the file.

    A deviation that takes more than `MOST_OF_CAD` triangles becomes larger, with a warning.

    Raises
    ------
    MeshFileError
        It is damaged, holds too much, or nothing that has a surface.
    MissingExtraError
        The extra ``cad`` is not installed.
    """
    kind = "step" if path.suffix.lower() in (".step", ".stp") else "iges"
    if kind == "iges" and _LAST_LINE.search(content) is None:
        raise damaged(path, "IGES", "its last line is missing")
    wanted = {"path": str(path), "kind": kind, **fineness._asdict()}
    answer = answer_of(SERVER, path, kind.upper(), wanted, {"file": content})
    glb, contents = answer.blobs["glb"], read_gltf(path, answer.blobs["glb"])
    if not contents.geometry:
        raise MeshFileError(f"{path} holds no surfaces: if its parts lie elsewhere, export them all into one file")
    empty = sum("mesh" not in node and not node.get("children") for node in split(glb)[0]["nodes"])
    said = [f"parts of {path.name} without surfaces, or that lie in other files, were left out: {empty}"] * (empty > 0)
    deviation, sought = answer.values["deviation"], answer.values["sought"]
    if deviation > sought:
        said.append(
            f"the triangles of {path.name} are up to {deviation / sought:.3g} times as far from its surfaces as a "
            f"tenth of the threshold: nearer ones would be over {MOST_OF_CAD}"
        )
    return contents._replace(warnings=(*contents.warnings, *said), up="z", deviation=deviation)


@served
def triangulate(values: Values, blobs: Blobs) -> Answered:
    """Convert a ``file`` of a ``kind`` to a ``glb`` in metres, with the ``deviation`` ``sought``, or a larger one.

    First it is converted roughly, to see how large it is, then as usual, to see how many triangles that takes.
    """
    import cascadio

    def converted(**tolerance: float | bool) -> bytes:
        how = {"file_type": values["kind"], "tol_angular": ANGLE, "use_parallel": False, **tolerance}
        if glb := cascadio.load(blobs["file"], **how):
            return bytes(glb)
        raise damaged(Path(values["path"]), values["kind"].upper(), "or it holds no surfaces")

    def contents_of(glb: bytes) -> Contents:
        return read_gltf(Path(values["path"]), glb)

    unit = UNITS["mm"] if values["kind"] == "iges" else 1.0  # STEP is written in metres, and IGES in millimetres
    glb = converted(tol_linear=ROUGH, tol_relative=True)
    whole, least = (unit * size for size in _sizes(contents_of(glb)))
    usual = USUAL.share * whole
    wanted = values["share"] * (least if values["of_nodes"] else whole)
    wanted = wanted if values["metres"] is None else values["metres"]
    deviation = sought = min(wanted, usual)
    if usual > 0:
        glb = converted(tol_linear=usual / UNITS["mm"])
    if sought < usual:
        count = sum(len(shape.faces) for _, shape in contents_of(glb).geometry)
        deviation = max(sought, usual * min(count / MOST_OF_CAD, 1.0))
        glb = converted(tol_linear=deviation / UNITS["mm"])
    facts = {"deviation": deviation, "sought": sought}
    return facts, {"glb": _scaled(glb, unit) if values["kind"] == "iges" else glb}


def _sizes(contents: Contents) -> tuple[float, float]:
    """The longest side of all that is placed, and that of the smallest node."""
    placed = [shape.vertices @ node.transform[:3, :3].T + node.transform[:3, 3] for node, shape in contents.geometry]
    if not placed:
        return 0.0, 0.0
    sides = [float(np.ptp(points, axis=0).max()) for points in placed]
    return float(np.ptp(np.concatenate(placed), axis=0).max()), min(sides)


def _scaled(glb: bytes, factor: float) -> bytes:
    """The same file with all its nodes below one that scales them."""
    header, rest = split(glb)
    header["nodes"].append({"scale": [factor] * 3, "children": header["scenes"][0]["nodes"]})
    header["scenes"][0]["nodes"] = [len(header["nodes"]) - 1]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    length = 20 + len(text) + len(rest or b"")
    return struct.pack("<4sIII4s", MAGIC, 2, length, len(text), JSON_CHUNK) + text + (rest or b"")
