"""The objects of an OBJ file, each a node of a scene: what exporters make of a door, a wheel or a drawer."""

from __future__ import annotations

import re

import numpy as np
import trimesh

from rlacd.io.read.limits import MOST_PLACES
from rlacd.io.read.polygons import IntArray, obj_faces, triangles_of

_OBJECT, _GROUP = (re.compile(rb"^" + word + rb"(?:[ \t]+([^\n#]*))?$", re.MULTILINE) for word in (b"o", b"g"))


def objects_of(text: bytes) -> trimesh.Scene | None:
    """Read each object of an OBJ file as a node; its groups, if it has no objects.

    Parameters
    ----------
    text : bytes
        The file, whose points and faces begin with their letter and a space.

    Returns
    -------
    trimesh.Scene or None
        None for fewer than two objects with faces, for more than a scene may have, and for a file that cannot be read.
    """
    for word in (_OBJECT, _GROUP):
        found = [(match.start(), (match[1] or b"").strip()) for match in word.finditer(text)]
        if len({name for _, name in found}) > 1:
            return _scene(text, found)
        if found:
            return None
    return None


def _scene(text: bytes, found: list[tuple[int, bytes]]) -> trimesh.Scene | None:
    try:
        points, lines, counts, corners = obj_faces(text)
    except (ValueError, OverflowError):
        return None
    if not len(corners) or corners.min() < 0 or corners.max() >= len(points):
        return None
    names: dict[bytes, int] = {b"": 0}
    number = np.array([0, *(names.setdefault(name, len(names)) for _, name in found)])
    owner = number[np.searchsorted([start for start, _ in found], lines[:, 0], side="right")]
    faces = triangles_of(points, counts, corners)
    of_face = np.repeat(owner, np.maximum(counts - 2, 0))
    used = np.unique(of_face)
    if not 1 < len(used) <= MOST_PLACES:
        return None
    called = [name.decode(errors="replace") for name in names]
    scene = trimesh.Scene()
    for one, own in zip(used.tolist(), _by_owner(faces, of_face), strict=True):
        some, local = np.unique(own, return_inverse=True)
        mesh = trimesh.Trimesh(points[some], local.reshape(-1, 3), process=False)
        scene.add_geometry(mesh, node_name=called[one] or "mesh", geom_name=called[one] or "mesh")
    return scene


def _by_owner(faces: IntArray, owner: IntArray) -> list[IntArray]:
    """The faces of each owner, ascending, in their order."""
    order = np.argsort(owner, kind="stable")
    return np.split(faces[order], np.flatnonzero(np.diff(owner[order])) + 1)
