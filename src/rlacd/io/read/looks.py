"""What files other than glTF say of the looks of their triangles: normals, texture coordinates, colours, materials.

They are read only for a file that keeps them, a second time and after the triangles have been read without.
Pictures are decoded here, by Pillow where it is installed; those that are missing or damaged are left out.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rlacd.errors import installing
from rlacd.io.read import function_of
from rlacd.io.read.beside import FolderFiles
from rlacd.solid.arrays import FloatArray, Int64Array

_WITH_LOOKS = {
    "obj": "read.obj:scene_of_obj",
    "ply": "read.ply:scene_of_ply",
    "dae": "read.collada:scene_of_collada",
    "3mf": "read.threemf:scene_of_3mf",
}
"""By extension, the function that reads a file with its looks."""

BETWEEN = "\n"
"""In the name of a node in a scene of looks: between that of the node in the file, and that of its material."""


def looks_of(path: Path, content: bytes, extension: str) -> Any:
    """Parse a file again as a scene with everything that its parser reads; None, with a warning, where that fails.

    Parameters
    ----------
    path : Path
        Of the file, whose folder may hold its materials and pictures.
    content : bytes
        Its content, whose triangles have been read.
    extension : str
        ``obj``, ``ply``, ``dae`` or ``3mf``.
    """
    try:
        return function_of(_WITH_LOOKS[extension])(path, content)
    except Exception:  # parsers may raise anything on damaged files; the triangles have been read without looks
        warnings.warn(f"the looks of {path.name} could not be read, so it is grey", UserWarning, stacklevel=3)
        return None


def painted(arrays: Mapping[str, tuple[FloatArray, Int64Array]], material: Any) -> trimesh.Trimesh:
    """A mesh with looks.

    Parameters
    ----------
    arrays : mapping
        ``POSITION``, and ``TEXCOORD``, ``NORMAL`` and ``COLOR`` if there are any: rows, and which of them each corner
        of the triangles uses ``[F, 3]``. One that lacks rows is left out.
    material
        Of trimesh, or None.
    """
    kept = {name: both for name, both in arrays.items() if both[1].min() >= 0 and both[1].max() < len(both[0])}
    rows = np.stack([corners.ravel() for _, corners in kept.values()], axis=1)
    used, faces = np.unique(rows, axis=0, return_inverse=True)
    of = {name: array[used[:, at]] for at, (name, (array, _)) in enumerate(kept.items())}
    mesh = trimesh.Trimesh(of["POSITION"][:, :3], faces.reshape(-1, 3), vertex_normals=of.get("NORMAL"), process=False)
    uv = of["TEXCOORD"][:, :2] if "TEXCOORD" in of else None
    if material is not None or (uv is not None and "COLOR" not in of):
        material = material or trimesh.visual.material.SimpleMaterial()  # or trimesh makes up a picture
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    elif "COLOR" in of:
        mesh.visual.vertex_colors = of["COLOR"]
    return mesh


def opened_picture(beside: FolderFiles, name: str) -> Any:
    """A picture in the folder of a mesh; None, with a warning, if it cannot be decoded here."""
    try:
        from PIL import Image

        picture = Image.open(io.BytesIO(beside.get(name)))
        picture.load()  # now, when one that cannot be decoded may still be left out
        return picture
    except Exception as error:  # decoders may raise anything
        why = "it is not in the folder" if isinstance(error, FileNotFoundError) else "it is damaged or too large"
        why = f"run  {installing('view')}" if isinstance(error, ImportError) else why
        warnings.warn(f"the picture {name!r:.100} was left out: {why}", UserWarning, stacklevel=2)
        return None
