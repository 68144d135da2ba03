"""Triangles of glTF files that Draco compressed.

Draco is decoded by DracoPy (extra ``draco``) in a process of its own: a damaged stream may crash it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rlacd.errors import MeshFileError
from rlacd.io.read.apart import Answered, answer_of, served
from rlacd.io.read.contents import MOST_TRIANGLES
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
    asked: dict[str, tuple[int, bool, int]] = {}
    users: list[tuple[Json, dict[str, str]]] = []
    for primitive in primitives:
        compressed = primitive.get("extensions", {}).get(DRACO)
        if compressed is None:
            continue
        accessors = {name: arrays.accessor(index) for name, index in primitive["attributes"].items()}
        if not required and "bufferView" in accessors["POSITION"]:
            continue  # the same triangles, not compressed
        names: dict[str, str] = {}
        for attribute, number in compressed["attributes"].items():
            if attribute.startswith(("POSITION", "JOINTS_", "WEIGHTS_")):
                of = accessors[attribute]
                name = f"{compressed['bufferView']}.{number}.{of.get('normalized')}.{of['type']}"
                names[attribute] = name
                if name not in streams:
                    asked[name] = int(number), bool(of.get("normalized")), ITEMS[of["type"]]
                    view = arrays.view(compressed["bufferView"])
                    arrays.need(len(view))
                    streams[name] = bytes(view)
        users.append((primitive, names))
    if not streams:
        return False
    blobs = answer_of(DECODER, path, "glTF", {"path": str(path), "asked": asked}, streams).blobs
    added: dict[str, int] = {}
    for name in streams:
        added[f"{name}.points"] = arrays.add(np.frombuffer(blobs[f"{name}.points"], "<f4"))
        added[f"{name}.corners"] = arrays.add(np.frombuffer(blobs[f"{name}.corners"], "<u4"))
    for primitive, names in users:
        primitive["attributes"] |= {attribute: added[f"{name}.points"] for attribute, name in names.items()}
        primitive["indices"], primitive["mode"] = added[f"{names['POSITION']}.corners"], 4
    return True


@served
def decode(values: Values, blobs: Blobs) -> Answered:
    """Decode each stream: an attribute as ``NAME.points``, and ``NAME.corners``.

    What is ``asked`` of a stream are the attribute, whether its integers are normalised, and its width.
    """
    import DracoPy

    arrays: dict[str, bytes] = {}
    for name, stream in blobs.items():
        attribute, normalized, width = values["asked"][name]
        try:
            mesh = DracoPy.decode(stream)
            points = np.asarray(mesh.get_attribute_by_unique_id(attribute)["data"])
            corners = np.asarray(mesh.faces).reshape(-1, 3)
        except Exception as error:
            raise MeshFileError(
                f"{values['path']} holds triangles that Draco cannot decode ({error!s:.100}): it is damaged; "
                "export it again"
            ) from error
        if points.shape != (len(points), width) or (len(corners) and corners.max() >= len(points)):
            raise MeshFileError(f"{values['path']} holds triangles without points: export it again")
        if len(corners) > MOST_TRIANGLES:
            raise MeshFileError(f"{values['path']} holds more than {MOST_TRIANGLES} triangles: simplify it first")
        arrays[f"{name}.points"] = as_floats(points, normalized).astype("<f4").tobytes()
        arrays[f"{name}.corners"] = corners.astype("<u4").tobytes()
    return {}, arrays
