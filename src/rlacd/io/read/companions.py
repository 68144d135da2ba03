"""All the files that a mesh is read from, as bytes: what has to travel with it, and what its hash is taken of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from rlacd.errors import MeshFileError
from rlacd.io.read.open_file import LARGEST, read_file


def mesh_files(path: Path, name: str | None = None) -> dict[str, bytes]:
    """Read everything a mesh is read from, by name relative to its folder; its own file comes first.

    Parameters
    ----------
    path : Path
        The mesh file.
    name : str, optional
        What it is called in messages.

    Raises
    ------
    MeshFileError
        The mesh file cannot be opened.
    """
    try:
        content = read_file(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise MeshFileError(f"{name or path} cannot be opened ({reason}): check its name and permissions") from error
    return {path.name: content, **_buffers(path, content)}


def lay_out(files: Mapping[str, bytes], folder: Path) -> Path:
    """Write what `mesh_files` has read into a folder; returns the mesh file. Names that lead out of it are left out."""
    for name, content in files.items():
        target = folder / name
        if target.resolve().is_relative_to(folder.resolve()):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    return folder / next(iter(files))


def _buffers(path: Path, content: bytes) -> dict[str, bytes]:
    """Files beside a glTF file that its buffers name; what is missing or leads out of the folder is for the loader."""
    if path.suffix.lower() != ".gltf":
        return {}
    try:
        uris = [str(buffer["uri"]) for buffer in json.loads(content)["buffers"] if "uri" in buffer]
    except (ValueError, KeyError, TypeError, RecursionError):
        return {}
    found: dict[str, bytes] = {}
    for name in sorted({spelled for uri in uris if not uri.startswith("data:") for spelled in (uri, unquote(uri))}):
        try:
            buffer = (path.parent / name).resolve()
            if buffer.is_relative_to(path.parent.resolve()):
                found[name] = read_file(buffer, LARGEST - sum(map(len, found.values())))
        except (OSError, ValueError, RuntimeError):
            continue
    return found
