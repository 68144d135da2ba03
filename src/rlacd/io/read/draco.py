"""Triangles of glTF files that Draco compressed.

Draco is decoded by DracoPy (extra ``draco``) in a process of its own: a damaged stream may crash it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, answer_of, served
from rlacd.io.read.contents import MOST_TRIANGLES, damaged
from rlacd.io.read.gltf_arrays import ITEMS, Arrays, Json, as_floats
from rlacd.pool import Blobs, Values

DRACO = "KHR_draco_mesh_compression"

DECODER = "rlacd.io.read.draco:decode"


def decode_draco(path: Path, primitives: Sequence[Json], required: bool, arrays: Arrays) -> bool:
    """Decode what Draco compressed, and let the primitives use the decoded arrays; whether there was anything.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    primitives : sequence of dict
        All in the file, changed in place.
    required : bool
        Whether the file says that it cannot be read otherwise.
    arrays : Arrays
        Gets the decoded arrays.

    Raises
    ------
    MeshFileError
        It is damaged, or would need more memory than is reasonable.
    MissingExtraError
        The extra ``draco`` is not installed.
    """
    streams: dict[str, bytes] = {}
    asked: dict[str, dict[str, tuple[int, bool, int]]] = {}
    for at, primitive in enumerate(primitives):
        compressed = primitive.get("extensions", {}).get(DRACO)
        if compressed is None:
            continue
        accessors = {name: arrays.accessor(index) for name, index in primitive["attributes"].items()}
        if not required and "bufferView" in accessors["POSITION"]:
            continue  # the same triangles, not compressed
        numbers = compressed["attributes"]
        asked[str(at)] = {
            name: (int(numbers[name]), bool(accessors[name].get("normalized")), ITEMS[accessors[name]["type"]])
            for name in ("POSITION", *numbers)
            if name.startswith(("POSITION", "JOINTS_", "WEIGHTS_"))
        }
        view = arrays.view(compressed["bufferView"])
        arrays.need(len(view))
        streams[str(at)] = bytes(view)
    if not streams:
        return False
    blobs = answer_of(DECODER, path, "glTF", {"path": str(path), "asked": asked}, streams).blobs
    for name, attributes in asked.items():
        primitive = primitives[int(name)]
        for attribute in attributes:
            primitive["attributes"][attribute] = arrays.add(np.frombuffer(blobs[f"{name}.{attribute}"], "<f4"))
        primitive["indices"], primitive["mode"] = arrays.add(np.frombuffer(blobs[f"{name}.corners"], "<u4")), 4
    return True


@served
def decode(values: Values, blobs: Blobs) -> Answered:
    """Decode each stream: what is ``asked`` of it as ``NAME.ATTRIBUTE``, and ``NAME.corners``.

    What is asked of an attribute are its number, whether its integers are normalised, and its width.
    """
    import DracoPy

    arrays: dict[str, bytes] = {}
    for name, stream in blobs.items():
        try:
            mesh = DracoPy.decode(stream)
            corners = np.asarray(mesh.faces).reshape(-1, 3)
            found = {
                attribute: np.asarray(mesh.get_attribute_by_unique_id(number)["data"])
                for attribute, (number, _, _) in values["asked"][name].items()
            }
        except Exception as error:
            raise damaged(Path(values["path"]), "Draco", str(error)) from error
        if len(corners) > MOST_TRIANGLES:
            raise MeshFileError(f"{values['path']} holds more than {MOST_TRIANGLES} triangles: simplify it first")
        for attribute, (_, normalized, width) in values["asked"][name].items():
            rows = found[attribute]
            if rows.shape != (len(rows), width) or (len(corners) and corners.max() >= len(rows)):
                raise MeshFileError(f"{values['path']} holds triangles without points: export it again")
            arrays[f"{name}.{attribute}"] = as_floats(rows, normalized).astype("<f4").tobytes()
        arrays[f"{name}.corners"] = corners.astype("<u4").tobytes()
    return {}, arrays
