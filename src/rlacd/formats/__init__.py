"""Hulls as files: GLB, OBJ, PLY, STL, or a folder with one file a hull."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import trimesh

from rlacd.errors import OutputError
from rlacd.formats.atomic import write_file
from rlacd.formats.balls import check_balls, save_balls
from rlacd.formats.encode import ENCODERS
from rlacd.formats.folder import write_folder
from rlacd.formats.target import FORMATS, Target, check_file, hull_target

__all__ = [
    "FORMATS",
    "Target",
    "check_balls",
    "check_file",
    "hull_target",
    "save_balls",
    "save_hulls",
    "write_file",
]


def save_hulls(
    hulls: Sequence[trimesh.Trimesh],
    path: str | os.PathLike[str],
    *,
    stem: str = "mesh",
    file_format: str | None = None,
) -> Path:
    """Write convex hulls to a file or a folder; see `rlacd.Decomposition.save`.

    Parameters
    ----------
    hulls : sequence of trimesh.Trimesh
        Convex and closed; at least one.
    path : path-like
        A file ``*.glb``, ``*.obj``, ``*.ply``, ``*.stl``, or a folder.
    stem : str
        Files in a folder are called ``<stem>_000.obj``, ``<stem>_001.obj``, ...
    file_format : str, optional
        The format inside a folder.

    Returns
    -------
    pathlib.Path
        Where it was written.

    Raises
    ------
    OutputError, OptionError
        As for `hull_target`, and for a disk that fails while writing.
    """
    if not hulls:
        raise OutputError("there are no hulls to write; decompose a mesh first.")
    target = hull_target(path, file_format)
    encode = ENCODERS[target.file_format]
    if target.is_folder:
        stem = _file_stem(stem)
        files = {f"{stem}_{i:03d}.{target.file_format}": encode([hull]) for i, hull in enumerate(hulls)}
        write_folder(target.path, stem, files)
    else:
        write_file(target.path, encode(hulls))
    return target.path


def _file_stem(name: str) -> str:
    # A mesh may be called anything; a file may not, and file systems count its name in bytes.
    plain = re.sub(r'[\x00-\x1f/\\:*?"<>|]', "_", name).strip(". ")
    return plain.encode(errors="replace")[:150].decode(errors="ignore").strip(". ") or "mesh"
